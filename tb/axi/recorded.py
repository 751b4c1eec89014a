"""Waveforms of a file through the shell."""

from __future__ import annotations

import numpy as np

from tb.axi.shell import Shell, counts, equal, expected, shell_test, waveforms_of
from tb.env.waveforms import RARELY


@shell_test
async def waveforms_of_a_file_pass_back_to_back_and_with_pauses(shell: Shell) -> None:
    stored = np.load(shell.run.samples)
    waveforms = waveforms_of(stored["samples"], stored["length"])
    wanted = expected(waveforms, shell.config)
    for paused in (False, True):
        await shell.reset()
        shell.pause(samples=paused, records=paused)
        shell.send(waveforms)
        equal(await shell.take(len(waveforms)), wanted)
        await shell.expect(**counts(wanted), STALLS=shell.samples_in.stalls, ERROR_CAUSE=0)
        samples = sum(len(waveform) for waveform in waveforms)
        assert paused or shell.samples_in.stalls <= RARELY * samples
