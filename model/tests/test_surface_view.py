"""Pages that show surfaces: what is on them, in a real browser without a network, and files that can't be shown."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from openecho.cli import openecho
from openecho.study import surface_view
from openecho.surface import files, terrain
from openecho.surface.points import CLASSES, GROUND, HIGH, POINT, UNCLASSIFIED, Cloud
from openecho.tables.table import TableError
from tests.browser import opened

CORNER = (500_000.0, 4_500_000.0)


def hills(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Heights of the ground, m."""
    return 8 * np.sin(x / 15) * np.cos(y / 20)


def cloud(count: int = 3000) -> Cloud:
    """Ground, trees and one bird."""
    rng = np.random.default_rng(1)
    points = np.zeros(count, POINT)
    x, y = rng.uniform(0, 100, (2, count))
    tree = rng.random(count) < 0.3
    points["x"], points["y"], points["z"] = x + CORNER[0], y + CORNER[1], hills(x, y) + np.where(tree, 6, 0)
    points["class"] = np.where(tree, UNCLASSIFIED, GROUND)
    points["class"][0], points["z"][0] = HIGH, 60
    points["intensity"], points["number"], points["count"] = rng.uniform(10, 500, count), 1, 1
    return Cloud(points)


@pytest.fixture
def written(tmp_path: Path) -> dict[str, Path]:
    """Points, their grid of heights and their triangles."""
    made = cloud()
    grid = terrain.grid_of(made.places, 2.0)
    x, y = np.meshgrid(*grid.centres)
    paths = {name: tmp_path / name for name in ("points.las", "truth.tif", "mesh.ply")}
    files.write_points(paths["points.las"], made)
    files.write_grid(paths["truth.tif"], hills(x - CORNER[0], y - CORNER[1]), grid, "EPSG:32633")
    files.write_mesh(paths["mesh.ply"], made.places[made.points["class"] == GROUND])
    return paths


def looks(path: Path) -> tuple[list[str], int, float]:
    """Complaints of the browser, points that its figure has, and share of the picture's middle that is not white."""
    with opened(path) as visit:
        visit.page.wait_for_timeout(1500)
        count = visit.page.evaluate("document.getElementById('surface')._fullData[0].x.length")
        picture = np.asarray(Image.open(io.BytesIO(visit.page.screenshot())).convert("HSV"))
    middle = picture[250:850, 300:900]
    return visit.complaints, count, float((middle[:, :, 1] > 60).mean())


@pytest.mark.parametrize("name", ["points.las", "truth.tif", "mesh.ply"])
def test_page_shows_terrain_without_network_and_complaints(written: dict[str, Path], name: str, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    surface_view.write(written[name], page, truth=written["truth.tif"])
    complaints, _, coloured = looks(page)
    assert complaints == []
    assert coloured > 0.05


def test_page_without_anything_to_show_has_no_colours(written: dict[str, Path], tmp_path: Path) -> None:
    # What the test above measures is the terrain, and not the axes.
    page = tmp_path / "page.html"
    surface_view.write(written["points.las"], page, most=4)
    _, count, coloured = looks(page)
    assert count == 4
    assert coloured < 0.02


def test_menu_changes_what_colours_tell(written: dict[str, Path], tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    surface_view.write(written["points.las"], page, truth=written["truth.tif"])
    with opened(page) as visit:
        visit.page.wait_for_timeout(1000)
        marker = "document.getElementById('surface').data[0].marker"
        assert visit.page.evaluate(f"{marker}.colorbar.ticktext") == [
            CLASSES[kind] for kind in (UNCLASSIFIED, GROUND, HIGH)
        ]
        visit.page.get_by_text("class", exact=True).first.click()
        visit.page.get_by_text("error", exact=True).click()
        visit.page.wait_for_timeout(500)
        assert visit.page.evaluate(f"{marker}.colorbar.title.text") == "m off"
    assert visit.complaints == []


def test_error_is_what_points_are_off_the_truth(written: dict[str, Path]) -> None:
    shown = surface_view.DRAWN[".las"](written["points.las"], written["truth.tif"], 10_000)
    error, kinds = shown.looks["error"]["color"], cloud().points["class"]
    inside = np.isfinite(error)
    assert inside.mean() > 0.95
    ground = inside & (kinds == GROUND)
    assert abs(error[ground]).max() < 0.15  # linear between heights 2 m apart, of a curvature of 8/15²
    assert abs(error[inside & (kinds == UNCLASSIFIED)] - 6).max() < 0.15
    assert shown.looks["error"]["cmin"] == -shown.looks["error"]["cmax"]


def test_mesh_is_where_its_points_were(written: dict[str, Path]) -> None:
    corners, faces = files.read_mesh(written["mesh.ply"])
    expected = cloud().places[cloud().points["class"] == GROUND]
    assert abs(corners - expected).max() < 1e-3
    assert faces.shape[1] == 3


def test_grid_is_read_as_it_was_written(written: dict[str, Path]) -> None:
    heights, grid, wkt = files.read_grid(written["truth.tif"])
    assert grid == terrain.grid_of(cloud().places, 2.0)
    assert "UTM zone 33N" in str(wkt)
    places = cloud().places[1:]
    error = terrain.heights_at(heights, grid, places) - hills(places[:, 0] - CORNER[0], places[:, 1] - CORNER[1])
    assert np.nanmax(abs(error)) < 0.15


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("points.txt", b"x", "found suffix '.txt', expected one of .csv"),
        ("nothing.csv", b"x,y,z\n", "found 0 echoes, none with a position"),
        ("damaged.tif", b"II*\0nothing", "expected a GeoTIFF"),
        ("damaged.ply", b"ply\nformat", "expected triangles as PLY"),
        ("damaged.las", b"LASF", "expected LAS or LAZ"),
        ("missing.tif", None, "No such file"),
    ],
)
def test_what_cannot_be_shown_is_told_in_a_line(name: str, content: bytes | None, message: str, tmp_path: Path) -> None:
    source, page = tmp_path / name, tmp_path / "page.html"
    if content is not None:
        source.write_bytes(content)
    with pytest.raises((TableError, OSError)) as caught:
        surface_view.write(source, page)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not page.exists()


def test_command_writes_the_page_and_says_what_is_on_it(written: dict[str, Path], tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    found = CliRunner().invoke(openecho, ["view", str(written["points.las"]), "-o", str(page), "--most", "100"])
    assert found.exit_code == 0, found.output
    assert found.output == f"{page}: 100 of 3000 points\n"
    assert page.stat().st_size > 10**6
