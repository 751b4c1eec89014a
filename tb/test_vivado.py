"""The scripts for Vivado, run under tclsh with stand-ins that refuse what Vivado would: tb/vivado/stand_ins.tcl."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from openecho import __version__, hardware
from openecho.golden import ARITHMETICS, TAP_SETS, Config

STAND_INS = hardware.ROOT / "tb" / "vivado" / "stand_ins.tcl"
CORE = hardware.MODULES["core"]
WRAPPER = "rtl/axi/openecho_axi_top.v"
PART = "xc7z035ffg676-2"
VLNV = f"openecho.org:lidar:openecho:{__version__.rpartition('.')[0]}"


@dataclass(frozen=True)
class Tree:
    """A copy of what the scripts need, with a `vivado` that is tclsh with the stand-ins."""

    root: Path

    @property
    def output(self) -> Path:
        """Folder that the scripts write to."""
        return self.root / "build" / "vivado"

    def run(self, *arguments: str, **given: object) -> subprocess.CompletedProcess[str]:
        """scripts/vivado.py, where the stand-ins pretend what is given."""
        return self.start(str(self.root / "bin") + os.pathsep + os.environ["PATH"], *arguments, **given)

    def start(self, path: str, *arguments: str, **given: object) -> subprocess.CompletedProcess[str]:
        """The same, with the commands on a path."""
        self.output.mkdir(parents=True, exist_ok=True)
        (self.root / "calls").unlink(missing_ok=True)
        environment = os.environ | {
            "PATH": path,
            "PYTHONPATH": str(self.root / "model"),
            "STAND_IN": " ".join(f"{name} {value}" for name, value in given.items()),
            "STAND_IN_CALLS": str(self.root / "calls"),
        }
        command = [sys.executable, str(self.root / "scripts" / "vivado.py"), *arguments]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)

    def calls(self) -> list[list[str]]:
        """Each call of the last run, a command and its arguments."""
        return [line.split("\t") for line in (self.root / "calls").read_text().splitlines()]

    def commands(self, *wanted: str) -> list[str]:
        """Commands of the last run in their order, of those wanted."""
        return [call[0] for call in self.calls() if call[0] in wanted]

    def call(self, command: str) -> list[str]:
        """The only call of a command."""
        (call,) = (call for call in self.calls() if call[0] == command)
        return call

    def edit(self, path: str, old: str, new: str) -> None:
        """Replace what is in a file at least once."""
        text = (self.root / path).read_text()
        assert old in text, f"{path}: no {old!r}"
        (self.root / path).write_text(text.replace(old, new))


def grow(root: Path, tclsh: str) -> Tree:
    for name in ("rtl", "scripts", "constraints", "model/openecho"):
        shutil.copytree(hardware.ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
    program = root / "bin" / "vivado"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(tclsh)} {shlex.quote(str(STAND_INS))} "$@"\n')
    program.chmod(0o755)
    return Tree(root)


@pytest.fixture
def tclsh() -> str:
    """Tcl's shell, which a test without it fails in CI, or is skipped."""
    path = shutil.which("tclsh")
    if path is None:
        assert "CI" not in os.environ, "CI: tclsh not found, expected it installed (Debian: apt-get install tcl)"
        pytest.skip("tclsh not found (Debian: apt-get install tcl)")
    return path


@pytest.fixture
def tree(tmp_path: Path, tclsh: str) -> Tree:
    return grow(tmp_path / "tree", tclsh)


@pytest.fixture
def packaged(tree: Tree) -> Tree:
    """With the core packaged as IP."""
    run = tree.run("--step", "package")
    assert run.returncode == 0, run.stderr
    return tree


def assert_refused(run: subprocess.CompletedProcess[str], *said: str, status: int = 2) -> None:
    """One line says what is wrong; after it only that the step has failed."""
    assert run.returncode == status, run.stderr
    first, *more = run.stderr.splitlines()
    assert first.startswith("error: ")
    assert all(word in first for word in said), first
    assert all(line.startswith("error: step ") for line in more), run.stderr


def ports(source: Path) -> dict[str, str]:
    """Port of a Verilog wrapper to its direction."""
    header = source.read_text().partition(");")[0]
    found = re.findall(r"^\s*(input|output)\s+(?:(?:wire|reg)\s+)?(?:\[[^\]]*\]\s*)?(\w+)", header, re.MULTILINE)
    return {name: direction for direction, name in found}


