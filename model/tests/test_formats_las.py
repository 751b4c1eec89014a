"""LAS files with waveform packets, written here with laspy to the specification and read back sample for sample."""

from __future__ import annotations

import io
import struct
import tempfile
from pathlib import Path
from typing import Any

import hypothesis
import laspy
import numpy as np
import pytest
from laspy.vlrs.known import WaveformPacketStruct, WaveformPacketVlr
from numpy.typing import NDArray

from openecho import formats
from tests import fuzz

RETURNS = [1, 3, 1, 2]
"""Returns of each pulse, which share its packet."""

LENGTHS = [20, 30]
"""Samples of the two descriptors, which the pulses take in turn."""


def evlr(packets: bytes, user: bytes = b"LASF_Spec", record: int = 65535, length: int | None = None) -> bytes:
    return struct.pack("<H16sHQ32s", 0, user, record, len(packets) if length is None else length, b"") + packets


def las(
    path: Path,
    *,
    version: str = "1.4",
    point_format: int = 10,
    bits: int = 16,
    external: bool = False,
    lengths: list[int] = LENGTHS,
    returns: list[int] = RETURNS,
    descriptor: dict[str, Any] | None = None,
    points: dict[str, Any] | None = None,
    record: dict[str, Any] | None = None,
) -> tuple[list[NDArray[Any]], laspy.LasData]:
    """Write a LAS file; `descriptor`, `points` and `record` replace fields of each."""
    rng = np.random.default_rng(0)
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = np.full(3, 0.001), np.array([500000.0, 4000000.0, 0.0])
    for number, length in enumerate(lengths):
        vlr = WaveformPacketVlr(100 + number)
        fields = {"bits_per_sample": bits, "number_of_samples": length, "temporal_sample_spacing": 500}
        fields |= {"digitizer_gain": 0.25, "digitizer_offset": -1.0} | (descriptor or {})
        vlr.parsed_record = WaveformPacketStruct(**fields)
        header.vlrs.append(vlr)
    waves = [rng.integers(0, 2**bits, lengths[i % len(lengths)]).astype(f"<u{bits // 8}") for i in range(len(returns))]
    pulse = np.repeat(np.arange(len(returns)), returns)
    offsets = 60 + np.cumsum([0, *(wave.nbytes for wave in waves)])
    data = laspy.LasData(header)
    n = len(pulse)
    data.x, data.y, data.z = 500000 + rng.uniform(0, 9, n), 4000000 + rng.uniform(0, 9, n), rng.uniform(0, 99, n)
    data.gps_time = 1000.0 + pulse
    values = {
        "wavepacket_index": 1 + pulse % len(lengths),
        "wavepacket_offset": offsets[pulse],
        "wavepacket_size": np.array([wave.nbytes for wave in waves])[pulse],
        "return_point_wave_location": rng.uniform(0, 9000, n),
        "x_t": np.full(n, 1e-5),
        "y_t": np.full(n, -2e-5),
        "z_t": np.full(n, 1.5e-4),
    }
    for name, value in (values | (points or {})).items():
        data[name] = value
    packets = evlr(b"".join(wave.tobytes() for wave in waves), **(record or {}))
    header = data.header
    header.global_encoding.waveform_data_packets_internal = not external
    header.global_encoding.waveform_data_packets_external = external
    data.write(path)
    content = bytearray(path.read_bytes())
    if external:
        path.with_suffix(".wdp").write_bytes(packets)
    else:
        content[227:235] = struct.pack("<Q", len(content))
        content += packets
    path.write_bytes(content)
    return waves, laspy.read(io.BytesIO(bytes(content)))


@pytest.mark.parametrize("external", [False, True], ids=["inside", "wdp"])
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize(("version", "point_format"), [("1.3", 4), ("1.3", 5), ("1.4", 4), ("1.4", 9), ("1.4", 10)])
def test_every_point_format_reads_back_each_packet_once(
    tmp_path: Path, version: str, point_format: int, bits: int, external: bool
) -> None:
    path = tmp_path / "a.las"
    waves, _ = las(path, version=version, point_format=point_format, bits=bits, external=external)
    with formats.open(path) as recording:
        described = recording.format, recording.waveforms, recording.longest, recording.bin_ns, recording.volts
    assert described == ("LAS waveform packets", 4, 30, 0.5, (0.25, -1.0))
    blocks = fuzz.read_all(path)
    rows = [row[:n] for block in blocks for row, n in zip(block.samples, block.length, strict=True)]
    assert len(rows) == len(waves)
    for row, wave in zip(rows, waves, strict=True):
        np.testing.assert_array_equal(row, wave)
    np.testing.assert_array_equal(np.concatenate([block.time for block in blocks]), 1000.0 + np.arange(4))


def test_first_and_last_bin_lie_on_the_line_through_the_return(tmp_path: Path) -> None:
    _, data = las(tmp_path / "a.las")
    with formats.open(tmp_path / "a.las") as recording:
        where = recording.read(0, 4).geolocation
    assert where is not None
    for row, point in enumerate(np.cumsum([0, *RETURNS])[:4].tolist()):
        xyz = np.array([data.x[point], data.y[point], data.z[point]])
        back = np.array([data.x_t[point], data.y_t[point], data.z_t[point]], float)
        location = float(data.return_point_wave_location[point])
        np.testing.assert_allclose(where.first[row], xyz + location * back, rtol=1e-12)
        last = (LENGTHS[row % 2] - 1) * 500
        np.testing.assert_allclose(where.last[row], xyz + (location - last) * back, rtol=1e-12)
        assert where.first[row, 2] > where.last[row, 2]


