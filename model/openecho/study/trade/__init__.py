"""What speed costs: every way to decompose that there is, on the same waveforms, with what each takes.

`ways` is the table of what is compared, `sets` that of what on; `accuracy` scores one on the other, `cost` says what a
way takes of hardware and of time, `advice` draws the conclusions, `page` and `picture` show them. `scripts/ways.py`
measures the hardware first.
"""