def core_ports() -> dict[str, str]:
    """Port of the core to its direction, as the module table has them, but for the clock."""
    found = dict.fromkeys(("rst", *CORE.settings), "input")
    for streams, forward, backward in ((CORE.inputs, "input", "output"), (CORE.outputs, "output", "input")):
        for stream in streams:
            found |= {f"{stream.prefix}_{name}": forward for name in ("valid", "last", *stream.fields)}
            found[f"{stream.prefix}_ready"] = backward
    return found


# ---- the steps, as they are meant to go ------------------------------------------------------------------------------


def test_synthesis_reads_then_synthesises_then_reports_and_keeps_what_it_made(tree: Tree) -> None:
    run = tree.run("--step", "synth")
    assert run.returncode == 0, run.stderr
    order = ("read_verilog", "read_xdc", "synth_design", "create_clock", "report_timing_summary", "write_checkpoint")
    assert tree.commands(*order) == list(order)
    synthesised = tree.call("synth_design")
    assert synthesised[synthesised.index("-top") + 1] == CORE.top
    assert synthesised[synthesised.index("-part") + 1] == PART
    assert synthesised[synthesised.index("-mode") + 1] == "out_of_context"
    made = ("synth.dcp", "synth_utilization.rpt", "synth_timing.rpt", "synth.summary", "synth.log")
    assert all((tree.output / name).is_file() for name in made)


def test_sources_are_those_of_the_module_table_in_its_order(tree: Tree) -> None:
    assert tree.run("--step", "synth").returncode == 0
    expected = [tree.root / source.relative_to(hardware.ROOT) for source in CORE.sources]
    assert tree.call("read_verilog")[-1].split() == [str(path) for path in expected]


def test_implementation_links_then_optimises_places_and_routes_and_then_reports(tree: Tree) -> None:
    assert tree.run("--step", "synth").returncode == 0
    run = tree.run("--step", "impl")
    assert run.returncode == 0, run.stderr
    order = (
        *("read_checkpoint", "link_design", "opt_design", "place_design", "phys_opt_design", "route_design"),
        *("report_timing_summary", "report_drc", "write_checkpoint"),
    )
    assert tree.commands(*order) == list(order)
    linked = tree.call("link_design")
    assert linked[linked.index("-mode") + 1] == "out_of_context"
    assert linked[linked.index("-part") + 1] == PART
    made = ("impl.dcp", "impl_utilization.rpt", "impl_timing.rpt", "impl_route.rpt", "impl_drc.rpt", "impl.summary")
    assert all((tree.output / name).is_file() for name in made)


def test_report_has_what_the_scripts_have_measured(tree: Tree) -> None:
    assert tree.run("--step", "synth", "--arith", "float32").returncode == 0
    run = tree.run("--step", "impl", "--arith", "float32", slack_max=0.25, slack_min=0.0625)
    assert run.returncode == 0, run.stderr
    report = json.loads((tree.root / "build" / "reports" / "vivado.json").read_text())
    assert report["tools"]["vivado"] == "2020.1"
    assert (report["part"], report["period_ns"]) == (PART, 5.0)
    assert (report["arithmetic"], report["taps"], report["parameters"]["EXP_W"]) == ("float32", "paper", "8")
    taken = {"lut": 1901, "lut_logic": 1646, "lut_ram": 255, "ff": 2228, "bram": 1.5, "dsp": 1}
    timing = {"wns_ns": 0.25, "whs_ns": 0.0625, "unrouted": 0, "drc_errors": 0}
    assert report["rows"] == [{"step": "impl"} | taken | timing]


@pytest.mark.parametrize("taps", TAP_SETS)
@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.arithmetic(name)) for name in ARITHMETICS])
def test_core_is_synthesised_with_the_parameters_that_it_is_simulated_with(tree: Tree, name: str, taps: str) -> None:
    run = tree.run("--step", "synth", "--arith", name, "--taps", taps)
    assert run.returncode == 0, run.stderr
    call = tree.call("synth_design")
    generics = [call[place + 1] for place, word in enumerate(call) if word == "-generic"]
    expected = hardware.parameters(Config(taps=TAP_SETS[taps]).in_arithmetic(name))
    assert generics == [f"{parameter}={expected[parameter]}" for parameter in CORE.parameters]


