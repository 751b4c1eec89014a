"""The description of a scene: what is read out of it, and one line with file and key for whatever can't be used."""

from __future__ import annotations

import copy
import math
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import hypothesis
import numpy as np
import pytest
import yaml
from hypothesis import strategies as st
from pydantic import BaseModel

from openecho.scene import schema
from openecho.scene.schema import (
    AnyTarget,
    Measured,
    Plane,
    Scene,
    SceneError,
    Shaped,
    Stand,
    Tree,
    bundled,
    described,
    dumped,
    json_schema,
    load,
    loads,
)
from openecho.scene.units import (
    ANGLE,
    AREA_DENSITY,
    COUNTS,
    GAIN,
    IRRADIANCE,
    LENGTH,
    MOST,
    RATE,
    RATIO,
    TEMPERATURE,
    TURBULENCE,
    Dimension,
    in_si,
    to_si,
)
from tests.fuzz import damage, fuzzed

SCENES = {path.stem: path.read_text() for path in schema.bundled_files().values()}
HERE = Path("a.yaml")

REFLECTANCE = {"reflectance": {"albedo": 0.3}}
TREE = {
    "kind": "tree",
    "position": ["0 m", "0 m", "0 m"],
    "height": "20 m",
    "crown": "cone",
    "crown_width": "6 m",
    "crown_base": "5 m",
    "leaf_area_density": "0.5 m^2/m^3",
    **REFLECTANCE,
}
SEA = {"kind": "sea", "wind": "8 m/s", **REFLECTANCE}
RELIEF = {"deviation": "2 m", "correlation_length": "50 m", "roughness": 0.2, "cell": "1 m", "size": ["9 m", "9 m"]}
TERRAIN = {"kind": "terrain", "relief": RELIEF, **REFLECTANCE}
ROOFS = {
    "kind": "roofs",
    "size": ["300 m", "300 m"],
    "house": ["14 m", "10 m"],
    "street": "8 m",
    "heights": ["6 m", "18 m"],
    **REFLECTANCE,
}


def plain(name: str = "ice") -> dict[str, Any]:
    """A bundled scene as plain data."""
    data: dict[str, Any] = yaml.safe_load(SCENES[name])
    return data


def changed(key: str, value: Any, *targets: dict[str, Any]) -> str:
    """YAML of the scene `ice`, perhaps with other targets, with one key set; ``...`` takes it away."""
    data = plain()
    if targets:
        data["targets"] = [copy.deepcopy(target) for target in targets]
    here: Any = data
    *parts, last = (int(part) if part.isdigit() else part for part in key.split("."))
    for part in parts:
        here = here[part]
    if value is ...:
        del here[last]
    else:
        here[last] = value
    return yaml.safe_dump(data)


