"""The command: what it prints, its exit status, and one line for whatever can't be used."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from openecho import cli, stimulus
from openecho.study.scale import granule
from tests.test_formats_hdf5 import gedi

PROGRAM = Path(sys.executable).with_name("openecho")

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Exit status, standard output and standard error of the command with some arguments."""

    def command(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["openecho", *map(str, arguments)])
        status = 0
        before = signal.getsignal(signal.SIGTERM)
        try:
            cli.main()
        except SystemExit as end:
            status = int(end.code or 0)
        finally:
            signal.signal(signal.SIGTERM, before)
        out, err = capsys.readouterr()
        return status, out, err

    return command


@pytest.fixture
def source(tmp_path: Path) -> Path:
    made = stimulus.reference_set()
    path = tmp_path / "waveforms.npz"
    np.savez(path, samples=made.samples, length=made.length, bin_ns=1.0)
    return path


def refused(result: tuple[int, str, str], *parts: str) -> None:
    """One line on standard error, status 2, nothing else."""
    status, out, err = result
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert all(part in err for part in parts), err


def test_decompose_says_what_it_wrote(run: Run, source: Path) -> None:
    output = source.with_name("echoes.csv")
    status, out, _err = run("decompose", source, "-o", output)
    assert (status, out) == (0, f"{output}: 120 echoes of 40 waveforms\n")
    assert len(output.read_text().splitlines()) == 121