def test_scripts_work_where_a_path_has_spaces_and_brackets(tmp_path: Path, tclsh: str) -> None:
    odd = grow(tmp_path / "a [b] $c {d", tclsh)
    run = odd.run("--step", "synth")
    assert run.returncode == 0, run.stderr


# ---- packaging and the block design ----------------------------------------------------------------------------------


def test_package_has_the_interfaces_of_the_wrapper_on_one_clock_and_the_parameters_as_defaults(packaged: Tree) -> None:
    run = packaged.run("--step", "package", "--arith", "float16")
    assert run.returncode == 0, run.stderr
    values = hardware.parameters(Config().in_arithmetic("float16"))
    taken = " ".join(name + " " + re.sub(r"^\d+'h", "0x", values[name]) for name in CORE.parameters)
    order = ("add_files", "ipx::package_project", "ipx::check_integrity", "ipx::save_core")
    assert packaged.commands(*order) == list(order)
    component = (packaged.output / "ip" / "component.xml").read_text()
    assert f"vlnv {VLNV}" in component
    assert "s_axis {Slave axis} m_axis {Master axis} s_axi {Slave axi}" in component
    assert "irq {Master interrupt}" in component
    assert "clocked {s_axis m_axis s_axi}" in component
    assert "reset aresetn" in component
    assert f"user_parameters {{{taken}}} hdl_parameters {{{taken}}}" in component
    copied = {path.name for path in (packaged.output / "ip" / "src").iterdir()}
    assert {source.name for source in CORE.sources} <= copied
    assert {path.name for path in (hardware.RTL / "axi").glob("*.*v")} <= copied


def test_block_design_is_validated_saved_and_wrapped(packaged: Tree) -> None:
    run = packaged.run("--step", "bd")
    assert run.returncode == 0, run.stderr
    order = ("create_project", "update_ip_catalog", "create_bd_design", "validate_bd_design", "save_bd_design")
    assert packaged.commands(*order, "make_wrapper") == [*order, "make_wrapper"]
    cells = [call[call.index("-vlnv") + 1] for call in packaged.calls() if call[0] == "create_bd_cell"]
    assert VLNV in cells
    assert ["set_property", "top", "openecho_zynq_wrapper", "fileset:sources_1"] in packaged.calls()
    assert {"processing_system7", "axi_dma", "axis_dwidth_converter"} <= {cell.split(":")[2] for cell in cells}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("dma/mm2s_introut", "dma/mm2s_irq"),
        ("attach core/m_axis width/S_AXIS", "attach width/S_AXIS dma/M_AXIS_MM2S"),
        ("  attach width/M_AXIS dma/S_AXIS_S2MM\n", ""),
        ("  wire ps/FCLK_RESET0_N reset/ext_reset_in\n", ""),
        ("width/aclk control/aclk", "control/aclk"),
        ("wire reset/peripheral_aresetn core/aresetn", "wire reset/peripheral_aresetn core/aclk"),
        (" 0x43C00000 core/s_axi/*", ""),
        ("0x43C00000", "0x40400000"),
        ("0x43C00000", "0x83C00000"),
        ("CONFIG.NUM_PORTS 3", "CONFIG.NUM_PORTS 2"),
        ("      CONFIG.c_include_sg 0 \\\n", ""),
        ("      CONFIG.c_m_axi_s2mm_data_width 64 \\\n", ""),
        ("      CONFIG.PCW_USE_FABRIC_INTERRUPT 1 \\\n", ""),
        ("  make_wrapper -files [get_files openecho_zynq.bd] -top -import\n", ""),
        ("CONFIG.PCW_USE_S_AXI_HP0 1", "CONFIG.PCW_USE_S_AXI_HP0 0"),
        ("CONFIG.c_sg_length_width 26", "CONFIG.length_width 26"),
        ("CONFIG.M_TDATA_NUM_BYTES 8", "CONFIG.M_TDATA_NUM_BYTES 16"),
        ("axi_dma:7.1", "axi_dma:7.0"),
        ("dma/Data_MM2S dma/Data_S2MM", "dma/Data_MM2S"),
        ("  validate_bd_design\n", ""),
    ],
)
def test_block_design_with_a_mistake_is_refused(packaged: Tree, old: str, new: str) -> None:
    packaged.edit("scripts/vivado/zynq_bd.tcl", old, new)
    assert packaged.run("--step", "bd").returncode == 1