def refusal(text: str, path: Path = HERE) -> str:
    """What is said of a scene that can't be used, without the file's name in front: a single short line."""
    with pytest.raises(SceneError) as caught:
        loads(text, path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert line.isprintable()
    assert len(line) < 600
    return line.removeprefix(f"{path}: ")


def test_every_bundled_scene_loads_by_name_and_says_what_it_shows() -> None:
    assert list(bundled()) == ["forest", "ice", "mountain", "roofs", "savanna", "sea", "slope", "terraces", "woodland"]
    for name, description in bundled().items():
        assert load(name).description == description
        assert 20 < len(description) < 100


def test_the_mountain_is_the_papers_experiment() -> None:
    scene = load("mountain")
    assert (scene.platform.altitude, scene.beams, scene.digitiser.channels) == (1000, 64, 64)
    assert scene.digitiser.rate == 1e9
    scan = scene.platform.scan
    assert isinstance(scan, schema.Raster)
    outermost = (scan.columns - 1) / 2 * scan.spacing
    assert 2 * scene.platform.altitude * math.tan(outermost) == pytest.approx(600, rel=0.01)


@pytest.mark.parametrize("name", SCENES)
def test_a_bundled_scene_holds_its_echoes_without_clipping(name: str) -> None:
    """Peak power of a flat target of the ground's reflectance, straight below: pulse, range, aperture and optics."""
    scene = load(name)
    receiver, digitiser, pulse = scene.receiver, scene.digitiser, scene.laser.pulse
    assert isinstance(pulse, Shaped)
    peak = scene.laser.energy * 0.919 / pulse.fwhm  # (t/τ)² exp(-t/τ) of unit area at 2τ, FWHM 3.3947 τ
    ground = scene.targets[0].reflectance
    share = (
        (ground.albedo / math.pi + ground.specular) * math.pi / 4 * (receiver.aperture / scene.platform.altitude) ** 2
    )
    counts = peak * share * receiver.optics_efficiency * digitiser.gain
    assert 300 < counts < 2**digitiser.bits - 1 - digitiser.offset


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_that_is_dumped_and_loaded_is_the_same(name: str, tmp_path: Path) -> None:
    scene = load(name)
    (tmp_path / "again.yaml").write_text(dumped(scene))
    assert load(tmp_path / "again.yaml") == scene


def test_targets_pulse_and_scan_of_every_kind_survive_a_dump(tmp_path: Path) -> None:
    for name in ("dem.npy", "tx.npy", "a.stl", "dem.tif"):
        (tmp_path / name).touch()
    data = plain()
    data["laser"]["pulse"] = {"shape": "measured", "file": "tx.npy", "interval": "0.5 ns"}
    data["platform"]["scan"] = {"kind": "zigzag", "half_angle": "20 deg", "rate": "40 Hz"}
    data["platform"]["attitude"] = {"roll": "1 deg", "pitch": "-2 deg"}
    data["speckle"] = 8
    grid = {"file": "dem.npy", "cell": "1 m", "corner": ["5 km", "7 km"]}
    data["targets"] = [
        {"kind": "plane", "slope": "30 deg", "size": ["3 m", "4 m"], "reflectance": {"albedo": 0.1}},
        {"kind": "terraces", "steps": 3, "rise": "1 m", "run": "2 m", "width": "30 m", **REFLECTANCE},
        {"kind": "sphere", "position": ["1 m", "2 m", "3 m"], "radius": "1 m", **REFLECTANCE},
        {**SEA, "reflectance": {"albedo": 0, "specular": 0.04}},
        TERRAIN,
        {"kind": "terrain", "map": grid, **REFLECTANCE},
        {"kind": "terrain", "map": {"file": "dem.tif"}, **REFLECTANCE},
        ROOFS,
        {"kind": "mesh", "file": "a.stl", "rotation": ["0 deg", "90 deg", "0 deg"], "scale": 0.001, **REFLECTANCE},
        {"kind": "mesh", "file": "a.stl", "sheet": True, **REFLECTANCE},
        TREE,
        yaml.safe_load(SCENES["forest"])["targets"][1],
    ]
    (tmp_path / "all.yaml").write_text(yaml.safe_dump(data))
    scene = load(tmp_path / "all.yaml")
    assert {type(target) for target in scene.targets} == set(get_args(get_args(AnyTarget)[0]))
    assert isinstance(scene.laser.pulse, Measured)
    assert scene.laser.pulse.file == tmp_path / "tx.npy"
    assert loads(dumped(scene), Path("/elsewhere/b.yaml")) == scene


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("300 m", LENGTH, 300.0),
        ("1064 nm", LENGTH, 1.064e-6),
        ("-1.5e2 km", LENGTH, -150e3),
        ("3 deg", ANGLE, math.radians(3)),
        ("3°", ANGLE, math.radians(3)),
        ("0.3mrad", ANGLE, 0.0003),
        ("1 GS/s", RATE, 1e9),
        ("250 kHz", RATE, 250e3),
        ("2 counts/nW", GAIN, 2e9),
        ("200 counts", COUNTS, 200.0),
        ("30 %", RATIO, 0.3),
        ("1e-3", RATIO, 0.001),
        (7, RATIO, 7.0),
        ("10 dB", RATIO, 10.0),
        ("20 degC", TEMPERATURE, 293.15),
        ("400 /ha", AREA_DENSITY, 0.04),
        ("0.65 W/m^2/nm", IRRADIANCE, 0.65e9),
        ("0.65 W/m²/nm", IRRADIANCE, 0.65e9),
        ("1e-14 m^(-2/3)", TURBULENCE, 1e-14),
    ],
)
def test_a_quantity_is_converted_to_si(text: Any, dimension: Dimension, value: float) -> None:
    assert to_si(text, dimension) == pytest.approx(value, rel=2e-15)


@hypothesis.given(
    value=st.floats(-MOST, MOST).filter(lambda value: value == 0 or abs(value) >= 1 / MOST),
    dimension=st.sampled_from([LENGTH, ANGLE, RATE, COUNTS, GAIN, RATIO, TEMPERATURE, IRRADIANCE, TURBULENCE]),
)
@hypothesis.settings(fuzzed, max_examples=300)
def test_no_bit_is_lost_in_si(value: float, dimension: Dimension) -> None:
    assert to_si(in_si(value, dimension), dimension) == value