def test_decompose_says_which_waveforms_were_special(run: Run, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", samples=np.full((3, 60), 20), length=np.array([60, 49, 10]))
    status, out, _ = run("decompose", tmp_path / "a.npz", "-o", tmp_path / "a.csv")
    assert status == 0
    assert out.splitlines() == [
        "1 waveforms too short for the filter",
        "2 waveforms too short for noise",
        f"{tmp_path}/a.csv: 0 echoes of 3 waveforms",
    ]


def test_every_engine_and_option_reaches_the_core(run: Run, source: Path) -> None:
    chosen = ["--taps", "gedi", "--arith", "float64", "--n", "4", "--k", "6.5", "--min-interval", "9", "--bin-ns", "3"]
    status, _, err = run("decompose", source, "-o", source.with_name("e.npz"), *chosen, "--min-amplitude", "50")
    assert (status, err) == (0, err)
    from openecho.decompose import decompose

    made = stimulus.reference_set()
    expected = decompose(
        made.samples,
        made.length,
        taps="gedi",
        arithmetic="float64",
        n=4,
        k=6.5,
        min_interval=9,
        min_amplitude=50,
        bin_ns=3.0,
    ).echoes
    with np.load(source.with_name("e.npz")) as found:
        for name in expected.dtype.names or ():
            np.testing.assert_array_equal(found[name], expected[name], err_msg=name)


@pytest.mark.parametrize("method", ["gaussian", "laser", "vl"])
def test_a_method_that_fits_writes_what_the_function_returns(method: str, run: Run, source: Path) -> None:
    output = source.with_name("e.npz")
    chosen = ["--method", method, "--width", "8", "--most", "4", "--misfit", "0.02", "--noise", "1.5"]
    status, out, _ = run("decompose", source, "-o", output, *chosen, "--correlation", "1,0.25")
    assert (status, out.splitlines()[-1][: len(str(output))]) == (0, str(output))
    from openecho.decompose import decompose

    made = stimulus.reference_set()
    expected = decompose(
        made.samples,
        made.length,
        method=method,
        bin_ns=1.0,
        width=8.0,
        most=4,
        misfit=0.02,
        noise=1.5,
        correlation=(1, 0.25),
    ).echoes
    with np.load(output) as found:
        assert {"centre_error", "width_error", "amplitude_error"} < set(found)
        assert "corrected_width" not in found
        for name in expected.dtype.names or ():
            np.testing.assert_array_equal(found[name], expected[name], err_msg=name)


def test_a_recorded_pulse_is_the_template(run: Run, tmp_path: Path) -> None:
    x = np.arange(300.0)
    pulse = 300 * np.exp(-((x[:60] - 20) ** 2) / 18) + 150 * np.exp(-((x[:60] - 26) ** 2) / 50)
    echo = 80 + sum(0.5 * np.interp(x - shift, x[:60], pulse, right=0.0) for shift in (60, 180))
    np.save(tmp_path / "tx.npy", np.stack([pulse, pulse]))
    np.savez(tmp_path / "a.npz", samples=np.rint(echo)[None].astype(np.uint16), length=np.array([300]))
    chosen = ["--method", "laser", "--pulse", tmp_path / "tx.npy", "--misfit", "0.01"]
    status, out, err = run("decompose", tmp_path / "a.npz", "-o", tmp_path / "e.npz", *chosen)
    assert (status, out, err) == (0, f"{tmp_path}/e.npz: 2 echoes of 1 waveforms\n", "")
    with np.load(tmp_path / "e.npz") as found:
        np.testing.assert_allclose(np.diff(found["peak"]), 120, atol=0.01)


@pytest.mark.parametrize("method", ["gaussian", "laser", "vl"])
def test_plot_draws_what_was_fitted(method: str, run: Run, source: Path) -> None:
    output = source.with_name("waveform.svg")
    status, out, _ = run("plot", source, "--waveform", "3", "--method", method, "--width", "8", "-o", output)
    assert (status, out.split(":")[0]) == (0, str(output))
    assert "<svg" in output.read_text()


def test_score_puts_methods_beside_one_another(run: Run, source: Path) -> None:
    output = source.with_name("score.json")
    chosen = ["--method", "inflection", "--method", "gaussian", "--taps", "gedi", "--width", "8"]
    status, out, _ = run("score", source, *chosen, "-o", output)
    assert status == 0
    written = json.loads(output.read_text())
    assert list(written["methods"]) == ["gedi", "gaussian"]
    rmse = {name: result["rmse"]["50"] for name, result in written["methods"].items()}
    assert rmse["gaussian"] < rmse["gedi"]
    assert f"{rmse['gaussian']:.2f}" in out


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["decompose", "{source}"], ["Missing option '-o'"]),
        (["decompose", "{source}", "-o", "{folder}/e.txt"], ["e.txt: found suffix '.txt', expected one of .csv"]),
        (["decompose", "{source}", "-o", "{folder}/no/e.csv"], ["no folder", "expected one"]),
        (["decompose", "{source}", "-o", "{folder}/e.las"], ["tells no positions"]),
        (["decompose", "{source}", "-o", "{folder}/e.csv", "--taps", "none"], ["'none' is not one of 'paper'"]),
        (
            ["decompose", "{source}", "-o", "{folder}/e.csv", "--k", "16"],
            ["k: found 16.0, expected a multiple of 1/16"],
        ),
        (
            ["decompose", "{source}", "-o", "{folder}/e.csv", "--sample-w", "8"],
            ["samples of waveform 0 sample ", ", expected 0 to 255"],
        ),
        (["decompose", "{source}", "-o", "{folder}/e.csv", "--jobs", "0"], ["--jobs", "x>=1"]),
        (
            ["decompose", "{source}", "-o", "{folder}/e.csv", "--method", "gaussian", "--taps", "gedi"],
            ["found taps gedi, expected only options of method gaussian"],
        ),
        (
            ["decompose", "{source}", "-o", "{folder}/e.csv", "--misfit", "0.1"],
            ["found misfit 0.1, expected only options of method inflection"],
        ),
        (
            ["decompose", "{source}", "-o", "{folder}/e.csv", "--method", "laser", "--epsilon", "1"],
            ["epsilon: found 1.0, expected it with method vl alone"],
        ),
        (
            ["plot", "{source}", "--waveform", "1", "--method", "vl", "--correlation", "1,x"],
            ["--correlation", "found '1,x', expected numbers with commas between them"],
        ),
        (
            ["plot", "{source}", "--waveform", "1", "--method", "vl", "--correlation", "1,2"],
            ["correlation: found one that is not 1 at lag 0 and -1 to 1 elsewhere"],
        ),
        (
            ["score", "{source}", "--method", "laser", "--pulse", "{source}"],
            ["--pulse", "found no array of one or two dimensions"],
        ),
        (["decompose", "{source}", "-o", "{folder}/e.csv", "--bin-ns", "0"], ["--bin-ns", "x>0"]),
        (
            ["decompose", "{source}", "-o", "{folder}/e.csv", "--jobs", "2", "--scheduler", "x"],
            ["expected one of them"],
        ),
        (["decompose", "{source}", "-o", "{folder}/e.csv", "--scheduler", "nonsense://x"], ["nonsense://x: "]),
        (["decompose", "{folder}/missing.h5", "-o", "{folder}/e.csv"], ["missing.h5: no such file, expected"]),
        (["decompose", "{folder}", "-o", "{folder}/e.csv"], ["not a file, expected"]),
        (["info", "{folder}/missing.h5"], ["missing.h5: no such file, expected"]),
        (["info"], ["Missing argument 'FILE'"]),
        (["plot", "{source}", "--waveform", "40", "-o", "{folder}/p.png"], ["--waveform 40: expected 0 to 39"]),
        (["plot", "{source}", "--waveform", "-1", "-o", "{folder}/p.png"], ["--waveform", "x>=0"]),
        (["plot", "{source}", "--waveform", "0", "-o", "{folder}/p.txt"], ["p.txt", "txt", "png"]),
        (["plot", "{source}", "--waveform", "0", "-o", "{folder}/no/p.png"], ["no/p.png: no folder"]),
        (["plot", "{source}", "--waveform", "0", "--sample-w", "8", "-o", "{folder}/p.png"], ["expected 0 to 255"]),
        (["plot", "{source}", "--waveform", "0"], ["found no display for a window, expected one, or -o FILE.png"]),
        (["score", "{folder}/missing.h5"], ["missing.h5: no such file, expected"]),
        (["score", "{source}", "--reference", "{source}"], ["expected GEDI L1B"]),
        (["score", "{source}", "-o", "{folder}/no/s.json"], ["no/s.json: no folder"]),
        (["nonsense"], ["No such command 'nonsense'"]),
        (["decompose", "--nonsense"], ["No such option '--nonsense'"]),
    ],
)
def test_what_cannot_be_used_is_told_in_one_line(
    run: Run, source: Path, arguments: list[str], parts: list[str]
) -> None:
    filled = [argument.format(source=source, folder=source.parent) for argument in arguments]
    refused(run(*filled), *parts)
    assert sorted(path.name for path in source.parent.iterdir()) == ["waveforms.npz"]