def test_block_design_without_the_package_is_refused(tree: Tree) -> None:
    assert_refused(tree.run("--step", "bd"), "component.xml", "--step package")


def test_wrapper_whose_ports_make_no_interface_is_refused(tree: Tree) -> None:
    tree.edit(WRAPPER, "s_axis_tvalid", "s_axis_valid")
    assert_refused(tree.run("--step", "package"), "s_axis", status=1)


def test_missing_wrapper_is_refused(tree: Tree) -> None:
    shutil.rmtree(tree.root / "rtl" / "axi", ignore_errors=True)
    assert tree.run("--step", "synth").returncode == 0
    assert_refused(tree.run("--step", "package"), "openecho_axi_top.v")


def test_wrapper_without_a_parameter_of_the_core_is_refused(tree: Tree) -> None:
    tree.edit(WRAPPER, "EXP_W", "EXPONENT_W")
    assert_refused(tree.run("--step", "package"), "EXP_W", status=1)


def test_package_of_another_version_is_refused(packaged: Tree) -> None:
    packaged.edit("model/openecho/__init__.py", f'"{__version__}"', '"7.0.0"')
    assert_refused(packaged.run("--step", "bd"), "openecho:7.0", "--step package")


def test_package_that_vivado_finds_incomplete_fails(tree: Tree) -> None:
    assert_refused(tree.run("--step", "package", integrity=0), "incomplete", status=1)


# ---- what makes a step fail ------------------------------------------------------------------------------------------


def test_missed_setup_fails_synthesis_which_still_reports_it(tree: Tree) -> None:
    assert_refused(tree.run("--step", "synth", slack_max=-0.1), "wns_ns -0.1", "5.000 ns", status=1)
    (row,) = json.loads((tree.root / "build" / "reports" / "vivado.json").read_text())["rows"]
    assert row["wns_ns"] == -0.1
    assert (tree.output / "synth.dcp").is_file()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"slack_max": -0.001}, "wns_ns -0.001"),
        ({"slack_min": -0.02}, "whs_ns -0.02"),
        ({"unrouted": 3}, "3 nets"),
        ({"conflicts": 2}, "2 nets"),
        ({"violations": 1}, "design rules"),
        ({"paths": 0}, "no timed"),
        ({"slack_max": "inf"}, "no timed"),
        ({"rows": 0}, "Slice LUTs"),
    ],
)
def test_implementation_that_is_not_clean_fails(tree: Tree, given: dict[str, object], said: str) -> None:
    assert tree.run("--step", "synth").returncode == 0
    assert_refused(tree.run("--step", "impl", **given), said, status=1)


def test_first_step_that_fails_is_the_last_that_is_run(tree: Tree) -> None:
    assert tree.run(slack_max=-0.1).returncode == 1
    assert tree.commands("synth_design", "link_design", "create_project") == ["synth_design"]


@pytest.mark.parametrize("version", ["2018.3", "2019.2.1", "2019.10", "unknown"])
@pytest.mark.parametrize("step", ["synth", "impl", "package", "bd"])
def test_old_vivado_is_refused_before_anything_is_done(tree: Tree, step: str, version: str) -> None:
    assert_refused(tree.run("--step", step, version=version), f"found {version}", "2020.1")
    assert {call[0] for call in tree.calls()} == {"version"}


@pytest.mark.parametrize("version", ["2020.1", "2020.1.1", "2020.2", "2024.1.2", "2025.2"])
def test_newer_vivado_is_taken(tree: Tree, version: str) -> None:
    run = tree.run("--step", "synth", version=version)
    assert run.returncode == 0, run.stderr
    report = json.loads((tree.root / "build" / "reports" / "vivado.json").read_text())
    assert report["tools"]["vivado"] == version
    assert (report["rows"][0]["lut"], report["rows"][0]["dsp"]) == (1901, 1)


def test_part_that_is_not_installed_is_refused(tree: Tree) -> None:
    tree.edit("scripts/vivado/common.tcl", PART, "xc7z045ffg676-2")
    assert_refused(tree.run("--step", "synth"), "xc7z045ffg676-2")


