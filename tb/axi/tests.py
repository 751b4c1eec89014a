"""What the shell promises, with whatever parameters it is built."""

from __future__ import annotations

from typing import Any

import cocotb
import numpy as np
from cocotb.triggers import ClockCycles, FallingEdge, RisingEdge, Timer
from numpy.typing import NDArray

from openecho.golden import NOISE_SAMPLES
from openecho.registers import ADDRESS_W, BY_NAME, READ_ONLY, REGISTERS, SETTINGS, reset_values
from tb.axi.shell import (
    OKAY,
    SLVERR,
    Shell,
    busy,
    changed,
    counts,
    equal,
    expected,
    increasing,
    others,
    poll,
    settings,
    shell_test,
)
from tb.env import pins
from tb.env.coverage import Samples

WAVEFORM_IRQ, ERROR_IRQ = 1, 2
TOO_SHORT, TOO_LONG, SAMPLE, SETTING = 1, 2, 4, 8
"""Bits of ERROR_CAUSE."""
BUSY, CHANGE_WAITS, RESET_WAITS = 1, 2, 4
"""Bits of STATUS."""


def difficult(shell: Shell) -> list[Samples]:
    """Waveforms that the core flags, and some between them that it does not."""
    config, rng = shell.config, shell.rng
    longest, shortest = config.max_samples, config.tap_count + 2
    lengths = [
        1,
        shortest - 1,
        shortest,
        1,
        1,
        longest,
        longest + 1,
        1,
        longest + 500,
        shortest,
        2 * longest + 3,
        2,
        90,
    ]
    return [rng.integers(0, 1 << config.sample_w, length).astype(np.uint16) for length in lengths]


@shell_test
async def no_output_depends_on_an_input_in_the_same_cycle(shell: Shell) -> None:
    dut = shell.dut
    inputs = [f"s_axis_t{name}" for name in ("data", "valid", "last")] + ["m_axis_tready"]
    inputs += [f"s_axi_{name}" for name in ("awaddr", "awvalid", "wdata", "wstrb", "wvalid", "bready")]
    inputs += [f"s_axi_{name}" for name in ("araddr", "arvalid", "rready")]
    outputs = ["irq", "s_axis_tready", *(f"m_axis_t{name}" for name in ("data", "keep", "valid", "last"))]
    outputs += [
        f"s_axi_{name}" for name in ("awready", "wready", "bresp", "bvalid", "arready", "rdata", "rresp", "rvalid")
    ]
    widths = {name: pins.width(getattr(dut, name)) for name in inputs}
    shell.pause(samples=True, records=True, registers=True)
    shell.send(busy(shell.config, shell.rng))
    shell.polling, polling = True, cocotb.start_soon(poll(shell))
    holding = None
    for cycle in range(600):
        if cycle == 300:  # from here on also while a change waits
            shell.polling = False
            await polling
            holding = cocotb.start_soon(shell.set("K", 0x55))
        await FallingEdge(dut.aclk)
        driven = {name: getattr(dut, name).value for name in inputs}
        steady = {name: str(getattr(dut, name).value) for name in outputs}
        for _ in range(2):
            for name in inputs:
                getattr(dut, name).value = shell.random.getrandbits(widths[name])
            await Timer(1, "ns")
            found = {name: str(getattr(dut, name).value) for name in outputs}
            assert found == steady, [name for name in outputs if found[name] != steady[name]]
        for name, value in driven.items():
            getattr(dut, name).value = value
    assert holding is not None
    await holding


@shell_test
async def every_register_reads_its_reset_value(shell: Shell) -> None:
    await shell.expect(**reset_values(shell.config))
    assert reset_values(shell.config)["ID"] == 0x4F454348


@shell_test
async def a_register_is_found_at_each_of_its_four_bytes(shell: Shell) -> None:
    for register in REGISTERS:
        for byte in range(1, 4):
            assert await shell.ask(register.offset + byte) == (reset_values(shell.config)[register.name], OKAY)
    assert await shell.write(BY_NAME["K"].offset + 2, 0x11) == OKAY
    await shell.expect(K=0x11)


