"""Methods by name, and the one call that decomposes arrays."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openecho.decompose.decomposition import Decomposition
from openecho.decompose.inflection import Inflection, configure

FITTED: Mapping[str, Mapping[str, Any]] = {
    "gaussian": {"shape": "gaussian"},
    "laser": {"shape": "laser"},
    "vl": {"shape": "laser", "smoothed": True},
}
"""What distinguishes the methods that fit: Gaussians; the laser template; the same, looked for behind Vondrák's filter.

The last is that of X. Fan and Y.-Q. Wang, V-L decomposition of a novel full-waveform lidar system.
"""

METHODS = ("inflection", *FITTED)
"""Methods by name: the core's own, and those that fit."""


class Method(Protocol):
    """A method with its settings."""

    @property
    def columns(self) -> tuple[str, ...]:
        """What its echoes have besides what all have, of the words in `Column.needs`."""

    @property
    def sample_w(self) -> int | None:
        """Bits that a sample may have; None: any."""

    def __call__(self, samples: NDArray[Any], length: NDArray[Any], bin_ns: float | None) -> Decomposition:
        """Decompose waveforms (n, m) of so many samples (n,), counts; with nanoseconds if a bin's are known."""


def prepare(name: str, longest: int, settings: Mapping[str, Any]) -> Method:
    """Take a method with its settings.

    Parameters
    ----------
    name : str
        One of `METHODS`.
    longest : int
        Samples of the longest waveform to come.
    settings : mapping
        Of ``inflection``: `engine`, and what `configure` takes. Of the others: what `fitting.Fitting` takes, but for
        `shape` and `smoothed`.

    Returns
    -------
    Method

    Raises
    ------
    ValueError
        In one line, which name or value was found and what was expected.
    ModuleNotFoundError
        If the method needs a package that is not installed.
    """
    if name not in METHODS:
        raise ValueError(f"method: found {name!r}, expected one of {', '.join(METHODS)}")
    given = dict(settings)
    try:
        if name == "inflection":
            return Inflection(engine=given.pop("engine", "model"), config=configure(longest, **given))
        for series in ("transmitted", "correlation"):
            if given.get(series) is not None:
                given[series] = tuple(np.asarray(given[series], np.float64).tolist())
        fitting: Any = importlib.import_module("openecho.decompose.fitting").Fitting
        method: Method = fitting(**FITTED[name], **given)
    except TypeError as error:
        raise ValueError(f"method {name}: {error}") from error
    return method


def decompose(
    samples: ArrayLike,
    length: ArrayLike | None = None,
    *,
    method: str = "inflection",
    bin_ns: float | None = None,
    **settings: Any,
) -> Decomposition:
    """Find the echoes of each waveform.

    Parameters
    ----------
    samples : (n, m) array
        A waveform a row, counts; or (m,), one waveform. Integers for the core's own method.
    length : (n,) integer array, optional
        Samples that were recorded in each row; all m if left out.
    method : str
        One of `METHODS`: ``inflection``, bit for bit as the core finds them; ``gaussian``, ``laser`` or ``vl``, by
        least squares with errors.
    bin_ns : float, optional
        Sample interval in nanoseconds, for the columns in nanoseconds.
    **settings
        Of the method, as `prepare` takes them.

    Returns
    -------
    Decomposition

    Raises
    ------
    ValueError
        If an array or a setting is not as described.
    ModuleNotFoundError
        If the method needs a package that is not installed.

    Examples
    --------
    >>> found = openecho.decompose(samples, method="gaussian", bin_ns=1.0)  # doctest: +SKIP
    >>> found.echoes["peak_ns"], found.echoes["centre_error"]  # doctest: +SKIP
    """
    if bin_ns is not None and not 0 < bin_ns < np.inf:
        raise ValueError(f"bin_ns: found {bin_ns}, expected a positive number")
    rows = np.atleast_2d(np.asarray(samples))
    lengths = np.full(len(rows), rows.shape[1]) if length is None else np.atleast_1d(np.asarray(length))
    return prepare(method, rows.shape[-1], settings)(rows, lengths, bin_ns)
