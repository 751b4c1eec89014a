"""The reference sets are what the paper's experiment asks for, and their truth is true."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from openecho import stimulus

Make = Callable[[int], stimulus.Stimulus]


@pytest.mark.parametrize(
    ("make", "length", "counts"),
    [(stimulus.land, 1024, {3, 4, 5, 6}), (stimulus.ocean, 528, {1, 2})],
)
def test_sets_have_the_papers_shape_and_echo_counts(make: Make, length: int, counts: set[int]) -> None:
    made = make(3)
    assert made.samples.shape == (20, length)
    assert set(made.length) == {length}
    assert set(np.bincount(made.truth["waveform"], minlength=20)) == counts
    assert made.samples.max() < 2**stimulus.SAMPLE_W


@pytest.mark.parametrize("make", [stimulus.land, stimulus.ocean, stimulus.reference_set])
def test_a_seed_gives_the_same_set_and_another_seed_another(make: Make) -> None:
    first, again, other = make(1), make(1), make(2)
    np.testing.assert_array_equal(first.samples, again.samples)
    np.testing.assert_array_equal(first.truth, again.truth)
    assert (first.samples != other.samples).any()


def test_truth_leaves_only_baseline_and_noise() -> None:
    made = stimulus.reference_set(0)
    for row, length in enumerate(made.length):
        echoes = made.truth[made.truth["waveform"] == row]
        clean = stimulus.gaussians(length, echoes)
        rest = made.samples[row, :length] - clean
        assert 14 < rest.mean() < 31
        assert 0.8 < rest.std() < 1.3
        assert np.abs(rest - rest.mean()).max() < 7


def test_padding_is_zero_and_lengths_say_where_it_starts() -> None:
    made = stimulus.reference_set(0)
    assert made.samples.shape == (40, 1024)
    assert not made.samples[20:, 528:].any()
    assert list(made.length) == [1024] * 20 + [528] * 20


@pytest.mark.parametrize("sample_w", [8, 11, 16])
@pytest.mark.parametrize(("length", "tap_count"), [(22, 20), (1024, 20), (1024, 48)])
def test_directed_shapes_fit_the_samples_and_the_length(sample_w: int, length: int, tap_count: int) -> None:
    shapes = dict(stimulus.directed(sample_w, length, tap_count))
    for shape in shapes.values():
        assert shape.dtype == np.uint16
        assert shape.shape == (length,)
        assert shape.max() < 2**sample_w
    full = 2**sample_w - 1
    assert not shapes["all_zero"].any()
    assert (shapes["full_scale_flat"] == full).all()
    assert (np.abs(np.diff(shapes["alternating"].astype(int))) == full).all()
    assert np.count_nonzero(shapes["impulse"]) == 1
    assert np.count_nonzero(shapes["saturated"] == full) > 5
    if length == 1024:
        assert {f"echoes_{n}" for n in (1, 2, 8, 16, 17)} <= set(shapes)
