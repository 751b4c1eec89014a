"""The ends of the counters, which no test reaches by counting: they are set close to them, inside the shell."""

from __future__ import annotations

import numpy as np
from cocotb.triggers import ClockCycles, FallingEdge

from tb.axi.shell import SLVERR, Shell, shell_test

END = 0xFFFFFFFF


@shell_test
async def counters_stop_at_all_ones(shell: Shell) -> None:
    await FallingEdge(shell.dut.aclk)
    for name in ("waveforms_q", "echoes_q", "stalls_q", "errors_q"):
        getattr(shell.dut, name).value = END - 2
    await ClockCycles(shell.dut.aclk, 1)
    await shell.expect(WAVEFORMS=END - 2, ECHOES=END - 2, STALLS=END - 2, ERRORS=END - 2)
    config = shell.config
    x = np.arange(600)
    peaks = sum(np.exp(-0.5 * ((x - centre) / 5) ** 2) for centre in (100, 200, 300, 400, 500))
    echoes = np.rint(20 + (1 << config.sample_w - 1) * peaks).astype(np.uint16)
    for _ in range(3):
        assert await shell.write("N", 0) == SLVERR
        shell.sink.pause = True
        shell.send([np.ones(1, np.uint16), *[echoes] * 6])
        await ClockCycles(shell.dut.aclk, 5000)
        shell.sink.pause = False
        await shell.take(7)
        assert shell.samples_in.stalls > 3
        await shell.expect(WAVEFORMS=END, ECHOES=END, STALLS=END, ERRORS=END)
    await shell.set("CONTROL", 1)
    await shell.expect(WAVEFORMS=0, ECHOES=0, STALLS=0, ERRORS=0)
