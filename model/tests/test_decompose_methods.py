"""Methods by name through the one call: what their tables say, and that anything else is told in one line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

import openecho
from openecho.decompose import FITTED, METHODS, Decomposition, dtype
from openecho.decompose.decomposition import NOT_CONVERGED
from openecho.decompose.find import find_echoes
from openecho.decompose.fit import GREATEST, echo_sum, fit_echoes
from openecho.decompose.pulses import gaussian, laser, measured, rough
from openecho.enhance import noise
from openecho.golden import TRUNCATED

FloatArray = NDArray[np.float64]

LENGTH = 200
X = np.arange(LENGTH)
WAVEFORMS = 200
PULSES = {"gaussian": gaussian(), "laser": laser(), "vl": laser()}
TRUTH = np.array([[300.0, 60.0, 5.0], [120.0, 78.0, 5.0], [200.0, 140.0, 7.0]])

fits = pytest.mark.parametrize("method", FITTED)


def echoes(method: str, components: FloatArray = TRUTH, deviation: float = 1.0, seed: int = 0) -> FloatArray:
    """Waveforms of the same echoes on a baseline of 20, with white noise."""
    amplitude, centre, width = components.T
    (clean,) = echo_sum(LENGTH, [20.0], np.zeros(len(components), int), amplitude, centre, width, PULSES[method])
    return np.asarray(clean + np.random.default_rng(seed).normal(0, deviation, (WAVEFORMS, LENGTH)))


def decompose(samples: Any, method: str, **settings: Any) -> Decomposition:
    return openecho.decompose(samples, method=method, **settings)


@fits
def test_the_table_has_the_columns_of_a_fit_in_the_order_of_waveforms_and_bins(method: str) -> None:
    samples = echoes(method)
    found = decompose(samples, method)
    assert found.echoes.dtype == dtype(("fit",))
    assert found.echoes.dtype.names == (
        *("waveform", "number", "centre", "peak", "time", "width", "fwhm", "amplitude"),
        *("centre_error", "width_error", "amplitude_error", "flags"),
    )
    np.testing.assert_array_equal(found.waveforms["length"], LENGTH)
    np.testing.assert_array_equal(found.waveforms["echoes"], np.bincount(found.echoes["waveform"], minlength=WAVEFORMS))
    np.testing.assert_array_equal(found.echoes["waveform"], np.repeat(np.arange(WAVEFORMS), found.waveforms["echoes"]))
    for waveform in range(WAVEFORMS):
        mine = found.alone(waveform).echoes
        np.testing.assert_array_equal(mine["number"], np.arange(len(mine)))
        assert (np.diff(mine["peak"]) > 0).all()


@fits
def test_values_are_the_truth_within_errors_that_are_true(method: str) -> None:
    found = decompose(echoes(method), method, noise=1.0)
    # An echo too many is there once in 200 waveforms, at most.
    right = found.waveforms["echoes"] == len(TRUTH)
    assert right.mean() >= 0.995
    table = found.echoes[right[found.echoes["waveform"]]].reshape(-1, len(TRUTH))
    for name, truth in zip(("amplitude", "peak", "width"), TRUTH.T, strict=True):
        error = table["centre_error" if name == "peak" else f"{name}_error"]
        # The deviation of a mean square over n values is sqrt(2 / n): five of these.
        ratio = (((table[name] - truth) / error) ** 2).mean(axis=0)
        np.testing.assert_allclose(ratio, 1, atol=5 * np.sqrt(2 / right.sum()), err_msg=name)


@fits
def test_the_table_is_what_the_search_and_the_fit_return(method: str) -> None:
    samples = echoes(method, TRUTH[[2, 0]])[:20]
    found = decompose(samples, method, noise=1.0, start="none", width=6.0, most=2)
    length, deviation = np.full(20, LENGTH), np.ones(20)
    count, start, baseline = find_echoes(
        samples, length, deviation, pulse=PULSES[method], width=6.0, most=2, start="none"
    )
    fit = fit_echoes(samples, length, count, start, pulse=PULSES[method], noise=deviation, baseline=baseline)
    order = np.lexsort((fit.centre, np.repeat(np.arange(20), count)))
    for name, values in {
        "peak": fit.centre,
        "width": fit.width,
        "amplitude": fit.amplitude,
        "centre_error": fit.centre_error,
        "width_error": fit.width_error,
        "amplitude_error": fit.amplitude_error,
    }.items():
        # That of vl starts from another baseline: a fit ends where a step gains less than 1e-9 of the sum of squares.
        np.testing.assert_allclose(found.echoes[name], values[order], rtol=1e-6 * (method == "vl"), err_msg=name)
    np.testing.assert_allclose(found.waveforms["noise_mean"], fit.baseline, rtol=1e-6 * (method == "vl"))
    np.testing.assert_array_equal(found.waveforms["flags"] & NOT_CONVERGED == 0, fit.converged)


@pytest.mark.parametrize(
    ("method", "settings", "pulse"),
    [
        ("gaussian", {}, gaussian()),
        ("laser", {}, laser()),
        ("laser", {"rough": True, "width": 4.0}, rough(4.0)),
        ("vl", {"rough": True, "width": 4.0}, rough(4.0)),
        ("laser", {"transmitted": (0, 1, 0, 5, 40, 90, 100, 80, 50, 30, 15, 8, 4, 2, 1, 0, 1, 0, 0, 0)}, None),
    ],
    ids=["gaussian", "laser", "rough", "rough vl", "transmitted"],
)
def test_derived_columns_are_as_defined(method: str, settings: dict[str, Any], pulse: Any) -> None:
    found = decompose(echoes(method)[:20], method, bin_ns=0.5, **settings)
    shape = measured(settings["transmitted"]) if pulse is None else pulse
    table = found.echoes
    midpoint, fwhm = shape.described(table["width"])
    np.testing.assert_array_equal(table["centre"], table["peak"] + midpoint)
    np.testing.assert_array_equal(table["fwhm"], fwhm)
    np.testing.assert_allclose(table["time"], table["centre"] - fwhm / 4, rtol=1e-14)
    for name in ("centre", "peak", "time"):
        np.testing.assert_array_equal(table[f"{name}_ns"], table[name] * 0.5)
    assert (table["width"] >= shape.narrowest * (1 - 1e-15)).all()


@fits
def test_what_was_fitted_leaves_the_noise(method: str) -> None:
    samples = echoes(method, deviation=2.0)
    left = samples - decompose(samples, method).fitted(LENGTH)
    # Ten parameters take 5 % of its variance, and its deviation over n values is 1 / sqrt(2 n) of itself.
    np.testing.assert_allclose(left.std(), 2 * np.sqrt(1 - 10 / LENGTH), rtol=5 / np.sqrt(2 * left.size))
    exact = echoes(method, deviation=0.0)[:1]
    np.testing.assert_allclose(decompose(exact, method, width=5.0).fitted(LENGTH), exact, atol=1e-6)


@fits
def test_echoes_of_one_waveform_alone_are_its_own(method: str) -> None:
    samples = echoes(method)[:5]
    found = decompose(samples, method)
    for waveform in range(5):
        np.testing.assert_allclose(found.alone(waveform).fitted(LENGTH)[0], found.fitted(LENGTH)[waveform], rtol=1e-14)
    first = found.alone(3, 0)
    assert len(first.echoes) == 1
    assert first.pulse is not None
    assert first.echoes["peak"] == found.alone(3).echoes["peak"][0]


@fits
def test_noise_is_measured_in_each_waveform_or_as_given(method: str) -> None:
    samples = echoes(method, deviation=3.0)
    measured_noise = decompose(samples, method)
    np.testing.assert_array_equal(measured_noise.waveforms["noise_deviation"], noise(samples, lags=0).sigma)
    # Of 200 samples about 100 are noise: 1 / sqrt(200) of it, and in the mean 1 / sqrt(200) of that.
    np.testing.assert_allclose(measured_noise.waveforms["noise_deviation"].mean(), 3, rtol=0.03)
    tables = {}
    for deviation in (3.0, 4.5):
        given = decompose(samples[:20], method, noise=deviation, most=1)
        np.testing.assert_array_equal(given.waveforms["noise_deviation"], deviation)
        tables[deviation] = given.echoes
    for name in ("amplitude_error", "centre_error", "width_error"):
        np.testing.assert_allclose(tables[4.5][name], 1.5 * tables[3.0][name], rtol=1e-12, err_msg=name)


def test_counts_have_at_least_the_noise_of_their_rounding() -> None:
    exact = echoes("gaussian", deviation=0.0)[:1]
    assert decompose(np.rint(exact), "gaussian").waveforms["noise_deviation"][0] >= 12**-0.5
    assert decompose(exact, "gaussian").waveforms["noise_deviation"][0] < 1e-6


def test_correlation_of_the_noise_changes_what_is_found_and_the_errors() -> None:
    white = np.random.default_rng(3).normal(0, 1, (WAVEFORMS, LENGTH + 2))
    samples = echoes("gaussian", deviation=0.0) + (white[:, 2:] + white[:, 1:-1] + white[:, :-2]) / np.sqrt(3)
    right = {}
    for name, correlation in {"white": (1.0,), "known": (1.0, 2 / 3, 1 / 3)}.items():
        found = decompose(samples, "gaussian", noise=1.0, correlation=correlation, most=3)
        table = found.echoes[(found.waveforms["echoes"] == 3)[found.echoes["waveform"]]].reshape(-1, 3)
        right[name] = (((table["amplitude"] - TRUTH[:, 0]) / table["amplitude_error"]) ** 2).mean(axis=0)
    # A moving average of three is no autoregression of order two, but nearly; taken for white it has thrice the power.
    np.testing.assert_allclose(right["known"], 1, atol=0.1 + 5 * np.sqrt(2 / WAVEFORMS))
    assert (right["white"] > 2).all()


def test_misfit_leaves_out_echoes_that_only_mend_the_shape() -> None:
    samples = echoes("gaussian", np.array([[1000.0, 80.0, 5.0], [15.0, 95.0, 6.0]]))
    assert (decompose(samples, "gaussian").waveforms["echoes"] == 2).mean() >= 0.995
    np.testing.assert_array_equal(decompose(samples, "gaussian", misfit=0.01).waveforms["echoes"], 1)


@fits
def test_clipped_samples_have_no_say_from_saturation_on(method: str) -> None:
    samples = np.minimum(echoes(method, np.array([[400.0, 80.0, 6.0]])), 220.0)
    found = decompose(samples, method, saturation=220.0, width=6.0)
    right = found.waveforms["echoes"] == 1
    assert right.mean() >= 0.995
    # Noise decides what is clipped, so that the others are a little too low.
    amplitude = found.echoes["amplitude"][right[found.echoes["waveform"]]]
    np.testing.assert_allclose(amplitude.mean(), 400, rtol=0.005)


@fits
def test_an_echo_with_its_maximum_outside_the_record_is_truncated(method: str) -> None:
    components = np.array([[300.0, -2.5, 5.0], [200.0, 80.0, 5.0], [300.0, LENGTH + 1.5, 5.0]])
    found = decompose(echoes(method, components)[:20], method)
    for waveform in range(20):
        mine = found.alone(waveform).echoes
        outside = (mine["peak"] < 0) | (mine["peak"] > LENGTH - 1)
        np.testing.assert_array_equal(mine["flags"], np.where(outside, TRUNCATED, 0))
        assert outside[0]
        assert outside[-1]
        assert not outside[np.abs(mine["peak"] - 80).argmin()]


def test_a_fit_that_could_go_on_is_told() -> None:
    decay = 20 + 200 * np.exp(-X[:120] / 30)  # is no sum of a few Gaussians
    assert decompose(decay, "gaussian", noise=0.001).waveforms["flags"].tolist() == [NOT_CONVERGED]
    assert decompose(echoes("gaussian")[:1], "gaussian").waveforms["flags"].tolist() == [0]
    assert decompose(echoes("gaussian", deviation=0.0)[:1], "gaussian").waveforms["flags"].tolist() == [0]


@fits
def test_samples_past_the_length_have_no_say(method: str) -> None:
    samples = echoes(method)[:4]
    length = np.array([50, 100, 150, 200])
    together = decompose(samples, method, length=length)
    for row, one in enumerate(length):
        alone, mine = decompose(samples[row, :one], method), together.alone(row)
        assert len(alone.echoes) == len(mine.echoes)
        # A fit ends where a step gains less than 1e-9 of the sum of squares, which is this part of an error.
        for name in ("peak", "width", "amplitude"):
            error = mine.echoes["centre_error" if name == "peak" else f"{name}_error"]
            assert (np.abs(alone.echoes[name] - mine.echoes[name]) <= 1e-2 * error).all()
        np.testing.assert_array_equal(mine.waveforms["length"], one)


def test_first_guesses_of_vl_are_those_behind_vondraks_filter() -> None:
    samples = echoes("laser", deviation=8.0)
    laser_found, vl_found = decompose(samples, "laser"), decompose(samples, "vl")
    assert laser_found.pulse == vl_found.pulse or laser_found.pulse is vl_found.pulse
    # What is found at last is the same in nearly all waveforms: both go on until no echo pays.
    assert (laser_found.waveforms["echoes"] == vl_found.waveforms["echoes"]).mean() > 0.95
    parabola = decompose(samples, "vl", epsilon=0.0)  # shows no echo, so they come one by one
    one_by_one = decompose(samples, "laser", start="none")
    np.testing.assert_array_equal(parabola.waveforms["echoes"], one_by_one.waveforms["echoes"])


GOOD = np.tile(20 + 100 * np.exp(-((X[:60] - 30) ** 2) / 50), (2, 1))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"method": "peeling"}, "method: found 'peeling', expected one of inflection, gaussian, laser, vl"),
        ({"sigma": 3.0}, "method gaussian: .*unexpected keyword argument 'sigma'"),
        ({"shape": "laser"}, "method gaussian: .*multiple values for keyword argument 'shape'"),
        ({"method": "inflection", "width": 3.0}, "method inflection: .*unexpected keyword argument 'width'"),
        ({"widths": "equal"}, "widths: found 'equal', expected one of free, shared, fixed"),
        ({"criterion": "best"}, "criterion: found 'best', expected one of ebic, bic, aic"),
        ({"start": "guess"}, "start: found 'guess', expected one of inflection, maxima, none"),
        ({"noise": -1.0}, "noise: found -1.0, expected a number from 0"),
        ({"noise": np.nan}, "noise: found nan, expected a number from 0"),
        ({"noise": "loud"}, "method gaussian: "),
        ({"misfit": -0.1}, "misfit: found -0.1, expected a number from 0"),
        ({"saturation": np.inf}, "saturation: found inf, expected a number from 0"),
        ({"width": 0.0}, "width: found 0.0, expected"),
        ({"width": np.nan}, "width: found nan, expected"),
        ({"least": -1.0}, "width, least, most: found 5.0, -1.0, 16"),
        ({"most": -1}, "most: found -1, expected 0 to 64"),
        ({"most": 65}, "most: found 65, expected 0 to 64"),
        ({"most": "all"}, "most: found all, expected 0 to 64"),
        ({"correlation": (0.5,)}, "correlation: found one that is not 1 at lag 0"),
        ({"correlation": (1.0, 1.5)}, "correlation: found one that is not 1 at lag 0"),
        ({"correlation": ()}, r"correlation: found shape \(0,\)"),
        ({"epsilon": 1.0}, "epsilon: found 1.0, expected it with method vl alone"),
        ({"method": "laser", "epsilon": 1.0}, "epsilon: found 1.0, expected it with method vl alone"),
        ({"method": "vl", "epsilon": -1.0}, "epsilon: found -1.0, expected a number from 0"),
        ({"rough": True}, "rough, transmitted: found one with a Gaussian"),
        ({"transmitted": (0, 0, 1, 3, 4, 3, 1, 0, 0)}, "rough, transmitted: found one with a Gaussian"),
        ({"method": "laser", "transmitted": (0, 1, 0)}, r"pulse: found shape \(3,\)"),
        ({"method": "laser", "transmitted": (1,) * 9}, "pulse: found a value that is not finite or the same"),
        ({"method": "laser", "rough": True, "width": -1.0}, "width: found -1.0, expected"),
        ({"bin_ns": 0.0}, "bin_ns: found 0.0, expected a positive number"),
        ({"samples": np.zeros((1, 2, 3))}, r"samples: found shape \(1, 2, 3\)"),
        ({"samples": np.zeros((2, 0))}, r"samples: found shape \(2, 0\)"),
        ({"samples": [[1.0, np.nan, 2.0]]}, "samples: found a value that is not finite"),
        ({"samples": [[1.0, np.inf, 2.0]]}, "samples: found a value that is not finite"),
        ({"samples": [[1.0, np.nan, 2.0]], "noise": 1.0}, "samples: found a value that is not finite"),
        ({"length": [60]}, r"length: found shape \(1,\), expected \(2,\)"),
        ({"length": [60, 61]}, "length: found one outside 0 to 60"),
        ({"length": [60, -1]}, "length: found"),
        ({"length": [60, 0]}, r"length: found \[0\], expected 1 to 60"),
    ],
    ids=str,
)
def test_bad_input_is_told_in_one_line(settings: dict[str, Any], message: str) -> None:
    good: dict[str, Any] = {"samples": GOOD, "method": "gaussian"}
    with pytest.raises(ValueError, match=f"^{message}") as caught:
        openecho.decompose(**good | settings)
    assert "\n" not in str(caught.value)


def run(code: str, folder: Path) -> str:
    """What a fresh interpreter, away from the checkout, prints."""
    return subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True).stdout


@fits
def test_a_missing_compiler_is_told_in_one_line(method: str, tmp_path: Path) -> None:
    code = f"""