@shell_test
async def what_is_read_only_refuses_every_write(shell: Shell) -> None:
    for register in REGISTERS:
        if register.access == READ_ONLY:
            for strobe in range(16):
                for value in (0xFFFFFFFF, shell.random.getrandbits(32)):
                    assert await shell.write(register.name, value, strobe) == SLVERR
    await shell.expect(**reset_values(shell.config))


@shell_test
async def addresses_without_a_register_answer_an_error(shell: Shell) -> None:
    mapped = {register.offset for register in REGISTERS}
    near = [offset for offset in range(0, 0x200, 4) if offset not in mapped]
    # Every register's address with one higher bit, and the last address of all.
    far = [1 << bit | register.offset for bit in range(7, ADDRESS_W) for register in REGISTERS] + [(1 << ADDRESS_W) - 4]
    for offset in (*near, *far):
        assert offset not in mapped
        assert await shell.ask(offset) == (0, SLVERR)
        assert await shell.write(offset, 0xFFFFFFFF) == SLVERR
    await shell.expect(**reset_values(shell.config))


def ends(shell: Shell) -> dict[str, tuple[int, int]]:
    """Least and greatest legal value of each register of a setting."""
    config = shell.config
    return {
        "N": (0x10, 0xFF),
        "MIN_INTERVAL": (0, (1 << config.idx_w) - 1),
        "MIN_AMPLITUDE": (0, (1 << config.sample_w) - 1),
        "K": (0, 0xFF),
    }


@shell_test
async def settings_are_written_byte_by_byte_and_illegal_ones_change_nothing(shell: Shell) -> None:
    held = {name: reset_values(shell.config)[name] for name in SETTINGS}
    errors = 0
    for name, (low, high) in ends(shell).items():
        for strobe in range(16):
            mask = sum(0xFF << 8 * byte for byte in range(4) if strobe >> byte & 1)
            for width in (4, 5, 8, 9, shell.config.idx_w, shell.config.sample_w, 16, 17, 32):
                value = shell.random.getrandbits(width) | shell.random.getrandbits(1) << width - 1
                merged = held[name] & ~mask | value & mask
                code = await shell.write(name, value, strobe)
                if low <= merged <= high:
                    assert code == OKAY, f"{name}: {merged:#x} answered {code}"
                    held[name] = merged
                else:
                    assert code == SLVERR, f"{name}: {merged:#x} answered {code}"
                    errors += 1
                assert await shell.read(name) == held[name]
    assert errors
    await shell.expect(**held, ERRORS=errors, ERROR_CAUSE=SETTING, IRQ_STATUS=ERROR_IRQ, STATUS=0)


@shell_test
async def settings_take_every_legal_value_at_the_ends_and_none_beyond(shell: Shell) -> None:
    errors = 0
    for name, (low, high) in ends(shell).items():
        for value in (low, high):
            await shell.set(name, value)
            await shell.expect(**{name: value})
        for value in [high + 1, 1 << 31, 0xFFFFFFFF, *([0, low - 1] if low else [])]:
            assert await shell.write(name, value) == SLVERR
            errors += 1
            await shell.expect(**{name: high}, ERRORS=errors)


@shell_test
async def irq_mask_is_written_byte_by_byte_and_keeps_no_other_bits(shell: Shell) -> None:
    held = 0
    for strobe in range(16):
        for value in (0xFFFFFFFF, 0, 0xFFFFFFFE, 0x1):
            await shell.write("IRQ_MASK", value, strobe)
            held = value & 3 if strobe & 1 else held
            await shell.expect(IRQ_MASK=held)