@pytest.mark.parametrize(
    "text",
    [
        *(
            "300 ns",
            "300",
            300,
            "m",
            "300 m 5",
            "300 furlongs_",
            "nan m",
            "inf m",
            "1e999 m",
            "1e31 m",
            "1e-31 m",
            "9**9**9 m",
            "300 m²",
        ),
        *("1 m^(1/0)", "5 dB/m", "300 m; import os", "__import__('os')", None, True, [1], {"m": 1}, "", "1" * 99),
    ],
)
def test_what_is_no_length_is_refused(text: Any) -> None:
    with pytest.raises(ValueError, match=r"^found .*, expected a length, as 300 m$"):
        to_si(text, LENGTH)


@pytest.mark.parametrize(
    ("key", "value", "line"),
    [
        ("platform.altitude", "300 ns", "platform.altitude: found 300 ns, expected a length, as 300 m"),
        ("platform.altitude", 300, "platform.altitude: found 300, expected a length, as 300 m"),
        ("platform.altitude", math.nan, "platform.altitude: found nan, expected a length, as 300 m"),
        ("platform.altitude", ".inf m", "platform.altitude: found .inf m, expected a length, as 300 m"),
        ("platform.altitude", "-5 m", "platform.altitude: found -5 m, expected a length above 0 m"),
        ("platform.altitude", ..., "platform.altitude: found nothing, expected it"),
        ("platform.altitud", "300 m", "platform.altitud: found an unknown key, expected altitude"),
        ("platform", 5, "platform: found 5, expected a mapping"),
        ("platform.start", ["0 m"], "platform.start[1]: found nothing, expected it"),
        ("platform.start", "0 m", "platform.start: found 0 m, expected a list"),
        ("platform.start", ["0 m", "5"], "platform.start[1]: found 5, expected a length, as 300 m"),
        ("platform.scan.kind", "spiral", "platform.scan.kind: found spiral, expected line, zigzag, raster"),
        ("platform.scan.rate", "5 deg", "platform.scan.rate: found 5 deg, expected a rate, as 1 GHz"),
        ("laser.pulse", {"shape": "laser"}, "laser.pulse.fwhm: found nothing, expected it"),
        ("laser.pulse", {"fwhm": "5 ns"}, "laser.pulse.shape: found nothing, expected it"),
        ("digitiser.bits", 17, "digitiser.bits: found 17, expected a whole number from 8 to 16"),
        ("digitiser.bits", True, "digitiser.bits: found true, expected a whole number from 8 to 16"),
        ("digitiser.offset", "5000 counts", "digitiser.offset: found 5000 counts, expected 0 to 2047 for its bits"),
        ("digitiser.gain", "2 counts", "digitiser.gain: found 2 counts, expected counts per power, as 2 counts/nW"),
        (
            "receiver.responsivity",
            "0.3 A/W",
            "receiver.quantum_efficiency: found it and responsivity, expected one of them",
        ),
        (
            "receiver.quantum_efficiency",
            ...,
            "receiver.quantum_efficiency: found neither it nor responsivity, expected one of them",
        ),
        (
            "receiver.optics_efficiency",
            "120 %",
            "receiver.optics_efficiency: found 120 %, expected a number from 0 to 1",
        ),
        ("receiver.filter_width", ..., "receiver.filter_width: found nothing, expected it for the background light"),
        ("speckle", 0.5, "speckle: found 0.5, expected on, off or a number from 1"),
        ("speckle", "maybe", "speckle: found maybe, expected on, off or a number from 1"),
        (
            "tolerance",
            {"counts": "0 counts", "noise": 0},
            "tolerance.counts: found 0 counts and no share of the noise, expected one of them above 0",
        ),
        ("shots", 0, "shots: found 0, expected a whole number from 1 to 1000000000"),
        ("shots", 10**99, "shots: found a number of more than 60 digits, expected a whole number from 1 to 1000000000"),
        ("seed", "7", "seed: found 7, expected a whole number from 0 to 4294967295"),
        ("description", "two\nlines", "description: found several lines, expected one"),
        ("targets", {}, "targets: found a mapping, expected a list"),
        ("targets", [5], "targets[0]: found 5, expected a mapping"),
        ("targets.0.kind", ..., "targets[0].kind: found nothing, expected it"),
        ("targets.0.reflectance.albedo", -1, "targets[0].reflectance.albedo: found -1, expected a number from 0 to 1"),
        (
            "targets.0.reflectance.specular",
            0.1,
            "targets[0].reflectance.facet_slope: found nothing, expected it for the specular part",
        ),
        ("targets.0.slope", "90 deg", "targets[0].slope: found 90 deg, expected an angle from 0 deg to 89 deg"),
    ],
)
def test_a_wrong_key_is_one_line(key: str, value: Any, line: str) -> None:
    assert refusal(changed(key, value)) == line


