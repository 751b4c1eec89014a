"""Compression of whole files: the same bytes however it went, and nothing half-written."""

from __future__ import annotations

import resource
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from openecho import batch, codec, formats, stimulus
from openecho.batch import Compression
from openecho.formats import compressed
from tests.test_cli import PROGRAM, Run, refused, run  # noqa: F401, the fixture
from tests.test_formats_hdf5 import lvis

SMALL = 5000
"""Samples of a chunk here, so that a small file has several."""


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compressed, "CHUNK", SMALL)


@pytest.fixture
def source(tmp_path: Path) -> Path:
    made = stimulus.reference_set()
    path = tmp_path / "waveforms.npz"
    np.savez(path, samples=made.samples, length=made.length, bin_ns=1.0)
    return path


def interrupt(at: int) -> Callable[[str, int, int | None], None]:
    """Progress that ends in an interruption after some waveforms."""

    def advance(doing: str, done: int, _: int | None) -> None:
        if doing == "compressing" and done >= at:
            raise KeyboardInterrupt

    return advance


@pytest.mark.parametrize("mode", [codec.PREDICTION, codec.THRESHOLD])
def test_an_interruption_changes_no_byte(mode: int, source: Path) -> None:
    whole, made = source.with_name("whole.oec"), source.with_name("made.oec")
    result = batch.compress_file(Compression(source, whole, mode))
    assert (result.waveforms, result.samples, result.resumed) == (40, 31040, 0)
    assert result.size == whole.stat().st_size
    for at in (9, 21):
        with pytest.raises(KeyboardInterrupt):
            batch.compress_file(Compression(source, made, mode), interrupt(at))
        assert not made.exists()
    again = batch.compress_file(Compression(source, made, mode, verify=True))
    assert again.resumed >= 21
    assert made.read_bytes() == whole.read_bytes()
    assert sorted(path.name for path in source.parent.iterdir()) == ["made.oec", "waveforms.npz", "whole.oec"]


def test_chunks_of_another_mode_are_not_taken(source: Path) -> None:
    made = source.with_name("made.oec")
    with pytest.raises(KeyboardInterrupt):
        batch.compress_file(Compression(source, made, codec.PREDICTION), interrupt(9))
    with pytest.raises(batch.StoreError, match="found blocks of a job with mode 1, expected 0"):
        batch.compress_file(Compression(source, made, codec.THRESHOLD))


def test_a_result_that_differs_is_not_kept(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pack = compressed.pack_chunk

    def wrong(block: formats.Block, bits: int, mode: int) -> bytes:
        block.samples[0, 0] ^= 1
        return pack(block, bits, mode)

    monkeypatch.setattr(compressed, "pack_chunk", wrong)
    made = source.with_name("made.oec")
    with pytest.raises(formats.DataError, match=r"waveforms 0 to \d+ differ from .+, expected the same"):
        batch.compress_file(Compression(source, made, codec.PREDICTION, verify=True))
    assert not made.exists()


def test_the_command_there_and_back(run: Run, source: Path) -> None:  # noqa: F811
    status, out, err = run("compress", source, "--verify")
    made = source.with_suffix(".oec")
    assert (status, err) == (0, "")
    sizes = f"{made.stat().st_size} bytes of {source.stat().st_size}"
    for part in (str(made), "40 waveforms", "31040 samples of 9 bits", "ratio 2.", sizes, "verified"):
        assert part in out
    back = source.with_name("back.npz")
    assert run("decompress", made, "-o", back) == (0, f"{back}: 40 waveforms\n", "")
    with np.load(source) as before, np.load(back) as after:
        assert set(after) == {"samples", "length", "bin_ns"}
        for name in after:
            np.testing.assert_array_equal(after[name], before[name])
    assert run("info", made)[1].splitlines()[2:] == run("info", back)[1].splitlines()[2:]


def test_every_command_reads_what_was_compressed(run: Run, source: Path) -> None:  # noqa: F811
    run("compress", source)
    tables = {}
    for name in ("waveforms.npz", "waveforms.oec"):
        echoes = source.with_name("echoes.csv")
        assert run("decompose", source.with_name(name), "-o", echoes)[0] == 0
        tables[name] = echoes.read_bytes()
    assert tables["waveforms.npz"] == tables["waveforms.oec"]


def test_several_files_into_a_folder(run: Run, source: Path) -> None:  # noqa: F811
    other = source.with_name("other.npz")
    other.write_bytes(source.read_bytes())
    folder = source.with_name("folder")
    folder.mkdir()
    status, out, _ = run("compress", source, other, "-o", folder, "--mode", "threshold")
    assert (status, out.count("\n")) == (0, 2)
    assert sorted(path.name for path in folder.iterdir()) == ["other.oec", "waveforms.oec"]


def test_no_result_takes_the_place_of_another_or_of_a_source(run: Run, source: Path) -> None:  # noqa: F811
    folder = source.with_name("folder")
    folder.mkdir()
    other = folder / source.name
    other.write_bytes(source.read_bytes())
    refused(run("compress", source, other, "-o", folder), "waveforms.oec: found it as the result of ", str(other))
    refused(run("compress", source, source), "found it as the result of ")
    assert run("compress", other)[0] == 0
    again = run("compress", source, other.with_suffix(".oec"), "-o", folder)
    refused(again, "found the same file for input and output")
    assert sorted(path.name for path in folder.iterdir()) == ["waveforms.npz", "waveforms.oec"]


def test_a_full_disk_is_told_in_one_line_and_leaves_no_half(source: Path) -> None:
    def no_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))

    whole = source.with_suffix(".oec")
    batch.compress_file(Compression(source, whole, codec.PREDICTION))
    rows = source.with_suffix(".npy")
    with np.load(source) as arrays:
        np.save(rows, arrays["samples"])
    for verb, path, name in (("compress", rows, "made.oec"), ("decompress", whole, "b.npz")):
        command: list[str | Path] = [PROGRAM, verb, path, "-o", source.with_name(name)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=no_room)
        refused((done.returncode, done.stdout, done.stderr), f"{source.with_name(name)}.partial", "File too large")
        assert not source.with_name(name).exists()
    assert not source.with_name("b.npz.partial").exists()