@shell_test
async def one_write_and_one_read_are_under_way_at_a_time(shell: Shell) -> None:
    dut = shell.dut
    address, data = (
        shell.aw._transaction_obj(awaddr=BY_NAME["K"].offset),
        shell.w._transaction_obj(wdata=0x42, wstrb=0xF),
    )
    halves = [(shell.aw, address, dut.s_axi_awready), (shell.w, data, dut.s_axi_wready)]
    for (first, beat, ready), (second, other_beat, other_ready) in (halves, halves[::-1]):
        await shell.set("K", 0x30)
        shell.b.pause = True
        await first.send(beat)
        await ClockCycles(dut.aclk, 10)
        assert (ready.value, other_ready.value, dut.s_axi_bvalid.value) == (0, 1, 0)
        await shell.expect(K=0x30)
        await second.send(other_beat)
        await ClockCycles(dut.aclk, 10)
        assert (ready.value, other_ready.value, dut.s_axi_bvalid.value) == (0, 0, 1)
        await shell.expect(K=0x42)
        shell.b.pause = False
        await ClockCycles(dut.aclk, 10)
        assert int(shell.b.recv_nowait().bresp) == OKAY
        assert (ready.value, other_ready.value, dut.s_axi_bvalid.value) == (1, 1, 0)
    shell.r.pause = True
    await shell.ar.send(shell.ar._transaction_obj(araddr=BY_NAME["K"].offset))
    await ClockCycles(dut.aclk, 10)
    assert (dut.s_axi_rvalid.value, dut.s_axi_arready.value) == (1, 0)


@shell_test
async def the_answer_to_a_read_stays_as_it_was_until_it_is_taken(shell: Shell) -> None:
    shell.sink.pause = True
    shell.send([np.ones(1, np.uint16)] * 100)
    await ClockCycles(shell.dut.aclk, 300)  # the core is full: every cycle counts as a stall
    shell.r.pause = True
    reading = cocotb.start_soon(shell.read("STALLS"))
    await ClockCycles(shell.dut.aclk, 5)
    before = shell.samples_in.stalls
    await ClockCycles(shell.dut.aclk, 100)
    shell.r.pause = False
    assert await reading <= before <= shell.samples_in.stalls - 100
    assert shell.channels["s_axi_r"].stalls >= 100


@shell_test
async def nothing_is_ready_in_reset(shell: Shell) -> None:
    dut = shell.dut
    shell.send(busy(shell.config, shell.rng))
    await shell.wait_for(200)
    await FallingEdge(dut.aclk)
    dut.aresetn.value = 0
    await ClockCycles(dut.aclk, 1)
    for _ in range(10):
        await FallingEdge(dut.aclk)
        for prefix in ("s_axis_t", "s_axi_aw", "s_axi_w", "s_axi_ar"):
            assert getattr(dut, f"{prefix}ready").value == 0, prefix
        for prefix in ("m_axis_t", "s_axi_b", "s_axi_r"):
            assert getattr(dut, f"{prefix}valid").value == 0, prefix


@shell_test
async def a_setting_written_inside_a_waveform_is_used_from_the_next_one_on(shell: Shell) -> None:
    config = shell.config
    for values in others(config):
        await shell.reset()
        other = changed(config, values)
        for _ in range(50):
            waveforms = busy(config, shell.rng)
            old, new = expected(waveforms[:2], config), expected(waveforms[2:], other, 2)
            if not np.array_equal(expected(waveforms[2:], config, 2), new):
                break
        else:
            raise AssertionError(f"{values} makes no difference to any waveforms")
        shell.send(waveforms)
        await shell.wait_for(len(waveforms[0]) + 100)
        for name, value in values.items():
            await shell.set(name, value)
        await shell.expect(**settings(other), STATUS=BUSY | CHANGE_WAITS)
        assert shell.begun == 2
        equal(await shell.take(len(waveforms)), np.concatenate((old, new)))
        assert shell.samples_in.stalls, "the input was not held"
        # Only while the core emptied, and at that one boundary.
        assert np.count_nonzero(np.diff(shell.samples_in.taken) > 1) == 1
        await shell.expect(STATUS=0, STALLS=shell.samples_in.stalls, ERRORS=0)


@shell_test
async def settings_written_while_the_core_is_empty_are_used_at_once(shell: Shell) -> None:
    config = shell.config
    for values in others(config):
        other = changed(config, values)
        await shell.reset()
        await shell.configure(other)
        await shell.expect(STATUS=0)
        waveforms = busy(config, shell.rng, 2)
        shell.send(waveforms)
        equal(await shell.take(2), expected(waveforms, other))
        assert increasing(shell.samples_in.taken)