def test_implementation_without_synthesis_is_refused(tree: Tree) -> None:
    assert_refused(tree.run("--step", "impl"), "synth.summary", "--step synth")


def test_implementation_of_what_was_synthesised_with_other_parameters_is_refused(tree: Tree) -> None:
    assert tree.run("--step", "synth").returncode == 0
    assert_refused(tree.run("--step", "impl", "--arith", "float16"), "another EXP_W", "--step synth")


def test_missing_vivado_is_one_line_and_leaves_no_report(tree: Tree) -> None:
    run = tree.start(str(tree.root / "empty"))
    assert run.returncode == 2
    assert run.stderr == "error: vivado not found on PATH, expected Vivado 2020.1 or newer (settings64.sh)\n"
    assert not (tree.root / "build" / "reports").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--arith", "float8"), ("ARITH", "float8", "float16")),
        (("--taps", "none"), ("TAPS", "none", "paper")),
        (("--step", "bitstream"), ("STEP", "bitstream", "impl")),
    ],
)
def test_unknown_arguments_are_refused_with_what_was_expected(
    tree: Tree, arguments: tuple[str, ...], said: tuple[str, ...]
) -> None:
    assert_refused(tree.run(*arguments), *said)


# ---- files -----------------------------------------------------------------------------------------------------------


def test_renamed_source_is_refused_by_the_module_table(tree: Tree) -> None:
    (tree.root / "rtl" / "openecho_fifo.sv").rename(tree.root / "rtl" / "openecho_queue.sv")
    assert_refused(tree.run("--step", "synth"), "rtl")


def test_source_renamed_since_the_list_was_made_is_refused_by_the_scripts(tree: Tree, tclsh: str) -> None:
    assert tree.run("--step", "synth").returncode == 0
    (tree.root / "rtl" / "openecho_fifo.sv").rename(tree.root / "rtl" / "openecho_queue.sv")
    for script in ("synth", "impl", "package_ip", "zynq_bd"):
        command = [tclsh, str(STAND_INS), "-mode", "batch", "-source", f"{tree.root}/scripts/vivado/{script}.tcl"]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert_refused(run, "openecho_fifo.sv", "no such file")


def test_missing_constraints_are_refused(tree: Tree) -> None:
    (tree.root / "constraints" / "xc7z035.xdc").unlink()
    assert_refused(tree.run("--step", "synth"), "xc7z035.xdc")


def test_summary_of_an_earlier_run_is_not_taken_for_that_of_a_run_that_ended_early(tree: Tree) -> None:
    assert tree.run("--step", "synth").returncode == 0
    (tree.root / "build" / "reports" / "vivado.json").unlink()
    assert tree.run("--step", "synth", rows=0).returncode == 1
    assert not (tree.root / "build" / "reports").joinpath("vivado.json").exists()


# ---- constraints -----------------------------------------------------------------------------------------------------


def constrained(tree: Tree) -> list[list[str]]:
    """Direction and port for each input and output delay of the last run."""
    return sorted(call[1:] for call in tree.calls() if call[0] == "constrained")


def synthesise_axi(tree: Tree) -> None:
    """Synthesise with the wrapper as top, for what the constraints make of its ports."""
    tree.edit("scripts/vivado/common.tcl", "variable top openecho_core", "variable top openecho_axi_top")
    tree.edit(
        "scripts/vivado/synth.tcl", "read_verilog -sv $sources", "read_verilog -sv [concat $sources $axi_sources]"
    )
    run = tree.run("--step", "synth")
    assert run.returncode == 0, run.stderr


def test_every_port_of_the_core_but_the_clock_has_one_delay(tree: Tree) -> None:
    assert tree.run("--step", "synth").returncode == 0
    assert constrained(tree) == sorted([direction, name] for name, direction in core_ports().items())
    assert tree.call("create_clock")[-1] == "port:clk"


def test_every_port_of_the_axi_wrapper_but_the_clock_has_one_delay(tree: Tree) -> None:
    synthesise_axi(tree)
    found = ports(tree.root / WRAPPER)
    assert found.pop("aclk") == "input"
    assert constrained(tree) == sorted([direction, name] for name, direction in found.items())
    assert tree.call("create_clock")[-1] == "port:aclk"