@pytest.mark.parametrize(
    ("target", "key", "value", "line"),
    [
        (TREE, "crown_base", "20 m", "crown_base: found 20 m, expected less than the height, 20 m"),
        (TREE, "crown", "cube", "crown: found cube, expected ellipsoid, cone or cylinder"),
        (TREE, "hight", "9 m", "hight: found an unknown key, expected height"),
        (TREE, "position", ["0 m"] * 4, "position: found 4 values, expected 3"),
        (
            SEA,
            "reflectance.facet_slope",
            0.2,
            "reflectance.facet_slope: found one, expected none: the wind tells it",
        ),
        (TERRAIN, "relief", ..., "map: found neither it nor relief, expected one of them"),
        (TERRAIN, "relief", {**RELIEF, "cell": "20 m"}, "relief.cell: found 20 m, expected at most the size, 9 m"),
        (TERRAIN, "map", {"file": "/none.tif"}, "map.file: found no file /none.tif, expected one"),
        (TERRAIN, "map", {"file": "a.jpg"}, "map.file: found a.jpg, expected a file (.tif, .tiff, .asc, .npy)"),
        (TERRAIN, "map", {"file": "a\0.tif"}, "map.file: found no file "),
        (ROOFS, "heights", ["9 m", "6 m"], "heights: found 9 m and 6 m, expected the least first"),
    ],
)
def test_a_wrong_target_is_one_line(target: dict[str, Any], key: str, value: Any, line: str) -> None:
    assert refusal(changed(f"targets.1.{key}", value, ROOFS, target)).startswith(f"targets[1].{line}")


def test_a_height_map_without_a_transform_is_one_line(tmp_path: Path) -> None:
    np.save(tmp_path / "dem.npy", np.zeros((3, 3)))
    (tmp_path / "dem.tif").touch()
    bare = {"file": "dem.npy", "cell": "1 m"}
    target = {"kind": "terrain", "map": bare, **REFLECTANCE}
    expected = "targets[0].map.corner: found no transform, expected cell and corner for .npy"
    assert refusal(changed("seed", 1, target), tmp_path / "a.yaml") == expected
    target = {**target, "map": {"file": "dem.tif", "cell": "1 m"}}
    expected = "targets[0].map.cell: found one, expected none: .tif tells it"
    assert refusal(changed("seed", 1, target), tmp_path / "a.yaml") == expected


def test_an_array_needs_as_many_channels_as_beams() -> None:
    scan = {"kind": "raster", "rows": 8, "columns": 8, "spacing": "1 mrad"}
    assert (
        refusal(changed("platform.scan", scan))
        == "digitiser.channels: found 1, expected at least 64, the beams of a shot"
    )
    scan = {"kind": "raster", "rows": 1, "columns": 64, "spacing": "3 deg"}
    assert (
        refusal(changed("platform.scan", scan))
        == "platform.scan.spacing: found 3 deg, expected an array within 180 deg"
    )


def test_waveforms_can_be_numbered_in_32_bits() -> None:
    data = plain()
    data["platform"]["scan"] = {"kind": "raster", "rows": 64, "columns": 64, "spacing": "0.1 deg"}
    data["digitiser"]["channels"] = 2**12
    assert loads(yaml.safe_dump(data | {"shots": 2**20}), HERE).shots == 2**20
    line = "shots: found 1048577 of 4096 beams each, expected at most 1048576"
    assert refusal(yaml.safe_dump(data | {"shots": 2**20 + 1})) == line


def test_keys_that_are_changed_are_checked_as_those_of_a_file() -> None:
    for name in SCENES:
        scene = load(name)
        assert schema.changed(scene) == scene
        assert schema.changed(scene, shots=7, seed=9) == scene.model_copy(update={"shots": 7, "seed": 9})
    with pytest.raises(SceneError, match=r"^shots: found 0, expected a whole number from 1 to 1000000000$"):
        schema.changed(load("ice"), shots=0)


