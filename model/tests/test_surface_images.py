"""Images of array scans: which pixel, which echo of it, what stands there."""

from __future__ import annotations

import numpy as np
import pytest

from openecho.surface.images import scan_images
from openecho.surface.points import POINT


def points() -> np.ndarray:
    """Echoes of two shots with three beams: waveform 2 has none, 4 none with a place."""
    rows = [
        # x, y, z, intensity, width, number, count, waveform, class
        (0, 0, 30, 5, 2, 1, 3, 0, 1),
        (0, 0, 20, 9, 2, 2, 3, 0, 1),
        (0, 0, 10, 7, 2, 3, 3, 0, 2),
        (3, 0, 12, 4, 2, 1, 1, 1, 2),
        (0, 4, 13, 3, 2, 1, 1, 3, 2),
        (np.nan, np.nan, np.nan, 8, 2, 1, 1, 4, 1),
        (3, 4, 100, 6, 2, 1, 2, 5, 1),
        (3, 4, 88, 6, 2, 2, 2, 5, 2),
    ]
    return np.array(rows, POINT)


@pytest.mark.parametrize(
    ("echo", "heights"),
    [("strongest", [20, 12, 13, 100]), ("first", [30, 12, 13, 100]), ("last", [10, 12, 13, 88])],
)
def test_pixel_shows_the_chosen_echo_of_its_waveform(echo: str, heights: list[float]) -> None:
    image = scan_images(points(), (2, 3), echo=echo)["elevation"]  # type: ignore[arg-type]
    expected = np.array([[heights[0], heights[1], np.nan], [heights[2], np.nan, heights[3]]])
    assert np.array_equal(image, expected, equal_nan=True)


def test_order_of_the_points_is_of_no_account() -> None:
    forth, back = scan_images(points(), (2, 3)), scan_images(points()[::-1], (2, 3))
    assert all(np.array_equal(forth[name], back[name], equal_nan=True) for name in forth)


def test_intensity_and_number_of_echoes_are_those_of_the_pixel() -> None:
    images = scan_images(points(), (2, 3))
    nan = np.nan
    assert np.array_equal(images["intensity"], [[9, 4, nan], [3, nan, 6]], equal_nan=True)
    assert np.array_equal(images["echoes"], [[3, 1, nan], [1, nan, 2]], equal_nan=True)
    assert "range" not in images


def test_range_is_the_way_from_the_platform() -> None:
    platform = np.zeros((6, 3))
    platform[:, 2] = [20, 12, 0, 16, 0, 88]
    image = scan_images(points(), (2, 3), echo="last", platform=platform)["range"]
    assert np.array_equal(image, [[10, 3, np.nan], [5, np.nan, 5]], equal_nan=True)
    fixed = scan_images(points(), (2, 3), echo="last", platform=(0, 0, 12))["range"]
    assert fixed[0, 1] == 3


def test_waveform_beyond_the_image_is_refused() -> None:
    with pytest.raises(ValueError, match=r"waveform: found 0 to 5, expected 0 to 4"):
        scan_images(points(), (1, 5))


def test_scan_without_echoes_is_an_image_without_values() -> None:
    images = scan_images(np.zeros(0, POINT), (2, 3))
    assert all(np.isnan(image).all() for image in images.values())