def test_constraints_name_no_port_that_neither_top_has(tree: Tree) -> None:
    def unmatched() -> set[str]:
        return {call[2] for call in tree.calls() if call[:2] == ["no_match", "port"]}

    assert tree.run("--step", "synth").returncode == 0
    of_core = unmatched()
    assert "s_axis_tvalid" in of_core
    synthesise_axi(tree)
    assert not of_core & unmatched()


def test_clock_of_the_constraints_is_that_of_the_block_design(packaged: Tree) -> None:
    packaged.edit("constraints/xc7z035.xdc", "set period 5.000", "set period 8.000")
    assert packaged.run("--step", "bd").returncode == 0
    (ps,) = (call for call in packaged.calls() if call[0] == "set_property" and call[-1] == "cell:ps")
    assert "CONFIG.PCW_FPGA0_PERIPHERAL_FREQMHZ 125.0 " in ps[2]


@pytest.mark.parametrize(
    "mistake",
    [
        "if {1} {set x 1}",
        "puts hello",
        "create_clock -frequency 200 [get_ports clk]",
        "set_input_delay -clock other 1.0 [get_ports s_valid]",
        "set_input_delay -clock core_clock 1.0 [get_ports m_valid]",
        "set_input_delay -clock core_clock 1.0 [get_ports s_sample]",
        "set_output_delay -clock core_clock 1.0 [get_ports -quiet nothing]",
        "set_property HD.CLOCK BUFGCTRL_X0Y0 [get_ports clk]",
        "set_false_path -form [get_ports rst]",
    ],
)
def test_constraint_that_vivado_would_not_take_is_refused(tree: Tree, mistake: str) -> None:
    with (tree.root / "constraints" / "xc7z035.xdc").open("a") as file:
        file.write(f"{mistake}\n")
    assert tree.run("--step", "synth").returncode == 1


# ---- the stand-ins refuse mistakes -----------------------------------------------------------------------------------


MISTAKES = (
    ("synth", "synth.tcl", "read_verilog -sv", "read_verilog -systemverilog"),
    ("synth", "synth.tcl", "-top $top", "-top openecho_kernel"),
    ("synth", "synth.tcl", "-mode out_of_context", "-mode ooc"),
    ("synth", "synth.tcl", "$parameter=$value", "G_$parameter=$value"),
    ("synth", "synth.tcl", "-report_unconstrained", "-unconstrained"),
    ("synth", "synth.tcl", "  read_verilog -sv $sources\n", ""),
    ("synth", "synth.tcl", "  read_xdc [list", "  concat [list"),
    ("synth", "synth.tcl", "write_checkpoint -force", "write_checkpoint -overwrite"),
    ("synth", "synth.tcl", "namespace eval openecho {", "lmap x {1} {set x}\nnamespace eval openecho {"),
    ("impl", "impl.tcl", "  place_design\n", ""),
    ("impl", "impl.tcl", "  route_design\n", ""),
    ("impl", "impl.tcl", "opt_design\n", "opt_design -fast\n"),
    ("impl", "impl.tcl", "-route_type $status", "-route_type ALL_$status"),
    ("impl", "impl.tcl", "-name impl -filter", "-name other -filter"),
    ("impl", "impl.tcl", "-part $part", "-part xc7z035"),
)
"""Step, script, and a text with what would be wrong in its place."""


@pytest.mark.parametrize(("step", "script", "old", "new"), MISTAKES)
def test_script_with_a_mistake_is_refused(tree: Tree, step: str, script: str, old: str, new: str) -> None:
    assert tree.run("--step", "synth").returncode == 0
    tree.edit(f"scripts/vivado/{script}", old, new)
    assert tree.run("--step", step).returncode == 1


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("  set_property top $axi_top [current_fileset]\n", ""),
        ("-root_dir $ip", "-root $ip"),
        ("-clock aclk -reset", "-clock clk -reset"),
        ("[split [vlnv] :]", "[split [vlnv].0 :]"),
        ("concat $sources $axi_sources", "set sources"),
        (" -import_files", ""),
    ],
)
def test_packaging_with_a_mistake_is_refused(tree: Tree, old: str, new: str) -> None:
    tree.edit("scripts/vivado/package_ip.tcl", old, new)
    assert tree.run("--step", "package").returncode == 1