import sys
sys.modules["numba"] = None
import openecho
print(len(openecho.decompose([[20] * 99] * 3).waveforms))
try:
    openecho.decompose([[20] * 99], method={method!r})
except ModuleNotFoundError as error:
    print(error)
"""
    assert run(code, tmp_path) == "3\nnumba is not installed, expected it: pip install 'openecho[fit]'\n"


def test_the_cores_own_method_loads_no_compiler(tmp_path: Path) -> None:
    code = "import sys, openecho\nopenecho.decompose([[20] * 99])\nprint('numba' in sys.modules)"
    assert run(code, tmp_path) == "False\n"
    assert run(code.replace("99]", "99], method='gaussian'"), tmp_path) == "True\n"


sizes = st.tuples(st.integers(1, 3), st.integers(0, 60))
numbers = (
    arrays(np.float64, sizes, elements=st.floats(allow_nan=False, allow_infinity=False))
    | arrays(np.float64, sizes, elements=st.floats(-1e-300, 1e-300))
    | arrays(np.float64, sizes, elements=st.just(7.5) | st.just(1e300))
    | arrays(np.uint16, sizes, elements=st.integers(0, 3) | st.just(1023))
    | st.sampled_from([np.int8, np.uint16, np.int64, np.uint64]).flatmap(lambda kind: arrays(kind, sizes))
    | sizes.map(lambda size: np.full(size, 1023))
)


@pytest.mark.filterwarnings("error")
@settings(max_examples=200, deadline=None)
@given(samples=numbers, method=st.sampled_from(METHODS), data=st.data())
def test_any_finite_array_has_an_answer_or_one_line(samples: NDArray[Any], method: str, data: st.DataObject) -> None:
    options: dict[str, Any] = {}
    if method != "inflection":
        options["noise"] = data.draw(st.none() | st.floats(0, 1e6))
        options["saturation"] = data.draw(st.none() | st.just(1023.0))
        options["misfit"] = data.draw(st.just(0.0) | st.floats(0, 1))
        options["most"] = 4
    try:
        with np.errstate(all="raise", under="ignore"):
            found = openecho.decompose(samples, method=method, bin_ns=0.5, **options)
    except ValueError as caught:
        (line,) = str(caught).splitlines()
        assert ": found " in line
        # A fit takes any samples up to its limit, if there are some.
        assert method == "inflection" or samples.size == 0 or np.abs(samples.astype(float)).max() > GREATEST
        return
    assert len(found.waveforms) == len(samples)
    assert found.waveforms["echoes"].sum() == len(found.echoes)
    for table in (found.echoes, found.waveforms):
        for name in table.dtype.names or ():
            known = ~np.isnan(table[name]) if name.endswith("_error") else np.isfinite(table[name])
            assert known.all(), name
    assert (found.echoes["amplitude"] >= 0).all()
    assert (found.echoes["width"] > 0).all()
    assert np.isfinite(found.fitted(samples.shape[1])).all()