@shell_test
async def settings_wait_for_records_that_the_sink_does_not_take(shell: Shell) -> None:
    config = shell.config
    values = others(config)[-1]
    waveforms = busy(config, shell.rng)
    shell.send(waveforms)
    await shell.wait_for(100)
    shell.sink.pause = True
    await shell.wait_for(len(waveforms[0]) + 40)
    for name, value in values.items():
        await shell.set(name, value)
    await ClockCycles(shell.dut.aclk, 1000)
    begun = shell.begun
    assert begun == 2
    await shell.expect(STATUS=BUSY | CHANGE_WAITS)
    # One more, in the time of waiting, is part of the same change.
    values |= {"K": 0x20}
    await shell.set("K", values["K"])
    shell.sink.pause = False
    records = await shell.take(len(waveforms))
    equal(
        records, np.concatenate((expected(waveforms[:2], config), expected(waveforms[2:], changed(config, values), 2)))
    )


@shell_test
async def settings_written_at_any_time_are_used_by_all_waveforms_that_begin_after(shell: Shell) -> None:
    config = shell.config
    choices = [("N", 0x2B), ("K", 0x55), ("MIN_INTERVAL", 9)]
    for attempt in range(24):
        await shell.reset()
        name, value = choices[attempt % len(choices)]
        other = changed(config, {name: value})
        waveforms = [samples[: 120 + 40 * k] for k, samples in enumerate(busy(config, shell.rng, 6))]
        shell.pause(samples=attempt // 3 % 3 == 1, records=attempt // 3 % 3 == 2)
        shell.send(waveforms)
        await shell.wait_for(int(shell.rng.integers(1, sum(map(len, waveforms[:-1])))))
        earliest = shell.begun
        await shell.set(name, value)
        latest = shell.begun
        records = await shell.take(len(waveforms))
        possible = [
            np.concatenate((expected(waveforms[:at], config), expected(waveforms[at:], other, at)))
            for at in range(earliest, latest + 1)
        ]
        assert any(np.array_equal(records, wanted) for wanted in possible), f"attempt {attempt}: not from {earliest} on"
        await shell.expect(STATUS=0, STALLS=shell.samples_in.stalls)


@shell_test
async def what_is_written_in_the_cycle_of_a_change_is_not_forgotten(shell: Shell) -> None:
    config = shell.config
    values = {"N": 0x2B, "K": 0xFA}
    first, both = changed(config, {"N": values["N"]}), changed(config, values)

    async def change_and(name: str, value: int, delay: int | None) -> NDArray[Any]:
        await shell.reset()
        shell.send(waveforms)
        await shell.wait_for(50)
        await shell.set("N", values["N"])
        await shell.wait_for(len(waveforms[0]))
        if delay is not None:
            await ClockCycles(shell.dut.aclk, delay)
            assert await shell.write(name, value, order=0) == OKAY
        return await shell.take(len(waveforms))

    waveforms = busy(config, shell.rng, 3)
    await change_and("K", values["K"], None)
    held = shell.samples_in.taken[len(waveforms[0])] - shell.samples_in.taken[len(waveforms[0]) - 1]
    for delay in range(held - 10, held + 4):
        records = await change_and("K", values["K"], delay)
        possible = [
            np.concatenate(
                (
                    expected(waveforms[:1], config),
                    expected(waveforms[1:at], first, 1),
                    expected(waveforms[at:], both, at),
                )
            )
            for at in (1, 2)
        ]
        assert any(np.array_equal(records, wanted) for wanted in possible), f"K written {delay} cycles after the end"
        await shell.expect(STATUS=0)
    for delay in range(held - 10, held + 4):
        records = await change_and("CONTROL", 1, delay)
        possible = [
            np.concatenate(
                (
                    expected(waveforms[:1], config),
                    expected(waveforms[1:at], first, 1),
                    expected(waveforms[at:], first),
                )
            )
            for at in (1, 2)
        ]
        found = [np.array_equal(records, wanted) for wanted in possible]
        assert any(found), f"soft reset {delay} cycles after the end"
        await shell.expect(CONTROL=0, STATUS=0, WAVEFORMS=2 - found.index(True))


@shell_test
async def a_setting_waits_for_the_end_of_a_waveform_whose_trailer_is_out_already(shell: Shell) -> None:
    config = shell.config
    values = others(config)[-1]
    endless = shell.rng.integers(0, 1 << config.sample_w, config.max_samples + 2000).astype(np.uint16)
    waveforms = [endless, *busy(config, shell.rng, 2)]
    shell.send(waveforms)
    await shell.wait_until(lambda: bool(shell.records_out.ends), "the trailer of a waveform that goes on")
    assert not shell.samples_in.ends
    for name, value in values.items():
        await shell.set(name, value)
    await ClockCycles(shell.dut.aclk, 100)
    assert not shell.samples_in.ends
    await shell.expect(STATUS=BUSY | CHANGE_WAITS)
    records = await shell.take(3)
    equal(
        records, np.concatenate((expected(waveforms[:1], config), expected(waveforms[1:], changed(config, values), 1)))
    )
    await shell.expect(STATUS=0, ERRORS=1, ERROR_CAUSE=TOO_LONG)


@shell_test
async def soft_reset_inside_a_waveform_loses_nothing_and_numbers_from_zero(shell: Shell) -> None:
    config = shell.config
    other = changed(config, others(config)[-1])
    await shell.configure(other)
    await shell.set("IRQ_MASK", ERROR_IRQ)
    waveforms = [np.ones(3, np.uint16), *busy(config, shell.rng)]
    assert await shell.write("N", 0) == SLVERR
    shell.send(waveforms)
    await shell.wait_for(3 + len(waveforms[1]) + 50)
    await shell.expect(ERRORS=2, ERROR_CAUSE=SETTING | TOO_SHORT)
    await shell.set("CONTROL", 1)
    assert shell.begun == 3
    await shell.expect(CONTROL=1, STATUS=BUSY | RESET_WAITS)
    wanted = np.concatenate((expected(waveforms[:3], other), expected(waveforms[3:], other)))
    equal(await shell.take(len(waveforms)), wanted)
    await shell.expect(**counts(expected(waveforms[3:], other)), CONTROL=0, STATUS=0, ERROR_CAUSE=0)
    await shell.expect(**settings(other), IRQ_MASK=ERROR_IRQ, IRQ_STATUS=WAVEFORM_IRQ)


@shell_test
async def soft_reset_clears_counters_and_causes_and_keeps_settings(shell: Shell) -> None:
    config = shell.config
    other = changed(config, others(config)[-1])
    await shell.configure(other)
    await shell.set("IRQ_MASK", 3)
    waveforms = [np.ones(3, np.uint16), *busy(config, shell.rng, 2)]
    shell.send(waveforms)
    equal(await shell.take(3), expected(waveforms, other))
    kept = settings(other) | {"IRQ_MASK": 3}
    for order in (0, 1):
        # Nothing without its strobe, or with a zero.
        assert await shell.write("CONTROL", 0xFFFFFFFF, strobe=0xE) == OKAY
        assert await shell.write("CONTROL", 0xFFFFFFFE) == OKAY
        if not order:
            await shell.expect(**counts(expected(waveforms, other)), CONTROL=0, STATUS=0, IRQ_STATUS=3)
            assert shell.dut.irq.value == 1
        await shell.set("CONTROL", 1)
        await shell.expect(**reset_values(config) | kept)
        assert shell.dut.irq.value == 0
    shell.send(waveforms)
    equal(await shell.take(3), expected(waveforms, other))


@shell_test
async def soft_reset_waits_for_records_that_the_sink_does_not_take_and_for_the_end_of_a_waveform(shell: Shell) -> None:
    config = shell.config
    waveforms = busy(config, shell.rng, 3)
    shell.send(waveforms[:1])
    shell.sink.pause = True
    await shell.wait_for(len(waveforms[0]))
    await shell.set("CONTROL", 1)
    await shell.set("N", 0x37)
    shell.send(waveforms[1:])
    await ClockCycles(shell.dut.aclk, 1000)
    await shell.expect(CONTROL=1, STATUS=BUSY | CHANGE_WAITS | RESET_WAITS)
    assert shell.begun == 1
    shell.sink.pause = False
    other = changed(config, {"N": 0x37})
    wanted = np.concatenate((expected(waveforms[:1], config), expected(waveforms[1:], other)))
    equal(await shell.take(3), wanted)
    # A source that pauses inside a waveform.
    shell.send(waveforms[:1])
    await shell.wait_for(sum(map(len, waveforms)) + 50)
    shell.source.pause = True
    await shell.set("CONTROL", 1)
    await ClockCycles(shell.dut.aclk, 1000)
    await shell.expect(CONTROL=1, STATUS=BUSY | RESET_WAITS)
    shell.source.pause = False
    equal(await shell.take(1), expected(waveforms[:1], other, 2))
    await shell.expect(CONTROL=0, STATUS=0, WAVEFORMS=0)


@shell_test
async def soft_resets_at_any_time_lose_no_waveform(shell: Shell) -> None:
    config = shell.config
    for attempt in range(24):
        await shell.reset()
        waveforms = [samples[: 1 + 31 * k] for k, samples in enumerate(busy(config, shell.rng, 7))]
        shell.pause(samples=attempt % 3 == 1, records=attempt % 3 == 2)
        shell.send(waveforms)
        await shell.wait_for(int(shell.rng.integers(1, sum(map(len, waveforms[:-1])))))
        earliest = shell.begun
        await shell.set("CONTROL", 1)
        latest = shell.begun
        records = await shell.take(len(waveforms))
        possible = {
            at: np.concatenate((expected(waveforms[:at], config), expected(waveforms[at:], config)))
            for at in range(earliest, latest + 1)
        }
        found = [at for at, wanted in possible.items() if np.array_equal(records, wanted)]
        assert found, f"attempt {attempt}: not between waveforms {earliest} and {latest}"
        rest = waveforms[found[0] :]
        await shell.expect(**counts(expected(rest, config)), CONTROL=0, STATUS=0)


@shell_test
async def aresetn_inside_a_waveform_starts_afresh(shell: Shell) -> None:
    config = shell.config
    for attempt in range(8):
        await shell.configure(changed(config, others(config)[-1]))
        await shell.set("IRQ_MASK", 3)
        waveforms = [np.ones(2, np.uint16), *busy(config, shell.rng, 3)]
        shell.pause(samples=attempt % 2 == 1, records=attempt % 4 >= 2)
        shell.send(waveforms)
        await shell.wait_for(int(shell.rng.integers(1, sum(map(len, waveforms)))))
        if attempt % 4 == 1:
            await shell.set("CONTROL", 1)
        if attempt % 4 == 3:
            await shell.set("N", 0x44)
        shell.pause()
        await shell.reset()
        await shell.expect(**reset_values(config))
        assert shell.dut.irq.value == 0
        shell.send(waveforms)
        equal(await shell.take(len(waveforms)), expected(waveforms, config))
        assert increasing(shell.samples_in.taken)
        await shell.reset()


@shell_test
async def waveforms_too_short_and_too_long_are_flagged_and_counted(shell: Shell) -> None:
    waveforms = difficult(shell)
    wanted = expected(waveforms, shell.config)
    flagged = counts(wanted)
    assert flagged["ERRORS"] == 9
    for paused in (False, True):
        await shell.reset()
        shell.pause(samples=paused, records=paused)
        shell.send(waveforms)
        equal(await shell.take(len(waveforms)), wanted)
        await shell.expect(**flagged, ERROR_CAUSE=TOO_SHORT | TOO_LONG, IRQ_STATUS=3, STALLS=shell.samples_in.stalls)


@shell_test
async def each_cause_of_an_error_is_told_and_cleared_by_itself(shell: Shell) -> None:
    config = shell.config
    fine = busy(config, shell.rng, 1)
    full = (1 << config.sample_w) - 1
    beyond = [samples.copy() for samples in fine]
    causes: dict[int, list[Samples]] = {
        TOO_SHORT: [np.ones(1, np.uint16)],
        TOO_LONG: [np.ones(config.max_samples + 1, np.uint16)],
    }
    if config.sample_w < 16:
        beyond[0][[3, 100, 101]] = [full + 1, 0xFFFF, 0x8000]
        causes[SAMPLE] = beyond
    errors = 0
    for sequence, (cause, waveforms) in enumerate(causes.items()):
        shell.send(waveforms)
        equal(await shell.take(1), expected(waveforms, config, sequence))
        errors += 3 if cause == SAMPLE else 1
        await shell.expect(ERROR_CAUSE=cause, ERRORS=errors, IRQ_STATUS=3)
        for strobe, value in ((0xE, 0xFFFFFFFF), (0xF, 0xFFFFFFFF & ~cause)):
            assert await shell.write("ERROR_CAUSE", value, strobe) == OKAY
            await shell.expect(ERROR_CAUSE=cause)
        await shell.set("ERROR_CAUSE", cause)
        await shell.expect(ERROR_CAUSE=0, ERRORS=errors)
    assert await shell.write("N", 0xF) == SLVERR
    await shell.expect(ERROR_CAUSE=SETTING, ERRORS=errors + 1)


@shell_test
async def samples_beyond_full_scale_are_taken_as_full_scale(shell: Shell) -> None:
    config = shell.config
    waveforms = busy(config, shell.rng)
    for bit in range(config.sample_w, 16):
        waveforms[1][shell.rng.integers(0, len(waveforms[1]))] |= 1 << bit
    beyond = sum(int(np.count_nonzero(samples >> config.sample_w)) for samples in waveforms)
    assert bool(beyond) == (config.sample_w < 16)
    shell.pause(samples=True, records=True)
    shell.send(waveforms)
    equal(await shell.take(len(waveforms)), expected(waveforms, config))
    await shell.expect(ERRORS=beyond, ERROR_CAUSE=SAMPLE if beyond else 0)


@shell_test
async def errors_of_several_causes_in_one_cycle_all_count(shell: Shell) -> None:
    # Every sample is beyond full scale, most waveforms are too short, and settings are illegal all the time.
    config = shell.config
    waveforms = [np.full(shell.rng.integers(1, 10), 0xFFFF, np.uint16) for _ in range(200)]
    shell.pause(samples=True)
    shell.send(waveforms)
    written = 0
    while len(shell.records_out.ends) < len(waveforms):
        assert await shell.write("K", 0x100, order=0) == SLVERR
        written += 1
    equal(await shell.take(len(waveforms)), expected(waveforms, config))
    samples = sum(map(len, waveforms)) if config.sample_w < 16 else 0
    assert set(shell.samples_in.taken) & set(shell.records_out.ends), "no two errors came together"
    short = counts(expected(waveforms, config))["ERRORS"]
    await shell.expect(ERRORS=short + samples + written)


@shell_test
async def flags_of_echoes_are_no_errors(shell: Shell) -> None:
    # One echo beyond full scale, and one cut by the end, which have the flags that in a trailer are errors.
    config = shell.config
    values = {"MIN_INTERVAL": 0, "K": 0}
    for name, value in values.items():
        await shell.set(name, value)
    x = np.arange(300)
    full = (1 << config.sample_w) - 1
    height = full * np.exp(-0.5 * ((x[:, None] - [150, 299 - config.tap_count // 2]) / 10) ** 2) @ [2, 0.5]
    waveforms = [np.minimum(height, full).astype(np.uint16)]
    shell.send(waveforms)
    records = await shell.take(1)
    equal(records, expected(waveforms, changed(config, values)))
    assert np.bitwise_or.reduce(records[:-1, 0]) & 3 == 3
    await shell.expect(ERRORS=0, ERROR_CAUSE=0, IRQ_STATUS=WAVEFORM_IRQ)


@shell_test
async def interrupts_are_raised_masked_and_cleared(shell: Shell) -> None:
    config, irq = shell.config, shell.dut.irq
    fine, wrong = busy(config, shell.rng, 1), [np.ones(1, np.uint16)]
    for mask in range(4):
        for waveforms, status in ((fine, WAVEFORM_IRQ), (wrong, WAVEFORM_IRQ | ERROR_IRQ)):
            await shell.reset()
            await shell.set("IRQ_MASK", mask)
            assert irq.value == 0
            shell.send(waveforms)
            await shell.take(1)
            await shell.expect(IRQ_STATUS=status)
            assert irq.value == int(bool(mask & status))
            # Another mask, and back.
            await shell.set("IRQ_MASK", mask ^ 3)
            await ClockCycles(shell.dut.aclk, 2)
            assert irq.value == int(bool((mask ^ 3) & status))
            await shell.set("IRQ_MASK", mask)
            # Zeros and bytes without a strobe clear nothing, ones clear each bit by itself.
            await shell.set("IRQ_STATUS", 0)
            assert await shell.write("IRQ_STATUS", 3, strobe=0xE) == OKAY
            await shell.expect(IRQ_STATUS=status)
            for bit in (WAVEFORM_IRQ, ERROR_IRQ):
                await shell.set("IRQ_STATUS", bit)
                status &= ~bit
                await shell.expect(IRQ_STATUS=status)
                assert irq.value == int(bool(mask & status))
    await shell.set("IRQ_MASK", ERROR_IRQ)
    assert await shell.write("K", 0x100) == SLVERR
    await ClockCycles(shell.dut.aclk, 2)
    assert irq.value == 1
    await shell.expect(IRQ_STATUS=ERROR_IRQ)


@shell_test
async def an_event_is_not_lost_to_a_clear_at_the_same_time(shell: Shell) -> None:
    # Waveforms of one sample end often; while the status is cleared all the time, each must still raise the interrupt.
    count = 60
    await shell.set("IRQ_MASK", WAVEFORM_IRQ)
    shell.pause(samples=True)
    shell.send([np.ones(1, np.uint16)] * count)
    cleared = 0
    while len(shell.records_out.ends) < count:
        await shell.write("IRQ_STATUS", WAVEFORM_IRQ, order=0)
        cleared += 1
    await shell.take(count)
    ends, irqs = shell.records_out.ends, set(shell.irqs)
    assert cleared > 10
    late = [end for end in ends if not {end + 1, end + 2, end + 3} & irqs]
    assert not late, f"{len(late)} of {count} waveforms raised no interrupt"
    await shell.expect(WAVEFORMS=count, ERRORS=count)


@shell_test
async def many_short_waveforms_wait_in_the_core_and_changes_and_resets_wait_for_them(shell: Shell) -> None:
    config = shell.config
    other = changed(config, {"N": 0x30})
    for reset in (False, True):
        await shell.reset()
        waveforms = [np.full(1 + k % 3, 7, np.uint16) for k in range(300)]
        shell.sink.pause = True
        shell.send(waveforms)
        await ClockCycles(shell.dut.aclk, 1000)
        begun = shell.begun
        assert 8 < begun < 128, f"{begun} waveforms in the core"
        await (shell.set("CONTROL", 1) if reset else shell.set("N", 0x30))
        await shell.expect(STATUS=BUSY | (RESET_WAITS if reset else CHANGE_WAITS))
        last = busy(config, shell.rng, 2)
        shell.send(last)
        # One record at a time, with a look at what waits in between.
        while len(shell.records_out.ends) < begun:
            assert await shell.read("STATUS") & (RESET_WAITS | CHANGE_WAITS)
            assert shell.begun == begun
            shell.sink.pause = False
            await RisingEdge(shell.dut.aclk)
            shell.sink.pause = True
            await ClockCycles(shell.dut.aclk, 2)
        shell.sink.pause = False
        records = await shell.take(len(waveforms) + 2)
        rest = [*waveforms[begun:], *last]
        wanted = expected(rest, config) if reset else expected(rest, other, begun)
        equal(records, np.concatenate((expected(waveforms[:begun], config), wanted)))
        await shell.expect(**counts(wanted if reset else records), STATUS=0)


@shell_test
async def a_waveform_without_noise_figures_is_no_error(shell: Shell) -> None:
    waveforms = [np.full(max(NOISE_SAMPLES - 1, shell.config.tap_count + 2), 9, np.uint16)]
    shell.send(waveforms)
    records = await shell.take(1)
    equal(records, expected(waveforms, shell.config))
    await shell.expect(ERRORS=0, ERROR_CAUSE=0, IRQ_STATUS=WAVEFORM_IRQ)