def test_a_granule_cut_short_is_told_in_one_line(run: Run, tmp_path: Path) -> None:
    gedi(tmp_path / "a.h5", {"BEAM0000": [900] * 50})
    whole = (tmp_path / "a.h5").read_bytes()
    (tmp_path / "a.h5").write_bytes(whole[: len(whole) // 2])
    refused(run("decompose", tmp_path / "a.h5", "-o", tmp_path / "e.csv"), "a.h5: ", "expected")


def test_bundled_scenes_are_listed_with_what_they_show(run: Run) -> None:
    status, out, err = run("scene", "list")
    assert (status, err) == (0, "")
    names = [line.split()[0] for line in out.splitlines()]
    assert names == ["forest", "ice", "mountain", "roofs", "savanna", "sea", "slope", "terraces", "woodland"]
    assert all(len(line.split()) > 3 for line in out.splitlines())


def test_the_schema_of_a_scene_is_printed_to_be_read_and_to_be_parsed(run: Run) -> None:
    status, out, err = run("scene", "schema")
    assert (status, err) == (0, "")
    assert "  altitude: (length above 0 m) height over z = 0\n" in out
    status, out, _ = run("scene", "schema", "--json")
    assert status == 0
    assert {"platform", "laser", "receiver", "digitiser", "targets"} <= set(json.loads(out)["properties"])


def test_without_arguments_the_commands_are_listed(run: Run) -> None:
    status, out, _err = run("--help")
    assert status == 0
    assert all(name in out for name in ("decompose", "info", "plot", "score"))
    assert run()[0] == 2


def test_score_prints_every_tap_set_and_writes_what_it_prints(run: Run, source: Path) -> None:
    output = source.with_name("score.json")
    status, out, _ = run("score", source, "--taps", "gedi", "--taps", "paper", "-o", output)
    assert status == 0
    written = json.loads(output.read_text())
    assert list(written["methods"]) == ["gedi", "paper"]
    assert written["methods"]["paper"]["echoes"] == 120
    assert f"{written['methods']['gedi']['residual']['mean']:.2f}" in out


def test_a_full_disk_is_told_in_one_line_and_leaves_no_result(tmp_path: Path) -> None:
    granule(tmp_path / "granule.h5", 3000, 0)

    def no_room() -> None:
        # What is written past 400 kB of a file fails, as past the end of a disk: blocks are less, tables are more.
        resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))

    for name in ("echoes.csv", "echoes.parquet", "echoes.npz", "echoes.las"):
        command: list[str | Path] = [PROGRAM, "decompose", tmp_path / "granule.h5", "-o", tmp_path / name]
        done = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=no_room)
        refused((done.returncode, done.stdout, done.stderr), f"{tmp_path / name}.partial/table", "File too large")
        assert not (tmp_path / name).exists()
        assert not list(tmp_path.glob(f"{name}.partial/table*"))


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("jobs", [1, 2])
def test_whatever_ends_a_run_the_next_goes_on(tmp_path: Path, sent: signal.Signals, jobs: int) -> None:
    source, output, partial = tmp_path / "granule.h5", tmp_path / "echoes.csv", tmp_path / "echoes.csv.partial"
    granule(source, 24_000, 0)
    command: list[str | Path] = [PROGRAM, "decompose", source, "-o", output, "--jobs", str(jobs)]

    def heed() -> None:
        # What a shell starts in the background, these tests among it, ignores interrupts.
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=heed
    ) as process:
        while not list(partial.glob("[0-9]*.npz")):
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(sent)
        out, err = process.communicate(timeout=60)
    if sent != signal.SIGKILL:
        assert (process.returncode, out) == (130, "")
        assert err.split("\n") == ["the same command goes on where this one was", "", "interrupted", ""]
    assert not output.exists()
    finished = len(list(partial.glob("[0-9]*.npz")))
    done = subprocess.run([*command, "--jobs", "1"], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[0] == f"{finished * 1024} waveforms were decomposed by an earlier run"
    assert not partial.exists()
    subprocess.run([PROGRAM, "decompose", source, "-o", tmp_path / "whole.csv"], check=True, capture_output=True)
    assert output.read_bytes() == (tmp_path / "whole.csv").read_bytes()