def test_sections_that_are_left_out_stay_out() -> None:
    data = plain()
    for key in ("atmosphere", "seed", "description"):
        del data[key]
    del data["platform"]["scan"]
    data["targets"] = []
    scene = loads(yaml.safe_dump(data), HERE)
    assert (scene.atmosphere, scene.speckle, scene.platform.scan, scene.beams, scene.targets) == (
        None,
        False,
        None,
        1,
        (),
    )


@pytest.mark.parametrize(("written", "value"), [("on", True), ("off", False), ("8", 8.0), ("1.5", 1.5)])
def test_speckle_is_on_off_or_an_order(written: str, value: object) -> None:
    speckle = loads(f"{SCENES['ice']}\nspeckle: {written}\n", HERE).speckle
    assert (speckle, type(speckle)) == (value, type(value))


@pytest.mark.parametrize(("written", "value"), [("on", True), ("off", False), ("true", True), ("false", False)])
def test_a_sheet_is_on_or_off(written: str, value: bool, tmp_path: Path) -> None:
    (tmp_path / "a.stl").touch()
    mesh = f"  - {{kind: mesh, file: a.stl, sheet: {written}, reflectance: {{albedo: 0.3}}}}\n"
    scene = re.sub(r"(?ms)^targets:.*", f"targets:\n{mesh}", SCENES["ice"])
    target = loads(scene, tmp_path / "a.yaml").targets[0]
    assert isinstance(target, schema.Mesh)
    assert target.sheet is value
    assert refusal(scene.replace(f"sheet: {written}", "sheet: 1"), tmp_path / "a.yaml") == (
        "targets[0].sheet: found 1, expected on or off"
    )


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a: 1\nb: [1, 2\nc: 3\n", r"line 3 expected ',' or '\]', but got ':', expected YAML"),
        ("a: 1\n\tb: 2\n", r"line 2 found character '\\t' that cannot start any token, expected YAML"),
        ("seed: 1\nshots: 3\nseed: 2\n", "line 3 found the key seed twice, expected YAML"),
        ("seed: 1\nlaser: {rate: 1 Hz, rate: 2 Hz}\n", "line 2 found the key rate twice, expected YAML"),
        ("a: &a {b: 1}\nc:\n  <<: *a\n", r"line 3 found a merge of mappings \(<<\), expected YAML"),
        ("a: !!python/object/apply:os.system [x]\n", "line 1 could not determine a constructor for .*, expected YAML"),
        ("? [a]\n: 1\n", "line 1 found unhashable key, expected YAML"),
        ("a: 2001-99-99\n", "month must be in 1..12, .*expected YAML"),
        ("a: " + "[" * 5000, "maximum recursion depth exceeded.*, expected YAML"),
        ("a: \0\n", "unacceptable character #x0000.*, expected YAML"),
        ("", "found nothing, expected a mapping with the keys of a scene"),
        ("- 1\n", "found a list, expected a mapping with the keys of a scene"),
        ("1: 2\n", "1: found an unknown key, expected .*"),
    ],
)
def test_what_is_no_yaml_of_a_scene_is_one_line_with_its_number(text: str, line: str) -> None:
    assert re.fullmatch(line, refusal(text)), refusal(text)


def test_aliases_within_aliases_are_refused_at_once() -> None:
    bomb = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60))
    assert refusal(bomb).startswith("a0: found an unknown key")
    for key in ("targets", "shots", "description", "speckle"):
        scene = re.sub(rf"(?ms)^{key}:.*?(?=^\w|\Z)", "", SCENES["ice"])
        within = "".join(f"  - &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60))
        assert re.match(rf"{key}(\[0\])?: found a list", refusal(f"{scene}\n{key}:\n  - &a0 [x, x]\n{within}"))


def test_a_file_that_is_no_scene_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "latin.yaml").write_bytes(b"description: \xe9\n")
    with (tmp_path / "huge.yaml").open("wb") as file:
        file.truncate(2**33)
    for name, line in {
        "latin.yaml": "byte 13 is not UTF-8",
        "huge.yaml": "more than 1048576 bytes",
        "none.yaml": "No such file or directory",
        ".": "Is a directory",
        "atlantis": "no such scene, expected a YAML file or one of forest, ice, mountain",
    }.items():
        path = tmp_path / name
        with pytest.raises(SceneError, match=r"^[^\n]+$") as caught:
            load(path)
        assert str(caught.value).startswith(f"{path}: {line}")


