"""What follows from the numbers: which way to use for what, and the study in five sentences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from openecho.study.trade.ways import FIT, FIXED, FLOATING, FRACS, TAPS, USUAL

ENOUGH = 1.01
"""Times the error of the longest word that a shorter one may have to count as enough: 1 %."""

EXACTING = ("land", "ocean", "snr 20", "snr 200", "snr 1000")
"""Sets on which a word has to be enough."""

ABRUPT = "neon_harvard decomposition"
"""Recorded set whose waveforms begin with their first echo."""

FOUND = 0.95
"""Share of the echoes from which on two echoes count as told apart."""

LASER_SCENES = ("forest", "roofs", "mountain")
"""Scenes whose pulse is a laser's."""

Row = dict[str, Any]


class Numbers:
    """The report's rows by name.

    Parameters
    ----------
    content : mapping
        Of the report: ``ways``, ``sets`` and ``accuracy``.
    """

    def __init__(self, content: Row) -> None:
        self.ways: dict[str, Row] = {row["name"]: row for row in content["ways"]}
        self.sets: dict[str, Row] = {row["name"]: row for row in content["sets"]}
        self._accuracy: dict[tuple[str, str], Row] = {(row["way"], row["set"]): row for row in content["accuracy"]}

    def accuracy(self, way: str, name: str) -> Row:
        """A way on a set."""
        return self._accuracy[way, name]

    def peak(self, way: str, name: str, key: str = "rms") -> float:
        """Error of a way's peaks on a set; bins, or whatever `key` is in. Infinite where none was found."""
        value = self.accuracy(way, name)["peak"][key]
        return float("inf") if value is None else float(value)

    def group(self, *groups: str) -> list[str]:
        """Names of the ways of some groups."""
        return [name for name, row in self.ways.items() if row["group"] in groups]

    def apart(self, way: str) -> float | None:
        """Least separation, σ, from which on a way finds `FOUND` of two equal echoes; None if it never does."""
        grid = [
            (row["value"], self.accuracy(way, name)["detected"]) for name, row in self.sets.items() if _separates(row)
        ]
        least = None
        for value, detected in sorted(grid, reverse=True):
            if detected < FOUND:
                break
            least = value
        return least

    def enough(self, name: str) -> int:
        """Least FRAC whose peaks are as good as those of the greatest, to `ENOUGH`, on a set."""
        best = self.peak(f"core FRAC {FRACS[-1]}", name)
        return next(frac for frac in FRACS if self.peak(f"core FRAC {frac}", name) <= ENOUGH * best)


def _separates(row: Row) -> bool:
    return bool(row["kind"] == "grid" and row["grid"] == "separation")


def advice(content: Row) -> list[dict[str, str]]:
    """Which way to use for what.

    Parameters
    ----------
    content : mapping
        Of the report: ``ways``, ``sets`` and ``accuracy``.

    Returns
    -------
    list of dict
        ``need``, the name of a ``way``, and ``because``: its figures.
    """
    numbers = Numbers(content)
    return [
        {"need": need, **dict(zip(("way", "because"), found, strict=True))}
        for need, find in NEEDS
        if (found := find(numbers))
    ]


def _fastest(numbers: Numbers) -> tuple[str, str] | None:
    known = [name for name, row in numbers.ways.items() if row["waveforms_per_s"] is not None]
    best = max(known, key=lambda name: float(numbers.ways[name]["waveforms_per_s"]))
    if numbers.ways[best]["fmax_mhz"] is None:
        return None  # no core's clock is known
    row = numbers.ways[best]
    return best, f"{row['waveforms_per_s']:,.0f} waveforms of 1024 samples a second at {row['fmax_mhz']:.0f} MHz"


def _smallest(numbers: Numbers) -> tuple[str, str] | None:
    """The core of fewest LUTs whose word costs no precision."""
    frac = max(numbers.enough(name) for name in EXACTING)
    name = f"core FRAC {frac}"
    area = numbers.ways[name]["lut"]
    of = "" if area is None else f"{area} LUT; "
    best = numbers.peak(f"core FRAC {FRACS[-1]}", "snr 200")
    return name, f"{of}peaks at SNR 200 {numbers.peak(name, 'snr 200'):.4f} bin, of FRAC {FRACS[-1]} {best:.4f}"


def _sharpest(numbers: Numbers) -> tuple[str, str]:
    """The core that is nearest to the truth on land."""
    best = min(numbers.group(FIXED, FLOATING, TAPS), key=lambda name: numbers.peak(name, "land"))
    ours, usual = numbers.peak(best, "land"), numbers.peak(USUAL, "land")
    return best, f"peaks on land {ours:.2f} bin RMS, with the paper's taps {usual:.2f}"


def _overlapping(numbers: Numbers) -> tuple[str, str] | None:
    separated = {name: numbers.apart(name) for name in numbers.ways}
    known = {name: least for name, least in separated.items() if least is not None}
    if not known:
        return None
    # Of those that tell as much apart the one that is nearest to the truth.
    best = min(known, key=lambda name: (known[name], numbers.peak(name, "separation 2")))
    core = min((known[name] for name in numbers.group(FIXED, TAPS) if name in known), default=None)
    limit = "no core does so up to 6 σ" if core is None else f"the best core from {core:g} σ on"
    return best, f"finds {FOUND:.0%} of two equal echoes from {known[best]:g} σ on, {limit}"


def _asymmetric(numbers: Numbers) -> tuple[str, str]:
    best = min(numbers.ways, key=lambda name: numbers.peak(name, "roofs"))
    ours, gauss, core = (numbers.peak(name, "roofs") for name in (best, "Gaussian", USUAL))
    return best, f"peaks on roofs {ours:.3f} bin RMS, Gaussian {gauss:.3f}, core {core:.3f}"


