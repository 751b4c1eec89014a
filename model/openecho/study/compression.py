"""Bits a sample and speed of the lossless codec, beside general compressors and the entropy of what prediction leaves.

On recorded files, those of the folder that OPENECHO_DATA names, and on the reference waveforms of the benches. Run as
``python -m openecho.study.compression``; the report is ``build/reports/compression.json``.
"""

from __future__ import annotations

import argparse
import lzma
import os
import statistics
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

from openecho import codec, formats, report, stimulus
from openecho.formats import Recording
from openecho.formats.compressed import head, pack_chunk, plan, write
from openecho.golden.codec import Predictions, fold, signed

FRAME_BITS = 8 * 16
"""Head and tail of a record, of the published threshold coding: there, N, M and T."""
REPEATS = 5
"""Timings, of which the median counts."""
ENOUGH = 2_000_000
"""Samples that a timing takes, over and over the same if there are fewer."""

GENERAL: dict[str, Callable[[bytes], bytes]] = {
    "zlib 9": lambda data: zlib.compress(data, 9),
    "zstd 19": lambda data: zstandard.ZstdCompressor(level=19).compress(data),
    "xz 9": lambda data: lzma.compress(data, preset=9 | lzma.PRESET_EXTREME),
}
UNDONE: dict[str, Callable[[bytes], bytes]] = {
    "zlib 9": zlib.decompress,
    "zstd 19": lambda data: zstandard.ZstdDecompressor().decompress(data),
    "xz 9": lzma.decompress,
}


@dataclass(frozen=True)
class Set:
    """Waveforms to compress: counts (n, m) and lengths (n,), and how many bits a sample needs."""

    name: str
    samples: NDArray[np.uint16]
    length: NDArray[np.int32]
    bits: int

    @property
    def count(self) -> int:
        """Samples of all waveforms."""
        return int(self.length.sum(dtype=np.int64))

    @property
    def flat(self) -> NDArray[np.uint16]:
        """Samples end to end."""
        return self.samples[np.arange(self.samples.shape[1]) < self.length[:, None]]


def recorded(path: Path) -> Set:
    """A recorded file as a whole."""
    with formats.open(path) as recording:
        waveforms = formats.load(path, 16)
        return _set(recording.path.stem, waveforms.samples, waveforms.length)


def reference() -> Iterator[Set]:
    """The waveforms of the benches."""
    for name, made in (("land", stimulus.land()), ("ocean", stimulus.ocean())):
        yield _set(f"reference {name}", made.samples, made.length)


def _set(name: str, samples: NDArray[np.uint16], length: NDArray[np.int32]) -> Set:
    return Set(name, samples, length, max(1, int(samples.max()).bit_length()))


def bits_a_sample(waveforms: Set) -> dict[str, float]:
    """What each way takes, in bits a sample.

    Parameters
    ----------
    waveforms : Set

    Returns
    -------
    dict
        By name: ``published``, the threshold coding with twice the RMS of the noise and no baseline; ``published,
        best T``; ``threshold``, with its best baselines; ``prediction``, codes alone; ``file``, as a whole ``.oec``;
        zlib, zstd and xz, on the samples end to end, as bytes if they fit, else as 16-bit words or their low and then
        their high bytes, whichever is shorter; ``entropy``, of `residuals`; and that of a fixed order.
    """
    samples, length, bits = waveforms.samples, waveforms.length, waveforms.bits
    forms = {
        "published": codec.published_threshold(samples, length, bits),
        "published, best T": codec.best_threshold(samples, length, bits, (0, 0)),
        "threshold": codec.choose(samples, length, bits, codec.THRESHOLD),
        "prediction": codec.choose(samples, length, bits, codec.PREDICTION),
    }
    sizes: dict[str, float] = {name: 8 * len(codec.pack(samples, length, form)[0]) for name, form in forms.items()}
    for name in ("published", "published, best T"):
        sizes[name] += FRAME_BITS * len(length)
    sizes["file"] = 8 * len(whole_file(waveforms))
    for name, compress in GENERAL.items():
        sizes[name] = 8 * min(len(compress(data)) for data in plain(waveforms))
    limits = {"entropy": _entropy(residuals(waveforms)), "entropy, fixed order": fixed_entropy(waveforms)}
    return {name: size / waveforms.count for name, size in sizes.items()} | limits


def residuals(waveforms: Set) -> NDArray[np.int64]:
    """What prediction leaves, of all samples, folded: what the codes are of.

    Their entropy is the limit of a coder that knows how often each comes and nothing else; one that adapts to what came
    just before can stay below.
    """
    order = np.argsort(-waveforms.length, kind="stable")
    samples, length = waveforms.samples[order].astype(np.int64), waveforms.length[order]
    form = codec.choose(waveforms.samples, waveforms.length, waveforms.bits, codec.PREDICTION)
    even, odd = (np.full(len(length), height) for height in form.baseline)
    predictions = Predictions(even, odd, waveforms.bits)
    left = []
    for index in range(samples.shape[1]):
        active = int((length > index).sum())
        guess, _ = predictions.take(index, active)
        left.append(fold(signed(2 * samples[:active, index] - guess, waveforms.bits)))
        predictions.renew(index, samples[:active, index])
    return np.concatenate(left)


