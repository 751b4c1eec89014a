"""PulseWaves files, written here to the specification 0.3 and read back sample for sample."""

from __future__ import annotations

import struct
import tempfile
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest
from numpy.typing import NDArray

from openecho import formats
from tests import fuzz

VARIABLE: dict[str, Any] = {"duration_bits": 32, "segment_bits": 8, "count_bits": 16}
FIXED: dict[str, Any] = {"duration_bits": 16, "segments": 2, "samples": 12}
OUTGOING: dict[str, Any] = {"kind": 1, "segments": 1, "samples": 5, "bits": 8}


def record(number: int, payload: bytes, appended: bool = False, user: bytes = b"PulseWaves_Spec") -> bytes:
    header = struct.pack("<16sIIq64s", user, number, 0, len(payload), b"")
    return payload + header if appended else header + payload


def sampling(
    kind: int = 2,
    duration_bits: int = 0,
    segment_bits: int = 0,
    count_bits: int = 0,
    segments: int = 0,
    samples: int = 0,
    bits: int = 16,
    units: float = 0.5,
    compression: int = 0,
) -> bytes:
    numbers = (104, 0, kind, 0, 0, duration_bits, 0.25, 100.0, segment_bits, count_bits, segments, samples, bits)
    return struct.pack("<IIBBBBffBBHIHHfI64s", *numbers, 0, units, compression, b"")


def descriptor(samplings: list[dict[str, Any]], extra: int = 3, compression: int = 0) -> bytes:
    composition = struct.pack("<IIiHHfII64s", 92, 0, 0, extra, len(samplings), 1.0, 0, compression, b"")
    return composition + b"".join(sampling(**one) for one in samplings)