def _weak(numbers: Numbers) -> tuple[str, str]:
    best = max(
        numbers.ways, key=lambda name: (numbers.accuracy(name, "snr 5")["detected"], -numbers.peak(name, "snr 5"))
    )
    ours, usual = (numbers.accuracy(name, "snr 5")["detected"] for name in (best, USUAL))
    return (
        best,
        f"finds {ours:.0%} of echoes 5 deviations of the noise high, the core with the paper's taps {usual:.0%}",
    )


def _bounded(numbers: Numbers) -> tuple[str, str]:
    best = min(numbers.group(FIT), key=lambda name: numbers.peak(name, "land", "bound"))
    multiple, rate = numbers.peak(best, "land", "bound"), numbers.ways[best]["software_per_s"]
    return best, f"{multiple:.2f} times the Cramér–Rao bound on land, {rate:,.0f} waveforms a second on one core"


NEEDS: Sequence[tuple[str, Callable[[Numbers], tuple[str, str] | None]]] = (
    ("most waveforms a second", _fastest),
    ("least area without loss of precision", _smallest),
    ("best peaks in hardware", _sharpest),
    ("weak echoes", _weak),
    ("echoes that overlap", _overlapping),
    ("an asymmetric pulse", _asymmetric),
    ("the last digit, and error bars", _bounded),
)
"""What somebody may need, and what finds the way for it."""


def claims(content: Row) -> list[str]:
    """Five sentences, each with its numbers.

    Parameters
    ----------
    content : mapping
        As of `advice`.
    """
    numbers = Numbers(content)
    return [_word_length(numbers), _floats(numbers), _taps(numbers), _fits(numbers), _limits(numbers)]


def _word_length(numbers: Numbers) -> str:
    enough = {name: numbers.enough(name) for name in EXACTING}
    coarse, fine = (numbers.peak(f"core FRAC {frac}", "snr 200") for frac in (FRACS[0], FRACS[-1]))
    return (
        f"Word length: {max(enough.values())} fractional bits are enough for every set, {enough['land']} on land: with "
        f"{FRACS[0]} the peak of an echo of SNR 200 is off by {coarse:.4f} bin RMS, with {FRACS[-1]} by {fine:.4f}."
    )


def _floats(numbers: Numbers) -> str:
    exact, usual = (numbers.peak(name, "snr 200") for name in ("core binary64", USUAL))
    half, brain = (numbers.peak(name, "land") for name in ("core binary16", "core bfloat16"))
    area, fixed = (numbers.ways[name]["lut"] for name in ("core binary64", USUAL))
    price = "" if area is None else f"takes {area / fixed:.1f} times the LUTs and "
    return (
        f"Floating point buys nothing: binary64 {price}has the peak at SNR 200 to {exact:.4f} bin, fixed point to "
        f"{usual:.4f}; and short formats lose bins far from the start ({half:.2f} bin on land with binary16, "
        f"{brain:.2f} with bfloat16, {numbers.peak(USUAL, 'land'):.2f} in fixed point)."
    )


def _taps(numbers: Numbers) -> str:
    best, _ = _sharpest(numbers)
    ours, usual = (numbers.peak(name, "land") for name in (best, USUAL))
    matched = min(numbers.peak(name, "snr 200", "bound") for name in numbers.group(TAPS))
    return (
        f"Taps matter more than bits: {best} has the peaks on land to {ours:.2f} bin, the paper's to {usual:.2f}; and "
        f"a filter as wide as the echo is {matched:.2f} times the Cramér–Rao bound (paper's "
        f"{numbers.peak(USUAL, 'snr 200', 'bound'):.2f}; the published centre "
        f"{numbers.accuracy(USUAL, 'snr 200')['centre']['bound']:.2f})."
    )


def _fits(numbers: Numbers) -> str:
    fast, slow = numbers.ways[USUAL]["waveforms_per_s"], numbers.ways["Gaussian"]["software_per_s"]
    beside = "" if fast is None else f" (the core {fast / slow:,.0f} times as many)"
    return (
        f"A fit is worth its time where echoes overlap or their shape is known: Gaussians are at "
        f"{numbers.peak('Gaussian', 'land', 'bound'):.2f} times the bound on land and V–L has roofs to "
        f"{numbers.peak('V–L', 'roofs'):.2f} bin where the core has {numbers.peak(USUAL, 'roofs'):.2f}, at "
        f"{slow:,.0f} land waveforms a second on one core of a processor{beside}."
    )


def _limits(numbers: Numbers) -> str:
    core, fit = (numbers.apart(name) for name in (USUAL, "Gaussian"))
    wrong = numbers.accuracy("laser template", "land")
    off, spurious = wrong["peak"]["rms"], wrong["spurious_per_waveform"]
    return (
        f"Limits: two equal echoes are found for sure by the core from {_told(core)} σ on, by the Gaussian fit from "
        f"{_told(fit)} σ on; the wrong shape is worse than none, a laser template being off by {off:.1f} bin on land "
        f"with {spurious:.1f} spurious echoes a waveform; and the core needs 50 samples before the first "
        f"echo{_without(numbers)}."
    )


def _without(numbers: Numbers) -> str:
    """What the core finds of recorded waveforms that begin with their first echo."""
    if ABRUPT not in numbers.sets:
        return ""
    core, fit = (numbers.accuracy(name, ABRUPT)["detected"] for name in (USUAL, "Gaussian"))
    return f" (of NEON's, which begin with it, it finds {core:.0%}, the Gaussian fit {fit:.0%})"


def _told(least: float | None) -> str:
    return "more than 6" if least is None else f"{least:g}"
