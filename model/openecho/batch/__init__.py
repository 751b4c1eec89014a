"""Whole files in bounded memory: blocks on one process, several, or a cluster, resumed where they were interrupted."""

from openecho.batch.decompose import Advance, Job, Result, decompose_file
from openecho.batch.distribute import DistributionError
from openecho.batch.store import StoreError

__all__ = ["Advance", "DistributionError", "Job", "Result", "StoreError", "decompose_file"]
