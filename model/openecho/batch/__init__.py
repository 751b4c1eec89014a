"""Whole files in bounded memory: blocks on one process, several, or a cluster, resumed where they were interrupted."""

from openecho.batch.compress import Compression, CompressionResult, compress_file, decompress_file
from openecho.batch.decompose import Advance, Job, Result, decompose_file
from openecho.batch.distribute import DistributionError
from openecho.batch.store import StoreError

__all__ = [
    "Advance",
    "Compression",
    "CompressionResult",
    "DistributionError",
    "Job",
    "Result",
    "StoreError",
    "compress_file",
    "decompose_file",
    "decompress_file",
]
