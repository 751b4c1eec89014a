"""Relative heights of waveforms with known energy, and of GEDI's beside its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from openecho import decompose
from openecho.study.score import METRES_PER_NS
from openecho.surface.heights import relative_heights

X = np.arange(400)


def echo(at: float, width: float, height: float) -> np.ndarray:
    return np.asarray(height * np.exp(-0.5 * ((X - at) / width) ** 2))


def heights(curve: np.ndarray, **options: float) -> np.void:
    (found,) = relative_heights(curve[None], [len(curve)], [1.0], 0.15, **options)
    one: np.void = found
    return one


def test_ground_is_the_last_mode_and_half_of_the_energy_is_where_it_is() -> None:
    found = heights(echo(120, 5, 100) + echo(250.3, 5, 100), smoothing=1.0)
    assert found["ground"] == pytest.approx(250.3, abs=0.01)
    # Two returns of the same energy: the lower half is the ground's, so RH25 is at the ground and RH75 at the crown.
    assert found["rh"][25] == pytest.approx(0, abs=0.08)
    assert found["rh"][75] == pytest.approx(130.3 * 0.15, abs=0.08)
    assert (np.diff(found["rh"]) >= 0).all()
    assert found["rh"][100] == pytest.approx((found["ground"] - found["top"]) * 0.15)
    assert found["rh"][0] <= 0


def test_a_waveform_without_a_return_has_no_heights() -> None:
    found = heights(np.zeros(400))
    assert np.isnan(found["ground"])
    assert np.isnan(found["rh"]).all()


def test_samples_past_the_length_have_no_say() -> None:
    curve = echo(120, 5, 100) + echo(250, 5, 100)
    (found,) = relative_heights(curve[None], [200], [1.0], 0.15)
    assert found["ground"] == pytest.approx(120, abs=0.01)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ([[1.0]], [1, 2], [1.0], 0.15),
            r"^curves, length, deviation: found shapes \(1, 1\), \(2,\), \(1,\), expected",
        ),
        (([[1.0]], [1], [1.0], 0.0), r"^bin_m: found 0.0, expected a number above 0$"),
        (([[1.0]], [1], [1.0], float("nan")), r"^bin_m: found nan, expected a number above 0$"),
    ],
)
def test_bad_input_is_one_line(arguments: tuple, message: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(ValueError, match=message):
        relative_heights(*arguments)


def test_gedis_ground_and_heights_are_those_of_our_decomposition(recorded: Path) -> None:
    with np.load(recorded / "gedi_cerrado.npz") as file:
        samples, length, quality = file["samples"], file["length"], file["quality"] > 0
        ground, rh, noise = file["ref_ground_bin"], file["ref_rh"], file["noise_std"]
    found = decompose(samples, length, method="gaussian", width=6.0, misfit=0.01)
    curves = found.fitted(samples.shape[1]) - found.waveforms["noise_mean"][:, None]
    ours = relative_heights(curves, length, noise, METRES_PER_NS)[quality]
    print(
        f"ground within 2 bins {(abs(ours['ground'] - ground[quality]) <= 2).mean():.4f}, within 0.5 m: "
        f"RH50 {(abs(ours['rh'] - rh[quality]) <= 0.5)[:, 50].mean():.4f}, "
        f"RH98 {(abs(ours['rh'] - rh[quality]) <= 0.5)[:, 98].mean():.4f}"
    )
    assert (abs(ours["ground"] - ground[quality]) <= 2).mean() >= 0.95
    assert (abs(ours["rh"] - rh[quality]) <= 0.5)[:, 98].mean() >= 0.90
    assert (abs(ours["rh"] - rh[quality]) <= 0.5)[:, 50].mean() >= 0.90
