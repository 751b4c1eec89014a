"""The codec beside general compressors, on recorded waveforms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from openecho.study import compression
from openecho.study.compression import Set


@pytest.mark.parametrize("name", ["gedi_cerrado", "lvis_arctic", "lvis_tx", "neon_harvard"])
def test_prediction_is_ahead_of_general_compressors_and_near_the_entropy(name: str, recorded: Path) -> None:
    found = compression.bits_a_sample(compression.recorded(recorded / f"{name}.npz"))
    assert found["file"] < min(found["zlib 9"], found["zstd 19"])
    assert found["prediction"] <= 1.05 * found["entropy"]
    assert found["prediction"] < found["threshold"] <= found["published, best T"] <= found["published"]


def test_entropies_are_those_of_known_distributions() -> None:
    rng = np.random.default_rng(0)
    length = np.full(50, 400, np.int32)
    samples = rng.permuted(np.tile(np.arange(96, 104), (50, 50)), axis=1).astype(np.uint16)
    fair = Set("fair", samples, length, 7)
    # Eight values as often: three bits about the median; differences spread further.
    assert compression.fixed_entropy(fair) == pytest.approx(3)
    assert len(compression.residuals(fair)) == fair.count == 20_000
    still = Set("still", np.full((3, 100), 7, np.uint16), np.full(3, 100, np.int32), 3)
    assert compression.fixed_entropy(still) == 0


def test_reference_waveforms_have_a_row_each_way() -> None:
    land, ocean = compression.reference()
    assert (land.bits, ocean.bits) == (9, 9)
    found = compression.bits_a_sample(ocean)
    assert list(found) == [
        *("published", "published, best T", "threshold", "prediction", "file"),
        *("zlib 9", "zstd 19", "xz 9", "entropy", "entropy, fixed order"),
    ]
    assert found["file"] >= found["prediction"]