def fixed_entropy(waveforms: Set) -> float:
    """Entropy, bits a sample, of the residuals of the best of three predictions, one of them for a whole set.

    Order 0 is the median of a waveform, order 1 the sample before, order 2 the line through the two before.
    """
    rows = [row[:count].astype(np.int64) for row, count in zip(waveforms.samples, waveforms.length, strict=True)]
    orders = (
        np.concatenate([row - int(np.median(row)) for row in rows]),
        np.concatenate([np.diff(row, prepend=row[0]) for row in rows]),
        np.concatenate([np.diff(row, 2, prepend=[row[0], row[0]]) for row in rows]),
    )
    return min(_entropy(left) for left in orders)


def _entropy(values: NDArray[np.int64]) -> float:
    """Bits of a value, if each comes by itself."""
    _, counts = np.unique(values, return_counts=True)
    share = counts / counts.sum()
    return float(-(share * np.log2(share)).sum())


def plain(waveforms: Set) -> list[bytes]:
    """Samples end to end as general compressors may be given them."""
    flat = waveforms.flat
    if waveforms.bits <= 8:
        return [flat.astype(np.uint8).tobytes()]
    words = flat.astype("<u2").tobytes()
    return [words, words[::2] + words[1::2]]


def whole_file(waveforms: Set) -> bytes:
    """The set as a compressed file."""
    n, m = waveforms.samples.shape
    length = waveforms.length

    def read(first: int, count: int) -> formats.Block:
        rows = slice(first, first + count)
        longest = int(length[rows].max())
        return formats.Block(first, waveforms.samples[rows, :longest], length[rows])

    told: dict[str, Any] = dict.fromkeys(("bin_ns", "coordinates", "time_unit", "volts"))
    recording = Recording(Path(), "set", n, m, parts=((None, n),), reader=read, closer=lambda: None, **told)
    file = BytesIO()
    chunks = (
        (first, pack_chunk(read(first, count), waveforms.bits, codec.PREDICTION)) for first, count in plan(recording)
    )
    write(file, head(recording, waveforms.bits), chunks)
    return file.getvalue()


def speeds(waveforms: Set) -> dict[str, dict[str, float]]:
    """Million samples a second, on one core, of the codec and of general compressors: the median of `REPEATS`."""
    samples, length, count = waveforms.samples, waveforms.length, waveforms.count
    found = {}
    for mode, name in enumerate(codec.MODES):
        form = codec.choose(samples, length, waveforms.bits, mode)
        payload, _ = codec.pack(samples, length, form)
        found[name] = {
            "compress": _rate(lambda form=form: codec.pack(samples, length, form), count),  # type: ignore[misc]
            "decompress": _rate(lambda payload=payload, form=form: codec.unpack(payload, length, form), count),  # type: ignore[misc]
        }
    data = plain(waveforms)[0]
    for name, compress in GENERAL.items():
        small = compress(data)
        undo = UNDONE[name]
        found[name] = {
            "compress": _rate(lambda compress=compress: compress(data), count, 1),  # type: ignore[misc]
            "decompress": _rate(lambda undo=undo, small=small: undo(small), count),  # type: ignore[misc]
        }
    return found


def _rate(call: Callable[[], object], count: int, repeats: int = REPEATS) -> float:
    calls = max(1, ENOUGH // count) if repeats > 1 else 1
    call()
    taken = []
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(calls):
            call()
        taken.append((time.perf_counter() - start) / calls)
    return count / statistics.median(taken) / 1e6


def table(results: dict[str, dict[str, Any]]) -> Table:
    """Bits a sample of each way, a column a set."""
    shown = Table(box=box.SIMPLE, title="bits a sample")
    shown.add_column("way")
    for name, result in results.items():
        shown.add_column(f"{name}, {result['bits']} bits", justify="right")
    for way in next(iter(results.values()))["bits_a_sample"]:
        shown.add_row(way, *(f"{result['bits_a_sample'][way]:.3f}" for result in results.values()))
    return shown


def speed_table(found: dict[str, dict[str, float]]) -> Table:
    """Speeds of each way."""
    shown = Table(box=box.SIMPLE, title="million samples/s, one core")
    for name in ("way", "compress", "decompress"):
        shown.add_column(name, justify="left" if name == "way" else "right")
    for name, speed in found.items():
        shown.add_row(name, *(f"{rate:,.1f}" for rate in speed.values()))
    return shown


def main() -> None:
    """Measure, print and write the report."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    folder = os.environ.get("OPENECHO_DATA")
    paths = sorted(Path(folder).glob("*.npz")) if folder else []
    console = Console()
    if not paths:
        console.print("OPENECHO_DATA names no folder with recorded waveforms: the reference waveforms alone")
    sets = [*(recorded(path) for path in paths), *reference()]
    results = {
        each.name: {
            "bits": each.bits,
            "waveforms": len(each.length),
            "samples": each.count,
            "bits_a_sample": bits_a_sample(each),
        }
        for each in track(sets, "compressing", console=Console(stderr=True), transient=True)
    }
    largest = max(sets, key=lambda each: each.count)
    speed = speeds(largest)
    console.print(table(results))
    console.print(speed_table(speed))
    content = {"tools": report.tools("numpy", "numba", "zstandard"), "sets": results, "speed_of": largest.name}
    console.print(f"report: {report.write('compression', content | {'million_samples_s': speed})}")


if __name__ == "__main__":
    main()