@pytest.mark.parametrize("name", ["", "a\0.yaml", "a\0", "a" * 999, "a" * 999 + ".yaml", "two\nlines"])
def test_a_name_that_no_file_can_have_is_one_line(name: str) -> None:
    with pytest.raises(SceneError) as caught:
        load(name)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 600


def keys(section: type[BaseModel], known: set[type[BaseModel]]) -> Iterator[tuple[type[BaseModel], str]]:
    """Every key of a section and of those within it."""
    known.add(section)
    for name, field in section.model_fields.items():
        yield section, name
        for other in schema.Section.__subclasses__() + schema.Target.__subclasses__():
            if other.__name__ in str(field.annotation) and other not in known:
                yield from keys(other, known)


def test_the_description_tells_every_key_with_its_meaning() -> None:
    text = " ".join(described().replace("#", " ").split())
    told = list(keys(Scene, set()))
    assert len(told) > 100
    for section, name in told:
        meaning = " ".join((section.model_fields[name].description or "").split())
        assert f" {name}: " in text
        assert meaning in text, (section, name)
    assert "divergence: (angle above 0 deg to 45 deg) full angle of a beam" in text
    assert "temperature: (temperature above 0 K) [293.15 K]" in text
    assert "sheet: (on or off) [off] it is open" in text
    assert max(len(line) for line in described().splitlines()) <= 120


def test_json_schema_knows_every_key_and_no_other() -> None:
    made = json_schema()
    assert set(made["properties"]) == set(Scene.model_fields)
    assert not any(part["additionalProperties"] for part in made["$defs"].values())
    assert made["$defs"]["Platform"]["properties"]["altitude"]["type"] == "string"


def test_a_scene_never_changes() -> None:
    scene = load("ice")
    with pytest.raises(ValueError, match="frozen"):
        scene.shots = 5
    assert isinstance(scene.targets[0], Plane)
    assert isinstance(load("forest").targets[1], Stand)
    assert isinstance(loads(changed("seed", 1, TREE), HERE).targets[0], Tree)


def scene_or_one_line(path: Path) -> None:
    """Read a damaged scene."""
    line = ""
    try:
        assert isinstance(load(path), Scene)
    except SceneError as error:
        line = str(error)
    assert not line or line.startswith(f"{path}: ")
    assert not line or line.isprintable()
    assert len(line) < 600


@pytest.mark.parametrize("name", ["forest", "mountain"])
def test_damaged_text_is_a_scene_or_one_line(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"

    @hypothesis.settings(fuzzed, max_examples=150)
    @hypothesis.given(content=damage(SCENES[name].encode()))
    def check(content: bytes) -> None:
        path.write_bytes(content)
        scene_or_one_line(path)

    check()


def places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Every container in a document with each of its keys or indices."""
    entries = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in list(entries):
        yield data, key
        yield from places(value)


ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.sampled_from(
        [10**400, -(10**400), math.nan, math.inf, 1e308, "1e308 km", "-0 m", "5 ns", "3 deg", "on", "", []]
    ),
    st.floats(),
    st.text(max_size=20),
    st.dictionaries(st.text(max_size=5), st.integers(), max_size=2),
    st.lists(st.sampled_from(["1 m", 1, None]), max_size=4),
    st.builds("{} {}".format, st.floats(), st.sampled_from(["m", "s", "rad", "Hz", "%", "dB", "1/m^2", "K", "J"])),
)


@fuzzed
@hypothesis.given(name=st.sampled_from(sorted(SCENES)), data=st.data())
def test_a_scene_with_an_odd_value_is_a_scene_or_one_line(tmp_path: Path, name: str, data: st.DataObject) -> None:
    document = plain(name)
    for _ in range(data.draw(st.integers(1, 2))):
        container, key = data.draw(st.sampled_from(list(places(document))))
        container[key] = data.draw(ODD)
    path = tmp_path / "a.yaml"
    path.write_text(yaml.safe_dump(document))
    scene_or_one_line(path)


@pytest.mark.parametrize(
    ("module", "package", "room"),
    [("pint", "pint", "schema"), ("pydantic", "pydantic", "schema"), ("yaml", "PyYAML", "document")],
)
def test_a_missing_package_is_one_line(module: str, package: str, room: str) -> None:
    program = f"import sys; sys.modules[{module!r}] = None; import openecho.scene.{room}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    last = done.stderr.splitlines()[-1]
    assert last == f"ModuleNotFoundError: {package} is not installed, expected it: pip install 'openecho[scene]'"
