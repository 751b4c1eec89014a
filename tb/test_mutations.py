"""The list of faults for `make mutate` stays in step with the RTL."""

from __future__ import annotations

from openecho.hardware import bench_names
from scripts import mutate


def test_every_fault_still_changes_one_line_and_every_bench_has_some() -> None:
    listed = mutate.mutations()
    assert len(listed) == len({(mutation.file, mutation.line, mutation.becomes) for mutation in listed})
    assert all(mutation.line != mutation.becomes for mutation in listed)
    assert {mutation.bench for mutation in listed} == set(bench_names())