def test_what_an_npz_has_no_place_for_is_told(run: Run, tmp_path: Path) -> None:  # noqa: F811
    lvis(tmp_path / "a.h5", 432, 431)
    assert run("compress", tmp_path / "a.h5")[0] == 0
    status, out, _ = run("decompress", tmp_path / "a.oec")
    assert status == 0
    assert "positions in longitude" in out
    assert "shot numbers left out" in out


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["compress"], ["Missing argument 'FILE...'"]),
        (["compress", "{source}", "--bits", "8"], ["samples of waveform ", "expected 0 to 255"]),
        (["compress", "{source}", "--bits", "0"], ["--bits", "1<=x<=16"]),
        (["compress", "{source}", "--bits", "17"], ["--bits", "1<=x<=16"]),
        (["compress", "{source}", "--mode", "x"], ["--mode", "prediction", "threshold"]),
        (["compress", "{source}", "-o", "{folder}/a.npz"], ["a.npz: found the suffix .npz, expected .oec"]),
        (["compress", "{source}", "{source}", "-o", "{folder}/a.oec"], ["expected one for several files"]),
        (["compress", "{source}", "-o", "{folder}/no/a.oec"], ["no/a.oec: no folder"]),
        (["compress", "{folder}/missing.h5"], ["missing.h5: no such file"]),
        (["decompress", "{source}"], ["found the same file for input and output"]),
        (["decompress", "{source}", "-o", "{folder}/a.h5"], ["found the suffix .h5, expected .npz"]),
        (["decompress", "{folder}/missing.oec"], ["missing.oec: no such file"]),
    ],
)
def test_what_cannot_be_used_is_told_in_one_line(
    run: Run,  # noqa: F811
    source: Path,
    arguments: list[str],
    parts: list[str],
) -> None:
    filled = [argument.format(source=source, folder=source.parent) for argument in arguments]
    refused(run(*filled), *parts)
    assert sorted(path.name for path in source.parent.iterdir()) == ["waveforms.npz"]


def test_a_damaged_file_leaves_no_result(run: Run, source: Path) -> None:  # noqa: F811
    run("compress", source)
    made = source.with_suffix(".oec")
    content = bytearray(made.read_bytes())
    content[len(content) // 2] ^= 1
    made.write_bytes(content)
    refused(run("decompress", made, "-o", source.with_name("back.npz")), "waveforms.oec: byte ", "CRC")
    assert sorted(path.name for path in source.parent.iterdir()) == ["waveforms.npz", "waveforms.oec"]