def number(value: int, bits: int) -> bytes:
    """Field of the waves, which is not there if it has no bits."""
    return value.to_bytes(bits // 8, "little", signed=value < 0) if bits else b""


def pulsewaves(
    path: Path,
    samplings: list[dict[str, Any]],
    *,
    pulses: int = 4,
    appended: bool = False,
    pulse_size: int = 50,
    header: dict[str, Any] | None = None,
    segment_lengths: tuple[int, ...] = (7, 30),
    first_offset: int | None = None,
    indices: list[int] | None = None,
    **options: Any,
) -> tuple[list[NDArray[Any]], list[tuple[int, float]]]:
    """Write the two files; give the returning segments and, of each, its pulse and duration in sampling units."""
    rng = np.random.default_rng(0)
    waves = bytearray(struct.pack("<16sI40s", b"PulseWavesWaves", 0, b""))
    kept: list[NDArray[Any]] = []
    places: list[tuple[int, float]] = []
    records = bytearray()
    for pulse in range(pulses):
        offset = len(waves) if first_offset is None else first_offset
        index = 1 if indices is None else indices[pulse]
        t, anchor = 1000 + pulse, (100 * pulse, 7, 500000)
        numbers = (t, offset, *anchor, anchor[0] + 10, 7, 500000 - 150000, 0, 0, index, 0, 0, 0)
        records += struct.pack("<qq6i2h4B", *numbers).ljust(pulse_size, b"\xee")
        waves += b"\xaa" * options.get("extra", 3)
        for one in samplings:
            lengths = segment_lengths if one.get("count_bits") else (one["samples"],) * one["segments"]
            waves += number(len(lengths), one.get("segment_bits", 0))
            for position, length in enumerate(lengths):
                raw = 40 * position - 20 if one.get("duration_bits") else 0
                waves += number(raw, one.get("duration_bits", 0))
                waves += number(length, one.get("count_bits", 0))
                bits = one.get("bits", 16)
                samples = rng.integers(0, 2**bits, length).astype(f"<u{bits // 8}")
                waves += samples.tobytes()
                if one.get("kind", 2) == 2 and index:
                    kept.append(samples)
                    places.append((pulse, 0.25 * raw + 100 if one.get("duration_bits") else 0.0))
    payload = record(200_001, descriptor(samplings, **options), appended)
    vlrs = [record(100_001, b"scanner")] + ([] if appended else [payload])
    avlrs = record(0xFFFFFFFF, b"", True) + (payload if appended else b"")
    fields = {
        "header_size": 352,
        "offset": 352 + sum(map(len, vlrs)),
        "pulses": pulses,
        "format": 0,
        "attributes": 0,
        "pulse_size": pulse_size,
        "compression": 0,
        "reserved": 0,
        "vlrs": len(vlrs),
        "avlrs": -1 if appended else 1,
    }
    fields |= header or {}
    start = struct.pack("<16s152x2H2BHqqIIIIqIi", b"PulseWavesPulse", 1, 2012, 0, 3, *fields.values())
    start += struct.pack("<ddqq", 1e-6, 5.0, 0, 0) + struct.pack("<12d", *[0.01] * 3, 1000.0, 2000.0, 0.0, *[0.0] * 6)
    path.write_bytes(start + b"".join(vlrs) + records + avlrs)
    path.with_suffix(".wvs").write_bytes(waves)
    return kept, places


@pytest.mark.parametrize("appended", [False, True], ids=["before", "appended"])
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("form", [VARIABLE, FIXED, {"segments": 1, "samples": 9}], ids=["variable", "fixed", "plain"])
def test_every_returning_segment_reads_back(tmp_path: Path, form: dict[str, Any], bits: int, appended: bool) -> None:
    path = tmp_path / "a.pls"
    segments, places = pulsewaves(path, [OUTGOING, form | {"bits": bits}], appended=appended)
    with formats.open(path) as recording:
        described = recording.format, recording.waveforms, recording.longest, recording.bin_ns
    assert described == ("PulseWaves", len(segments), max(map(len, segments)), 0.5)
    blocks = fuzz.read_all(path)
    rows = [row[:n] for block in blocks for row, n in zip(block.samples, block.length, strict=True)]
    for row, segment in zip(rows, segments, strict=True):
        np.testing.assert_array_equal(row, segment)
    times = np.concatenate([block.time for block in blocks])
    np.testing.assert_allclose(times, [5 + 1e-6 * (1000 + pulse) for pulse, _ in places], rtol=1e-15)


def test_first_and_last_bin_lie_on_the_line_from_anchor_to_target(tmp_path: Path) -> None:
    segments, places = pulsewaves(tmp_path / "a.pls", [VARIABLE])
    with formats.open(tmp_path / "a.pls") as recording:
        where = recording.read(0, len(segments)).geolocation
    assert where is not None
    for row, (segment, (pulse, duration)) in enumerate(zip(segments, places, strict=True)):
        anchor = np.array([1000.0 + pulse, 2000.07, 5000.0])
        step = np.array([0.1, 0.0, -1500.0]) / 1000
        np.testing.assert_allclose(where.first[row], anchor + duration * step, rtol=1e-12)
        # Samples are half a sampling unit of the pulse apart.
        last = duration + 0.5 * (len(segment) - 1)
        np.testing.assert_allclose(where.last[row], anchor + last * step, rtol=1e-12)


def test_pulses_far_apart_are_read_in_chunks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("openecho.formats.pulsewaves.CHUNK", 100)
    segments, places = pulsewaves(tmp_path / "a.pls", [VARIABLE], pulses=9, indices=[1, 0, 0, 0, 1, 1, 0, 0, 1])
    with formats.open(tmp_path / "a.pls") as recording:
        block = recording.read(0, 99)
    assert len(segments) == len(block.length) == 8
    assert block.time is not None
    np.testing.assert_allclose(block.time, [5 + 1e-6 * (1000 + pulse) for pulse, _ in places], rtol=1e-15)


@pytest.mark.parametrize(
    ("samplings", "options", "message"),
    [
        ([VARIABLE], {"header": {"compression": 1}}, "pulse format 0 and compression 1, expected 0 and 0"),
        ([VARIABLE], {"header": {"format": 1}}, "pulse format 1 and compression 0, expected 0 and 0"),
        ([VARIABLE], {"header": {"pulse_size": 47}}, "pulses of 47 bytes, expected at least 48"),
        ([VARIABLE], {"header": {"pulses": 7}}, "7 pulses of 50 bytes at byte .*, expected at most 296 bytes"),
        ([VARIABLE], {"header": {"pulses": -1}}, "-1 pulses of 50 bytes"),
        ([VARIABLE], {"header": {"offset": 2**62}}, "pulses at byte 4611686018427387904, expected one after the other"),
        ([VARIABLE], {"header": {"vlrs": 2**32 - 1}}, "record 2 at byte .*, expected 4294967295 before the pulses"),
        ([VARIABLE], {"header": {"vlrs": 1}}, "pulse descriptor 1 is missing, expected a record 200001"),
        ([VARIABLE], {"pulses": 0}, "0 waveforms of 0 samples, expected at least one"),
        ([VARIABLE], {"compression": 1}, "pulse descriptor 1 has compression 1 and sample units 1.0 ns, expected 0"),
        ([VARIABLE | {"compression": 1}], {}, "descriptor 1 sampling 0 has compression 1, expected 0"),
        ([VARIABLE | {"kind": 3}], {}, "descriptor 1 sampling 0 has type 3, expected 1 or 2"),
        ([VARIABLE | {"bits": 24}], {}, None),
        ([FIXED, FIXED | {"units": 1.0}], {}, r"sample units of \[0.5, 1.0\] ns, expected one"),
        ([VARIABLE], {"segment_lengths": (7, 0)}, "0 samples in a segment of pulse 0 at byte .*, expected 1 to 65536"),
        ([VARIABLE], {"first_offset": 59}, "waves of pulse 0 at byte 59, expected 60 to"),
        ([VARIABLE], {"first_offset": 2**40}, "waves of pulse 0 at byte 1099511627776, expected 60 to"),
        ([VARIABLE], {"first_offset": 60, "pulses": 9, "extra": 0, "segment_lengths": (90,)}, None),
    ],
)
def test_bad_pulsewaves_is_told_in_one_line(
    tmp_path: Path, samplings: list[dict[str, Any]], options: dict[str, Any], message: str | None
) -> None:
    path = tmp_path / "a.pls"
    if samplings == [VARIABLE | {"bits": 24}]:
        pulsewaves(path, [VARIABLE])
        path.write_bytes(path.read_bytes().replace(sampling(**VARIABLE), sampling(**samplings[0])))
        message = "descriptor 1 sampling 0 has bits per sample 24, expected 8 or 16"
    else:
        pulsewaves(path, samplings, **options)
    if message is None:
        waves = path.with_suffix(".wvs")
        waves.write_bytes(waves.read_bytes()[:400])
        message = "segments add up to .* bytes or more, expected at most 400"
    with pytest.raises(formats.DataError, match=message) as error:
        fuzz.read_all(path)
    assert str(error.value).startswith(str(path.with_suffix("")))
    assert "\n" not in str(error.value)


def test_missing_short_compressed_or_foreign_waves_are_named(tmp_path: Path) -> None:
    path, waves = tmp_path / "a.pls", tmp_path / "a.wvs"
    pulsewaves(path, [VARIABLE])
    content = waves.read_bytes()
    for damaged, message in (
        (content[:-1], rf"a\.wvs: segment of pulse 3 ends at byte {len(content)}, expected at most {len(content) - 1}"),
        (
            content[:61],
            r"a\.wvs: waves of pulse 0 end past byte 61, the last",
        ),
        (content[:59], r"a\.wvs: starts with .*, expected .* in 60 bytes"),
        (content[:16] + b"\1" + content[17:], r"a\.wvs: starts with .*, expected .* not compressed"),
        (b"x" * 99, r"a\.wvs: starts with b'xxx.*, expected b'PulseWavesWaves"),
    ):
        waves.write_bytes(damaged)
        with pytest.raises(formats.DataError, match=message):
            formats.open(path)
    waves.unlink()
    with pytest.raises(formats.DataError, match=r"a\.wvs: no such file, expected the waves of a\.pls"):
        formats.open(path)


def test_the_waves_alone_are_answered_with_what_to_open(tmp_path: Path) -> None:
    pulsewaves(tmp_path / "a.pls", [VARIABLE])
    with pytest.raises(formats.DataError, match=r"a\.wvs: the waves of a PulseWaves file, expected its \.pls"):
        formats.open(tmp_path / "a.wvs")


def content_of(samplings: list[dict[str, Any]], **options: Any) -> tuple[bytes, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.pls"
        pulsewaves(path, samplings, **options)
        return path.read_bytes(), path.with_suffix(".wvs").read_bytes()


PULSES, WAVES = content_of([OUTGOING, VARIABLE])
APPENDED, FIXED_WAVES = content_of([FIXED], appended=True)


@fuzz.fuzzed
@hypothesis.given(fuzz.damage(PULSES), fuzz.damage(WAVES))
def test_damaged_variable_segments_give_data_or_one_line(tmp_path: Path, pulses: bytes, waves: bytes) -> None:
    (tmp_path / "a.pls").write_bytes(pulses)
    (tmp_path / "a.wvs").write_bytes(waves)
    fuzz.give_data_or_one_line(tmp_path / "a.pls")


@fuzz.fuzzed
@hypothesis.given(fuzz.damage(APPENDED))
def test_damaged_appended_records_give_data_or_one_line(tmp_path: Path, pulses: bytes) -> None:
    (tmp_path / "a.pls").write_bytes(pulses)
    (tmp_path / "a.wvs").write_bytes(FIXED_WAVES)
    fuzz.give_data_or_one_line(tmp_path / "a.pls")
