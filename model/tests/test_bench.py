"""The benchmark's bound, what it counts as found, and its report, with others in the places of those it compares."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray

from openecho import report
from openecho.study import bench

FloatArray = NDArray[np.float64]

PAIR = bench.pair("separation", 4, 4)
SINGLE = bench.single("snr", 200)
SEED = [3, 1]


def nothing(samples: FloatArray, told: float, number: int) -> bench.Found:
    return bench.Found(np.zeros(len(samples), np.int64), np.empty((0, 3)))


def highest(samples: FloatArray, told: float, number: int) -> bench.Found:
    place = samples.argmax(axis=1)
    height = samples.max(axis=1) - bench.BASELINE
    return bench.Found(np.ones(len(samples), np.int64), np.column_stack([height, place, np.full(len(samples), told)]))


def echoes(*centres: float) -> FloatArray:
    return np.array([[200.0, centre, 5.0] for centre in centres]).reshape(-1, 3)


def found(*waveforms: FloatArray) -> bench.Found:
    return bench.Found(np.array([len(each) for each in waveforms]), np.concatenate(waveforms))


@pytest.mark.parametrize("sigma", [2.0, 5.0, 12.0])
def test_bound_of_one_echo_is_the_closed_form(sigma: float) -> None:
    amplitude, noise, length = 50.0, 0.7, 4000
    bound = bench.cramer_rao([amplitude], [length / 2 + 0.3], [sigma], noise, length)[0]
    # The centre's slope is odd, so that no other parameter costs it anything.
    assert bound[1] == pytest.approx(noise * math.sqrt(2 * sigma / math.sqrt(math.pi)) / amplitude, rel=1e-9)
    # Amplitude and σ share a matrix [[1, A/2σ], [A/2σ, 3A²/4σ²]] σ √π; the baseline of a long record costs them little.
    share = math.sqrt(1.5 / (sigma * math.sqrt(math.pi)))
    assert bound[0] == pytest.approx(noise * share, rel=0.02)
    assert bound[2] == pytest.approx(noise * share * math.sqrt(4 / 3) * sigma / amplitude, rel=0.02)


@pytest.mark.parametrize("apart", [1.0, 2.5, 4.0])
def test_bound_of_two_echoes_is_that_of_a_numerical_jacobian(apart: float) -> None:
    parameters = np.array([20.0, 200, 120.3, 5, 80, 120.3 + 5 * apart, 6])
    x, steps = np.arange(256.0), 1e-4 * np.eye(7)
    jacobian = [
        (bench.gaussians(x, *(parameters + step)) - bench.gaussians(x, *(parameters - step))) / 2e-4 for step in steps
    ]
    covariance = np.linalg.inv(np.array(jacobian) @ np.array(jacobian).T) * 1.5**2
    amplitudes, centres, sigmas = parameters[1:].reshape(2, 3).T
    bound = bench.cramer_rao(amplitudes, centres, sigmas, 1.5, 256)
    np.testing.assert_allclose(bound.ravel(), np.sqrt(np.diag(covariance))[1:], rtol=1e-5)


def test_a_neighbour_costs_precision_and_twice_the_noise_doubles_the_bound() -> None:
    alone = bench.cramer_rao([200], [128], [5], 1, 256)[0]
    beside = bench.cramer_rao([200, 200], [128, 138], [5, 5], 1, 256)[0]
    assert (beside > alone).all()
    np.testing.assert_allclose(bench.cramer_rao([200], [128], [5], 2, 256)[0], 2 * alone)


def test_waveforms_have_their_echoes_where_they_say() -> None:
    samples, centres = bench.waveforms(PAIR, 400, SEED)
    assert samples.shape == (400, PAIR.length) == (400, bench.LENGTH)
    np.testing.assert_allclose(np.diff(centres), 20)
    assert np.ptp(centres[:, 0]) > 0.9
    x = np.arange(PAIR.length)
    rest = samples - bench.BASELINE
    for centre in centres.T:
        rest -= 200 * np.exp(-0.5 * ((x - centre[:, None]) / 5) ** 2)
    assert rest.mean() == pytest.approx(0, abs=5 / math.sqrt(rest.size))
    assert rest.std() == pytest.approx(bench.NOISE, abs=5 / math.sqrt(2 * rest.size))


@pytest.mark.parametrize("point", bench.POINTS, ids=lambda p: f"{p.grid}-{p.value:g}")
def test_every_record_is_long_enough_for_its_echoes(point: bench.Point) -> None:
    reach = bench.REACH * point.sigma
    assert point.centres.min() - reach >= 0
    assert point.centres.max() + reach <= point.length
    assert point.length >= bench.LENGTH


@pytest.mark.parametrize(
    ("made", "share", "fewer", "more"),
    [
        (echoes(118, 138), 1, 0, 0),
        (echoes(138, 118), 1, 0, 0),  # in any order
        (echoes(122.9, 133.1), 1, 0, 0),  # within σ
        (echoes(118, 143.1), 0, 0, 0),  # one is farther away
        (echoes(117, 119), 0, 0, 0),  # two at the same echo
        (echoes(118), 0, 1, 0),
        (echoes(), 0, 1, 0),
        (echoes(118, 138, 200), 0, 0, 1),
    ],
)
def test_echoes_are_found_that_are_as_many_and_each_near_its_own(
    made: FloatArray, share: float, fewer: float, more: float
) -> None:
    scored = bench.score(PAIR, found(made), np.array([[118.0, 138.0]]))
    assert (scored["found"], scored["fewer"], scored["more"]) == (share, fewer, more)
    assert (scored["centre"] is None) == (share == 0)


def test_echoes_that_are_closer_must_be_found_within_half_their_separation() -> None:
    close = bench.pair("separation", 1, 1)
    truth = np.array([[125.5, 130.5]] * 2)
    assert bench.score(close, found(echoes(123.1, 130.5), echoes(122.9, 130.5)), truth)["found"] == 0.5


def test_errors_are_multiples_of_each_echos_own_bound_where_all_were_found() -> None:
    point = bench.pair("ratio", 20, 4, ratio=20)
    truth = np.tile(point.centres, (3, 1))
    _, centre, sigma = point.bound.T
    made = np.column_stack([point.amplitudes, point.centres + np.array([3, -4]) * centre, 5 + 0.5 * sigma])
    scored = bench.score(point, found(made, echoes(118, 138, 200), echoes(50, 60)), truth)
    assert scored["found"] == pytest.approx(1 / 3)
    assert scored["centre"] == pytest.approx(math.sqrt((9 + 16) / 2))
    assert scored["sigma"] == pytest.approx(0.5)


def test_curve_fit_finds_what_has_maxima_and_with_the_number_given_also_what_has_one() -> None:
    for apart, share in ((4, 1), (1.75, 0)):
        point = bench.pair("separation", apart, apart)
        samples, centres = bench.waveforms(point, 40, SEED)
        scored = bench.score(point, bench.scipy_curve_fit(samples, 5, 2), centres)
        given = bench.score(point, bench.scipy_number_given(samples, 5, 2), centres)
        assert scored["found"] == pytest.approx(share, abs=0.05)
        assert given["found"] == 1
        assert 0.5 < given["centre"] < 1.5
        assert 0.5 < given["sigma"] < 1.5


def test_smoothed_noise_and_what_it_adds_to_a_width_are_those_of_the_gaussian() -> None:
    noise, variance = bench.smoothing(3.0)
    assert noise == pytest.approx(bench.NOISE / math.sqrt(2 * 3 * math.sqrt(math.pi)), rel=1e-3)
    assert variance == pytest.approx(9, rel=0.01)


def test_report_has_every_method_at_every_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    methods = {"openecho": highest, "gdecomp": nothing}
    monkeypatch.setattr(bench, "METHODS", methods)
    monkeypatch.setattr(bench, "missing", list)
    monkeypatch.setattr(report, "tools", lambda *names: dict.fromkeys(names, "0"))
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    monkeypatch.setattr("sys.argv", ["bench", "--quick", "--seed", "7"])
    for name, value in bench.SINGLE_THREAD.items():
        monkeypatch.setenv(name, value)
    bench.main()
    content = json.loads((tmp_path / "bench.json").read_text())
    assert (content["seed"], content["waveforms"]) == (7, bench.QUICK_COUNT)
    assert [(row["grid"], row["value"]) for row in content["rows"]] == [(p.grid, p.value) for p in bench.POINTS]
    for row, point in zip(content["rows"], bench.POINTS, strict=True):
        assert list(row["methods"]) == list(methods)
        assert len(row["bound_centre"]) == len(point.offsets)
        one = len(point.offsets) == 1
        assert row["methods"]["gdecomp"] == {"found": 0, "fewer": 1, "more": 0, "centre": None, "sigma": None}
        assert row["methods"]["openecho"]["fewer"] == (0 if one else 1)
    assert [row["data"] for row in content["speed"]] == list(bench.SPEED)
    for row in content["speed"]:
        assert row["methods"]["openecho"]["times_as_fast"] == 1
        assert row["methods"]["gdecomp"]["waveforms_per_s"] > 0
    assert {path.name for path in tmp_path.iterdir()} == {"bench.json", "bench_detection.png", "bench_error.png"}


def test_pictures_show_what_was_scored() -> None:
    methods = {"openecho": highest, "gdecomp": nothing}
    rows = bench.study(methods, 10, 0)
    detection, error = bench.draw_detection(rows), bench.draw_error(rows, 10)
    shares = [row["methods"]["openecho"]["found"] for row in rows if row["grid"] == "separation"]
    np.testing.assert_array_equal(detection.axes[0].lines[0].get_ydata(), shares)
    for axes, key in zip(error.axes, ("centre", "sigma"), strict=True):
        lines = {line.get_label(): np.asarray(line.get_ydata(), np.float64) for line in axes.lines}
        np.testing.assert_array_equal(
            lines["openecho"],
            np.array([row["methods"]["openecho"][key] for row in rows if row["grid"] == "snr"], np.float64),
        )
        assert np.isnan(lines["gdecomp"]).all()
    FigureCanvasAgg(error).draw()  # type: ignore[no-untyped-call]
    legend = error.legends[0].get_window_extent()
    assert 0 <= legend.x0 < legend.x1 <= error.bbox.width


def test_what_is_not_installed_is_said_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    monkeypatch.setattr("sys.argv", ["bench"])
    with pytest.raises(SystemExit) as ended:
        bench.main()
    assert ended.value.code == 2
    said = "error: gdecomp, numba not installed, expected it: pip install 'openecho[bench]'\n"
    assert capsys.readouterr() == ("", said)