def test_returns_of_a_packet_that_are_far_apart_still_share_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("openecho.formats.las.CHUNK", 1)
    offsets = 60 + 2 * np.array([20, 0, 20, 0, 40, 20, 0])
    waves, _ = las(tmp_path / "a.las", lengths=[20], points={"wavepacket_offset": offsets})
    with formats.open(tmp_path / "a.las") as recording:
        assert recording.waveforms == 3
        np.testing.assert_array_equal(recording.read(0, 3).samples, np.stack([waves[1], waves[0], waves[2]]))


def test_points_without_a_waveform_are_passed_over(tmp_path: Path) -> None:
    las(tmp_path / "a.las", points={"wavepacket_index": [1, 0, 2, 0, 0, 2, 2]})
    with formats.open(tmp_path / "a.las") as recording:
        np.testing.assert_array_equal(recording.read(0, 9).time, [1000, 1001, 1003])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"version": "1.2", "point_format": 1}, None),
        ({"point_format": 6}, None),
        ({"descriptor": {"bits_per_sample": 12}}, "descriptor 100 has 12 bits per sample, expected 8 or 16"),
        ({"descriptor": {"waveform_compression_type": 1}}, "descriptor 100 has compression 1, expected 0, none"),
        ({"descriptor": {"number_of_samples": 0}}, "descriptor 100 has 0 samples, expected 1 to 65536"),
        ({"descriptor": {"number_of_samples": 65537}}, "descriptor 100 has 65537 samples, expected 1 to 65536"),
        ({"descriptor": {"temporal_sample_spacing": 0}}, r"temporal spacings of \[0\] ps, expected one .* above 0"),
        ({"points": {"wavepacket_index": np.zeros(7)}}, "0 waveforms of 0 samples, expected at least one"),
        (
            {"points": {"wavepacket_index": np.full(7, 3)}},
            "descriptor index of point 0 is 3, expected .*1, 2",
        ),
        ({"points": {"wavepacket_size": np.full(7, 40)}}, "packet size of point 1 is 40, expected .*, 60 bytes"),
        ({"points": {"wavepacket_offset": np.full(7, 59)}}, "packet offset of point 0 is 59, expected 60 to 260"),
        ({"points": {"wavepacket_offset": np.full(7, 240)}}, "point 0 is 240, expected packets that end at byte 260"),
        ({"points": {"wavepacket_offset": np.full(7, 2**64 - 1, "u8")}}, "is 18446744073709551615, expected 60 to"),
        ({"points": {"wavepacket_offset": np.arange(60, 67)}}, "packets add up to .* bytes, expected at most 200"),
        ({"record": {"record": 1}}, "record 1 of b'LASF_Spec.*, expected 65535 of LASF_Spec"),
        ({"record": {"length": 2**63}}, "9223372036854775808 bytes of waveform packets .*expected at most 200"),
    ],
)
def test_bad_las_is_told_in_one_line(tmp_path: Path, changed: dict[str, Any], message: str | None) -> None:
    path = tmp_path / "a.las"
    if message is None:
        laspy.LasData(laspy.LasHeader(**changed)).write(path)
        message = "LAS version 1.2, expected 1.3 or 1.4" if "version" in changed else "point format 6, expected 4, 5, 9"
    else:
        las(path, **changed)
    with pytest.raises(formats.DataError, match=message) as error:
        fuzz.read_all(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_a_missing_or_short_wdp_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.las"
    las(path, external=True)
    packets = path.with_suffix(".wdp")
    packets.write_bytes(packets.read_bytes()[:-1])
    with pytest.raises(formats.DataError, match=r"a\.wdp: 200 bytes of waveform packets .*, expected at most 199"):
        formats.open(path)
    packets.unlink()
    with pytest.raises(formats.DataError, match=r"a\.wdp: no such file, expected the waveform packets of a\.las"):
        formats.open(path)


def test_a_file_that_shrinks_while_open_is_told_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.las"
    las(path, external=True, lengths=[20000])
    with formats.open(path) as recording:
        path.with_suffix(".wdp").write_bytes(b"")
        with pytest.raises(formats.DataError, match=r"a\.wdp: file ends at byte .*, expected whole waveform packets"):
            recording.read(0, 4)


def content_of(**options: Any) -> tuple[bytes, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.las"
        las(path, **options)
        packets = path.with_suffix(".wdp")
        return path.read_bytes(), packets.read_bytes() if packets.exists() else b""


INSIDE, _ = content_of(version="1.3", point_format=4)
POINTS, PACKETS = content_of(external=True)


@fuzz.fuzzed
@hypothesis.given(fuzz.damage(INSIDE))
def test_damaged_las_gives_data_or_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.las").write_bytes(content)
    fuzz.give_data_or_one_line(tmp_path / "a.las")


@fuzz.fuzzed
@hypothesis.given(fuzz.damage(POINTS), fuzz.damage(PACKETS))
def test_damaged_las_beside_a_damaged_wdp_gives_data_or_one_line(tmp_path: Path, points: bytes, packets: bytes) -> None:
    (tmp_path / "a.las").write_bytes(points)
    (tmp_path / "a.wdp").write_bytes(packets)
    fuzz.give_data_or_one_line(tmp_path / "a.las")
