"""The reference waveforms through the shell while its registers are used."""

from __future__ import annotations

import cocotb
import numpy as np

from openecho import stimulus
from tb.axi.shell import Shell, counts, equal, expected, increasing, poll, shell_test, waveforms_of
from tb.env.coverage import Samples


def reference(shell: Shell) -> list[Samples]:
    """Return the 40 reference waveforms, cut to full scale."""
    made = stimulus.reference_set(0)
    return waveforms_of(np.minimum(made.samples, (1 << shell.config.sample_w) - 1), made.length)


@shell_test
async def reference_waveforms_pass_at_a_sample_a_clock_while_registers_are_used(shell: Shell) -> None:
    waveforms = reference(shell)
    wanted = expected(waveforms, shell.config)
    shell.polling, polling = True, cocotb.start_soon(poll(shell))
    shell.send(waveforms)
    equal(await shell.take(len(waveforms)), wanted)
    shell.polling = False
    await polling
    taken = shell.samples_in.taken
    assert len(taken) == sum(map(len, waveforms))
    assert increasing(taken), "a cycle without a sample"
    await shell.expect(**counts(wanted), STALLS=0, STATUS=0, ERROR_CAUSE=0)


@shell_test
async def reference_waveforms_pass_whatever_pauses_on_whichever_bus(shell: Shell) -> None:
    waveforms = reference(shell)
    wanted = expected(waveforms, shell.config)
    shell.pause(samples=True, records=True, registers=True)
    shell.polling, polling = True, cocotb.start_soon(poll(shell))
    shell.send(waveforms)
    equal(await shell.take(len(waveforms)), wanted)
    shell.polling = False
    await polling
    shell.pause()
    await shell.expect(**counts(wanted), STALLS=shell.samples_in.stalls, STATUS=0, ERROR_CAUSE=0)
    assert shell.records_out.stalls
    assert shell.channels["s_axi_b"].stalls
    assert shell.channels["s_axi_r"].stalls
