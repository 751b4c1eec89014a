"""What a configuration accepts, and the widths that follow from it."""

from typing import Any

import numpy as np
import pytest

from openecho.golden import MAX_TAPS, PAPER_TAPS, TAP_SETS, Config, filter, gaussian_taps, second_difference
from openecho.golden.floating import Format


def test_default_widths() -> None:
    config = Config()
    assert (config.sum_w, config.first_w, config.second_w) == (24, 20, 19)
    assert (config.idx_w, config.len_w, config.pos_w, config.amp_w, config.word_w) == (12, 13, 28, 19, 32)
    assert (config.difference_w, config.value_w) == (20, 29)
    assert (config.n_raw, config.k_raw) == (32, 48)


@pytest.mark.parametrize(("max_samples", "idx_w"), [(4096, 12), (4097, 13), (65536, 16), (22, 5)])
def test_index_width_holds_the_last_index(max_samples: int, idx_w: int) -> None:
    assert Config(max_samples=max_samples).idx_w == idx_w


@pytest.mark.parametrize(("max_samples", "frac", "word_w"), [(32768, 16, 32), (65536, 16, 64), (4096, 20, 64)])
def test_words_are_wide_where_a_signed_position_needs_it(max_samples: int, frac: int, word_w: int) -> None:
    assert Config(max_samples=max_samples, frac=frac).word_w == word_w


@pytest.mark.parametrize(
    ("exp_w", "frac", "value_w", "word_w"),
    [(5, 10, 19, 32), (8, 7, 19, 32), (8, 23, 32, 32), (8, 24, 33, 64), (11, 52, 64, 64), (5, 2, 19, 32)],
)
def test_words_hold_a_float_and_the_trailers_fields(exp_w: int, frac: int, value_w: int, word_w: int) -> None:
    config = Config(exp_w=exp_w, frac=frac)
    assert config.form == Format(exp_w, frac)
    assert (config.pos_w, config.value_w, config.word_w) == (1 + exp_w + frac, value_w, word_w)


def test_integers_are_as_wide_in_any_arithmetic() -> None:
    fixed, floats = Config(), Config(exp_w=5, frac=10)
    assert fixed.form is None
    for width in ("sum_w", "first_w", "second_w", "difference_w", "idx_w", "len_w", "amp_w"):
        assert getattr(fixed, width) == getattr(floats, width), width


@pytest.mark.parametrize("taps", [PAPER_TAPS, (-32768, 32767, 32767, -32768), (-1, -2, -3, -2, -1), (1, 0, 0, 1)])
def test_widths_hold_the_worst_waveform(taps: tuple[int, ...]) -> None:
    config = Config(taps=taps, sample_w=16)
    for width, differences in ((config.sum_w, 0), (config.first_w, 1), (config.second_w, 2)):
        # Full scale wherever the tap of that sign is met: the greatest and the least sum that any waveform has.
        merged = np.array(taps)
        for _ in range(differences):
            merged = np.diff(merged, prepend=0, append=0)
        for worst in (merged[::-1] > 0, merged[::-1] < 0):
            index = np.arange(worst.size)
            beats = {"sample": 65535 * worst, "index": index, "overlong": 0 * index, "last": index == worst.size - 1}
            filtered = filter(beats, config)
            field = ("sum", "first", "second")[differences]
            value = (filtered | second_difference(filtered, config))[field][-1]
            assert -(1 << (width - 1)) <= value < 1 << (width - 1)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"sample_w": 7}, "sample_w: found 7, expected an integer from 8 to 16"),
        ({"sample_w": 17}, "sample_w: found 17, expected an integer from 8 to 16"),
        ({"sample_w": 11.5}, "sample_w: found 11.5, expected an integer from 8 to 16"),
        ({"frac": 3}, "frac: found 3, expected an integer from 4 to 24"),
        ({"frac": 25}, "frac: found 25, expected an integer from 4 to 24"),
        ({"exp_w": 4}, "exp_w: found 4, expected 0 or an integer from 5 to 11"),
        ({"exp_w": 12}, "exp_w: found 12, expected 0 or an integer from 5 to 11"),
        ({"exp_w": 8, "frac": 1}, "frac: found 1, expected an integer from 2 to 52"),
        ({"exp_w": 8, "frac": 53}, "frac: found 53, expected an integer from 2 to 52"),
        (
            {"exp_w": 5, "max_samples": 16385},
            r"exp_w: found 5, .* end at 2\^16, expected more bits for the sum of two positions of up to 2\^16",
        ),
        (
            {"exp_w": 5, "sample_w": 16},
            r"exp_w: found 5, whose numbers end at 2\^16, expected more bits for an amplitude of up to 2\^16",
        ),
        (
            {"exp_w": 5, "taps": (32767, -32768, -32768, 32767)},
            r"exp_w: found 5, .* end at 2\^16, expected more bits for the sum of two differences of up to 2\^19",
        ),
        ({"max_samples": 21}, "max_samples: found 21, expected an integer from 22 to 65536"),
        ({"max_samples": 65537}, "max_samples: found 65537, expected an integer from 22 to 65536"),
        ({"taps": (1, 2, 1)}, "number of taps: found 3, expected an integer from 4 to 48"),
        ({"taps": (1,) * 49}, "number of taps: found 49, expected an integer from 4 to 48"),
        ({"taps": (1, 2, 3, 1)}, r"taps: found \(1, 2, 3, 1\), expected a symmetric set"),
        ({"taps": (32768,) * 4}, "tap: found 32768, expected an integer from -32768 to 32767"),
        ({"taps": (0.5,) * 4}, "tap: found 0.5, expected an integer from -32768 to 32767"),
        ({"min_interval": 4096}, "min_interval: found 4096, expected an integer from 0 to 4095"),
        ({"min_amplitude": -1}, "min_amplitude: found -1, expected an integer from 0 to 2047"),
        ({"n": 16.0}, "n: found 16.0, expected a multiple of 1/16 from 0 to 15.9375"),
        ({"n": float("nan")}, "n: found nan, expected a multiple of 1/16 from 0 to 15.9375"),
        ({"k": 0.1}, "k: found 0.1, expected a multiple of 1/16 from 0 to 15.9375"),
    ],
)
def test_illegal_configurations_are_named_in_one_line(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        Config(**settings)


@pytest.mark.parametrize("name", TAP_SETS)
def test_named_tap_sets_are_accepted_and_symmetric(name: str) -> None:
    taps = Config(taps=TAP_SETS[name]).taps
    assert taps == taps[::-1]


@pytest.mark.parametrize("sigma", [2.0, 3.5, 6.5])
def test_gaussian_taps_have_the_width_that_was_asked_for(sigma: float) -> None:
    taps = np.array(gaussian_taps(sigma))
    offset = np.arange(taps.size) - (taps.size - 1) / 2
    assert taps.size == 2 * round(3.5 * sigma)
    # Cut at 3.5 σ, a Gaussian has lost 0.6 % of its variance; the taps are whole numbers.
    assert np.average(offset**2, weights=taps) == pytest.approx(sigma**2, rel=0.01)


def test_gaussian_taps_end_where_the_core_takes_no_more() -> None:
    assert len(gaussian_taps(20.0)) == MAX_TAPS
