"""What a scene is: the instrument, the air and the targets, read from one YAML file and checked.

Every quantity is written with its unit and becomes a float in SI.
"""

from __future__ import annotations

import difflib
import math
import os
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

try:
    from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "pydantic is not installed, expected it: pip install 'openecho[scene]'", name="pydantic"
    ) from error

from openecho.formats.recording import MAX_LENGTH
from openecho.scene import units
from openecho.scene.describe import lines, summary
from openecho.scene.document import SceneError, dumps, explained, parse, read
from openecho.scene.fields import File, Flag, OnOff, Quantity, Whole, wrong
from openecho.scene.units import quoted

__all__ = ["Scene", "SceneError", "bundled", "changed", "described", "dumped", "json_schema", "load"]

CONVENTIONS = """
Every quantity is written with its unit, as 300 m. x points east, y north, z up; an azimuth is taken from north
clockwise. In parentheses is what a key takes; one with brackets may be left out, and is then what they say.

"""

LEAD = 64
"""Samples before a beam's first surface if no start of the window is given: the core takes the noise from 50."""

MOST_SHOTS = 10**9
MOST_BEAMS = 2**16
MOST_WAVEFORMS = 2**32
"""Shots times beams: an LVIS granule numbers its waveforms in 32 bits."""


Length = Annotated[float, Quantity(units.LENGTH)]
Size = Annotated[float, Quantity(units.LENGTH, 0, above=True)]
Angle = Annotated[float, Quantity(units.ANGLE)]
Share = Annotated[float, Quantity(units.RATIO, 0, 1)]
Rate = Annotated[float, Quantity(units.RATE, 0, above=True)]
Current = Annotated[float, Quantity(units.CURRENT, 0)]
Fall = Annotated[float, Quantity(units.ANGLE, 0, math.radians(89))]
"""A slope; at 90° a plane would have no heights."""
Seed = Annotated[int, Whole(0, 2**32 - 1)]
Place = tuple[Length, Length, Length]
Extent = tuple[Size, Size]


class Section(BaseModel):
    """A mapping of a scene: unknown keys are refused, and nothing changes once it is read."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _knows_its_keys(cls, data: Any) -> Any:
        known = list(cls.model_fields)
        for key in data if isinstance(data, dict) else ():
            if key not in known:
                near = difflib.get_close_matches(str(key)[: units.LONGEST], known, 1)
                raise wrong(f"found an unknown key, expected {near[0] if near else ', '.join(known)}", quoted(key))
        return data


class Line(Section):
    """A mirror that sweeps one line after another in the same direction, across the flight."""

    kind: Literal["line"]
    half_angle: Annotated[float, Quantity(units.ANGLE, 0, math.radians(89))] = Field(
        description="furthest that the beam is turned from the middle, to both sides"
    )
    rate: Rate = Field(description="lines a second")

    @property
    def beams(self) -> int:
        """Waveforms of a shot."""
        return 1


class Zigzag(Section):
    """A mirror that swings to and fro across the flight, at constant angular speed."""

    kind: Literal["zigzag"]
    half_angle: Annotated[float, Quantity(units.ANGLE, 0, math.radians(89))] = Field(
        description="furthest that the beam is turned from the middle, to both sides"
    )
    rate: Rate = Field(description="swings to and fro a second")

    @property
    def beams(self) -> int:
        """Waveforms of a shot."""
        return 1


class Raster(Section):
    """An array of beams that are all fired at every shot, as of a detector array."""

    kind: Literal["raster"]
    rows: Annotated[int, Whole(1, MOST_BEAMS)] = Field(description="beams along the flight")
    columns: Annotated[int, Whole(1, MOST_BEAMS)] = Field(description="beams across the flight")
    spacing: Annotated[float, Quantity(units.ANGLE, 0, above=True)] = Field(
        description="angle between neighbours, along and across; the array is centred on the platform's own direction"
    )

    @property
    def beams(self) -> int:
        """Waveforms of a shot."""
        return self.rows * self.columns

    @model_validator(mode="after")
    def _looks_down(self) -> Self:
        if (max(self.rows, self.columns) - 1) * self.spacing >= math.pi:
            raise wrong(f"found {math.degrees(self.spacing):g} deg, expected an array within 180 deg", "spacing")
        if self.beams > MOST_BEAMS:
            raise wrong(f"found {self.beams} beams, expected at most {MOST_BEAMS}", "rows")
        return self


class Attitude(Section):
    """How the platform is turned from straight and level flight, in the order yaw, pitch, roll."""

    roll: Angle = Field(default=0.0, description="about its length, positive: right side down")
    pitch: Angle = Field(default=0.0, description="about its width, positive: nose up")
    yaw: Angle = Field(default=0.0, description="about the vertical, positive: nose to the right")


class Platform(Section):
    """What carries the instrument: straight on at constant height and speed, the first shot from `start`."""

    altitude: Size = Field(description="height over z = 0")
    speed: Annotated[float, Quantity(units.SPEED, 0)] = Field(description="over ground; 0: it hovers")
    heading: Angle = Field(default=0.0, description="azimuth of the flight")
    start: tuple[Length, Length] = Field(default=(0.0, 0.0), description="x and y at the first shot")
    attitude: Attitude = Field(default=Attitude(), description="constant; left out: straight and level")
    scan: Annotated[Line | Zigzag | Raster, Field(discriminator="kind")] | None = Field(
        default=None, description="left out: one beam, straight down"
    )


class Shaped(Section):
    """A pulse of a known shape: ``laser`` is (t/τ)² exp(-t/τ), ``gaussian`` a normal curve."""

    shape: Literal["laser", "gaussian"]
    fwhm: Annotated[float, Quantity(units.TIME, 0, above=True)] = Field(description="full width at half maximum")


class Measured(Section):
    """A pulse as it was recorded."""

    shape: Literal["measured"]
    file: Annotated[Path, File((".npy",))] = Field(description="one pulse, in any unit of power; its area is scaled")
    interval: Annotated[float, Quantity(units.TIME, 0, above=True)] = Field(description="between its samples")


class Laser(Section):
    """What makes the pulses."""

    wavelength: Annotated[float, Quantity(units.LENGTH, 2e-7, 2e-5)] = Field(description="in vacuum")
    energy: Annotated[float, Quantity(units.ENERGY, 0, above=True)] = Field(description="of each beam's pulse")
    pulse: Annotated[Shaped | Measured, Field(discriminator="shape")] = Field(description="power over time")
    divergence: Annotated[float, Quantity(units.ANGLE, 0, math.radians(45), above=True)] = Field(
        description="full angle of a beam, to 1/e² of the irradiance on its axis; the footprint's width over the range"
    )
    rate: Rate = Field(description="shots a second")


class Receiver(Section):
    """Telescope, detector and amplifier; noise that is left out is not there."""

    aperture: Size = Field(description="diameter of the telescope")
    optics_efficiency: Share = Field(description="share of the light that comes from the aperture to the detector")
    field_of_view: Annotated[float, Quantity(units.ANGLE, 0, math.radians(45), above=True)] = Field(
        description="full angle that the detector of one beam sees"
    )
    filter_width: Size | None = Field(
        default=None, description="of the optical filter, in wavelength; for background light"
    )
    quantum_efficiency: Annotated[float, Quantity(units.RATIO, 0, 1, above=True)] | None = Field(
        default=None, description="electrons of a photon, before the gain; this or the responsivity"
    )
    responsivity: Annotated[float, Quantity(units.RESPONSIVITY, 0, above=True)] | None = Field(
        default=None, description="current of a power, before the gain; this or the quantum efficiency"
    )
    gain: Annotated[float, Quantity(units.RATIO, 1)] = Field(default=1.0, description="M of the avalanche photodiode")
    ionisation_ratio: Share = Field(default=0.0, description="k of the excess noise F = k M + (1 - k) (2 - 1/M)")
    surface_dark_current: Current = Field(default=0.0, description="dark current that is not multiplied")
    bulk_dark_current: Current = Field(default=0.0, description="dark current that is multiplied, before the gain")
    load_resistance: Annotated[float, Quantity(units.RESISTANCE, 0, above=True)] | None = Field(
        default=None, description="of the amplifier; left out: no thermal noise"
    )
    noise_figure: Annotated[float, Quantity(units.RATIO, 1)] = Field(
        default=1.0, description="of the amplifier, by which thermal noise power grows; a number or dB"
    )
    temperature: Annotated[float, Quantity(units.TEMPERATURE, 0, above=True)] = Field(
        default=293.15, description="of the load resistance"
    )
    bandwidth: Rate = Field(description="of detector and amplifier, -3 dB")

    @model_validator(mode="after")
    def _detects(self) -> Self:
        if (self.quantum_efficiency is None) == (self.responsivity is None):
            found = "neither it nor responsivity" if self.responsivity is None else "it and responsivity"
            raise wrong(f"found {found}, expected one of them", "quantum_efficiency")
        return self


class Digitiser(Section):
    """From power on the detector to counts: counts = offset + gain · power, rounded, and clipped to its bits."""

    rate: Rate = Field(description="samples a second, GS/s or GHz")
    bits: Annotated[int, Whole(8, 16)] = Field(description="of a sample")
    samples: Annotated[int, Whole(1, MAX_LENGTH)] = Field(description="of a waveform")
    gain: Annotated[float, Quantity(units.GAIN, 0, above=True)] = Field(
        description="counts of the optical power on the detector"
    )
    offset: Annotated[float, Quantity(units.COUNTS, 0)] = Field(description="counts without light")
    channels: Annotated[int, Whole(1, MOST_BEAMS)] = Field(
        default=1, description="that record at once: beams of a shot, or more"
    )
    start: Annotated[float, Quantity(units.LENGTH, 0)] | None = Field(
        default=None,
        description=f"range of the first sample; left out: {LEAD} samples before the first surface that a beam meets",
    )

    @model_validator(mode="after")
    def _shows_the_offset(self) -> Self:
        if self.offset > 2**self.bits - 1:
            raise wrong(f"found {self.offset:g} counts, expected 0 to {2**self.bits - 1} for its bits", "offset")
        return self


class Atmosphere(Section):
    """The air between; what is left out has no effect."""

    visibility: Size | None = Field(default=None, description="meteorological, for the extinction after Kruse")
    cn2: Annotated[float, Quantity(units.TURBULENCE, 0)] | None = Field(
        default=None, description="structure constant of the refractive index, for beam spread and scintillation"
    )
    background: Annotated[float, Quantity(units.IRRADIANCE, 0)] | None = Field(
        default=None, description="sunlight on the ground, per wavelength; needs the receiver's filter_width"
    )


class Tolerance(Section):
    """How far a waveform may be off full fidelity, for want of rays and of effects: the greater of both."""

    counts: Annotated[float, Quantity(units.COUNTS, 0)] = Field(
        default=0.5, description="as much as rounding may change"
    )
    noise: Annotated[float, Quantity(units.RATIO, 0)] = Field(default=0.1, description="share of the noise's deviation")

    def allowed(self, variance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Counts, for noise of some variance, counts²."""
        return np.maximum(self.counts, self.noise * np.sqrt(variance))

    @model_validator(mode="after")
    def _ends(self) -> Self:
        if self.counts == 0 and self.noise == 0:
            raise wrong("found 0 counts and no share of the noise, expected one of them above 0", "counts")
        return self


class Reflectance(Section):
    """Of its surface or leaves, a steradian, at the angle θ: albedo/π · cos θ + specular · exp(-tan²θ/s²) / cos⁶θ."""

    albedo: Share = Field(description="diffuse, at the laser's wavelength")
    specular: Annotated[float, Quantity(units.RATIO, 0)] = Field(
        default=0.0, description="strength of the glint, a steradian"
    )
    facet_slope: Annotated[float, Quantity(units.RATIO, 0, above=True)] | None = Field(
        default=None, description="s, a slope as a number; for the glint, and not for a sea, whose wind tells it"
    )


class Target(Section):
    """What every target has."""

    reflectance: Reflectance
    glints_by_itself: ClassVar[bool] = False

    @model_validator(mode="after")
    def _knows_its_facets(self) -> Self:
        given, specular = self.reflectance.facet_slope is not None, self.reflectance.specular > 0
        if self.glints_by_itself and given:
            raise wrong("found one, expected none: the wind tells it", "reflectance.facet_slope")
        if specular and not given and not self.glints_by_itself:
            raise wrong("found nothing, expected it for the specular part", "reflectance.facet_slope")
        return self


class Plane(Target):
    """A plane, level or sloping, without end or a rectangle."""

    kind: Literal["plane"]
    position: Place = Field(default=(0.0, 0.0, 0.0), description="a point of it; the middle of a rectangle")
    slope: Fall = Field(default=0.0, description="angle with the level")
    azimuth: Angle = Field(default=0.0, description="direction in which it falls")
    size: Extent | None = Field(
        default=None, description="along the fall and across, on its surface; left out: without end"
    )


class Terraces(Target):
    """Level steps with upright risers, the first riser at `position`."""

    kind: Literal["terraces"]
    position: Place = Field(default=(0.0, 0.0, 0.0), description="middle of the foot of the first riser")
    azimuth: Angle = Field(default=0.0, description="direction in which they climb")
    steps: Annotated[int, Whole(1, 10000)] = Field(description="how many")
    rise: Size = Field(description="height of each")
    run: Size = Field(description="depth of each, level")
    width: Size = Field(description="across the climb")


class Sphere(Target):
    """A ball."""

    kind: Literal["sphere"]
    position: Place = Field(description="its centre")
    radius: Size = Field(description="its radius")


class Sea(Target):
    """A sea in a wind: waves of the wind's spectrum, and facets of a slope after Cox and Munk."""

    kind: Literal["sea"]
    level: Length = Field(default=0.0, description="mean height")
    wind: Annotated[float, Quantity(units.SPEED, 0, 60)] = Field(description="speed, 10 m above the water")
    direction: Angle = Field(default=0.0, description="azimuth that the wind blows to")
    seed: Seed | None = Field(default=None, description="of the waves; left out: the scene's")
    glints_by_itself: ClassVar[bool] = True


class HeightMap(Section):
    """A terrain's heights out of a file."""

    file: Annotated[Path, File((".tif", ".tiff", ".asc", ".npy"))] = Field(
        description="GeoTIFF, ASCII grid, or heights in metres (north to south, west to east)"
    )
    cell: Size | None = Field(default=None, description="side of a cell; of .npy alone, the others tell it")
    corner: tuple[Length, Length] | None = Field(
        default=None, description="x and y of the south-western corner; of .npy alone, the others tell it"
    )

    @model_validator(mode="after")
    def _has_a_transform(self) -> Self:
        bare = self.file.suffix.lower() == ".npy"
        for key, value in (("cell", self.cell), ("corner", self.corner)):
            if bare and value is None:
                raise wrong("found no transform, expected cell and corner for .npy", key)
            if not bare and value is not None:
                raise wrong(f"found one, expected none: {self.file.suffix} tells it", key)
        return self


class Relief(Section):
    """A terrain of random heights: a normal field with von Kármán's spectrum."""

    seed: Seed | None = Field(default=None, description="of the heights; left out: the scene's")
    deviation: Annotated[float, Quantity(units.LENGTH, 0)] = Field(description="standard deviation of the heights")
    correlation_length: Size = Field(description="distance over which heights stay alike")
    roughness: Annotated[float, Quantity(units.RATIO, 0, 1)] = Field(
        description="1 - Hurst exponent: 0 for smooth hills, 1 for the roughest"
    )
    cell: Size = Field(description="side of a cell")
    position: Place = Field(default=(0.0, 0.0, 0.0), description="middle, at the mean height")
    size: Extent = Field(description="along x and y")

    @model_validator(mode="after")
    def _has_cells(self) -> Self:
        if self.cell > min(self.size):
            raise wrong(f"found {self.cell:g} m, expected at most the size, {min(self.size):g} m", "cell")
        return self


class Terrain(Target):
    """A terrain: heights on a grid, from a map or at random."""

    kind: Literal["terrain"]
    map: HeightMap | None = Field(default=None, description="heights out of a file; this or relief")
    relief: Relief | None = Field(default=None, description="heights at random; this or map")

    @model_validator(mode="after")
    def _has_heights(self) -> Self:
        if (self.map is None) == (self.relief is None):
            found = "neither it nor relief" if self.map is None else "it and relief"
            raise wrong(f"found {found}, expected one of them", "map")
        return self


class Roofs(Target):
    """Houses in rows with streets between, of random heights, on level ground that another target makes."""

    kind: Literal["roofs"]
    position: Place = Field(default=(0.0, 0.0, 0.0), description="middle of the town, at the foot of the houses")
    size: Extent = Field(description="along x and y")
    house: Extent = Field(description="along x, the direction of the ridge, and y")
    street: Size = Field(description="width between houses")
    heights: tuple[Size, Size] = Field(description="least and greatest, of the walls")
    pitch: Fall = Field(default=0.0, description="slope of the gabled roofs; 0: flat")
    seed: Seed | None = Field(default=None, description="of the heights; left out: the scene's")

    @model_validator(mode="after")
    def _has_heights(self) -> Self:
        if self.heights[0] > self.heights[1]:
            found = f"{self.heights[0]:g} m and {self.heights[1]:g} m"
            raise wrong(f"found {found}, expected the least first", "heights")
        return self


class Mesh(Target):
    """Triangles out of a file, in metres after `scale`; first scaled, then rotated, then moved."""

    kind: Literal["mesh"]
    file: Annotated[Path, File((".stl", ".obj", ".ply", ".gltf", ".glb"))] = Field(description="the triangles")
    position: Place = Field(default=(0.0, 0.0, 0.0), description="where the file's origin goes")
    scale: Annotated[float, Quantity(units.RATIO, 0, above=True)] = Field(
        default=1.0, description="metres of the file's unit"
    )
    rotation: tuple[Angle, Angle, Angle] = Field(
        default=(0.0, 0.0, 0.0), description="about x, then y, then z, right-handed"
    )
    sheet: Annotated[bool, Flag()] = Field(
        default=False, description="it is open, as a sheet is; else an edge of one triangle is a hole, and refused"
    )


CROWNS = Literal["ellipsoid", "cone", "cylinder"]
LeafArea = Annotated[float, Quantity(units.VOLUME_DENSITY, 0, above=True)]


class Tree(Target):
    """A crown of leaves that face all directions alike, upright; no stem."""

    kind: Literal["tree"]
    position: Place = Field(description="foot")
    height: Size = Field(description="foot to top")
    crown: CROWNS = Field(description="shape")
    crown_width: Size = Field(description="greatest")
    crown_base: Annotated[float, Quantity(units.LENGTH, 0)] = Field(description="height of the lowest leaves")
    leaf_area_density: LeafArea = Field(description="leaf area, one side, of a volume in the crown")

    @model_validator(mode="after")
    def _has_a_crown(self) -> Self:
        if self.crown_base >= self.height:
            raise wrong(f"found {self.crown_base:g} m, expected less than the height, {self.height:g} m", "crown_base")
        return self


class Stand(Target):
    """Trees at random places, their feet on the terrain, plane or terraces below, or else at z = 0."""

    kind: Literal["stand"]
    position: tuple[Length, Length] = Field(default=(0.0, 0.0), description="x and y of its middle")
    size: Extent = Field(description="along x and y")
    density: Annotated[float, Quantity(units.AREA_DENSITY, 0, above=True)] = Field(
        description="trees per area, as 400 /ha"
    )
    height: Size = Field(description="mean, foot to top")
    deviation: Annotated[float, Quantity(units.LENGTH, 0)] = Field(
        default=0.0, description="of the heights, a normal distribution cut at 0.5 and 1.5 of the mean"
    )
    crown: CROWNS = Field(description="shape")
    crown_width: Annotated[float, Quantity(units.RATIO, 0, above=True)] = Field(description="share of a tree's height")
    crown_base: Annotated[float, Quantity(units.RATIO, 0, 0.99)] = Field(description="share of a tree's height")
    leaf_area_density: LeafArea = Field(description="leaf area, one side, of a volume in a crown")
    seed: Seed | None = Field(default=None, description="of places and heights; left out: the scene's")


AnyTarget = Annotated[
    Plane | Terraces | Sphere | Sea | Terrain | Roofs | Mesh | Tree | Stand, Field(discriminator="kind")
]


class Scene(Section):
    """A scene: what a full-waveform lidar flies over, and with what."""

    description: str = Field(default="", description="one line that says what it shows", max_length=200)
    platform: Platform
    laser: Laser
    receiver: Receiver
    digitiser: Digitiser
    atmosphere: Atmosphere | None = Field(default=None)
    speckle: Annotated[bool | float, OnOff()] = Field(
        default=False, description="order M of the gamma law; on: from aperture, wavelength and footprint"
    )
    tolerance: Tolerance = Field(default=Tolerance())
    seed: Seed = Field(default=0, description="of all that is random")
    shots: Annotated[int, Whole(1, MOST_SHOTS)] = Field(description="pulses, each with as many waveforms as beams")
    targets: tuple[AnyTarget, ...] = Field(
        description="a list, each entry of one kind; a beam that meets none records noise"
    )

    @property
    def beams(self) -> int:
        """Waveforms of a shot."""
        return 1 if self.platform.scan is None else self.platform.scan.beams

    @field_validator("description")
    @classmethod
    def _is_one_line(cls, value: str) -> str:
        if not value.isprintable():
            raise wrong("found several lines, expected one")
        return value

    @model_validator(mode="after")
    def _fits(self) -> Self:
        channels = self.digitiser.channels
        if channels < self.beams:
            raise wrong(f"found {channels}, expected at least {self.beams}, the beams of a shot", "digitiser.channels")
        if self.shots * self.beams > MOST_WAVEFORMS:
            most = MOST_WAVEFORMS // self.beams
            raise wrong(f"found {self.shots} of {self.beams} beams each, expected at most {most}", "shots")
        lit = self.atmosphere is not None and bool(self.atmosphere.background)
        if lit and self.receiver.filter_width is None:
            raise wrong("found nothing, expected it for the background light", "receiver.filter_width")
        return self


def load(name: str | Path) -> Scene:
    """Read a scene.

    Parameters
    ----------
    name : str or Path
        A bundled scene, or a YAML file; files that it names are taken from its own folder.

    Returns
    -------
    Scene
        Every quantity in SI.

    Raises
    ------
    SceneError
        If it can't be used: one line with the file, the key, what was found and what was expected.
    """
    known = bundled_files()
    if isinstance(name, str) and name in known:
        return _checked(known[name], read(known[name]))
    path = Path(name)
    if not path.suffix and not os.path.lexists(path):
        raise SceneError(f"{quoted(name, 200)}: no such scene, expected a YAML file or one of {', '.join(known)}")
    return _checked(path, read(path))


def loads(text: str, path: Path) -> Scene:
    """A scene in YAML text; `path` is what errors name, and its folder where the scene's files are."""
    return _checked(path, parse(text, path))


def changed(scene: Scene, **chosen: Any) -> Scene:
    """A scene with other values of some keys, which are checked as those of a file are.

    Parameters
    ----------
    scene : Scene
    **chosen
        Values by key, as YAML has them.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        If it can't be used: one line with the key, what was found and what was expected.
    """
    return _validated(_plain(scene) | chosen, Path())  # its files have absolute paths


def _checked(path: Path, data: dict[Any, Any]) -> Scene:
    try:
        return _validated(data, path.parent)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from error


def _validated(data: dict[Any, Any], folder: Path) -> Scene:
    try:
        return Scene.model_validate(data, context={"folder": folder})
    except ValidationError as error:
        raise SceneError(explained(data, dict(error.errors(include_url=False)[0]))) from error


def bundled_files() -> dict[str, Path]:
    """Files of the scenes that come with the package, by name."""
    return {path.stem: path for path in sorted(Path(__file__).with_name("scenes").glob("*.yaml"))}


def bundled() -> dict[str, str]:
    """Description of each scene that comes with the package, by name."""
    return {name: str(read(path)["description"]) for name, path in bundled_files().items()}


def dumped(scene: Scene) -> str:
    """A scene as YAML, in SI with units; `load` gives an equal one back, wherever the file is put."""
    return dumps(_plain(scene))


def _plain(scene: Scene) -> dict[str, Any]:
    """A scene as YAML holds it."""
    return scene.model_dump(mode="json", exclude_defaults=True)


def json_schema() -> dict[str, Any]:
    """The schema as JSON Schema, for editors that check YAML by it."""
    return Scene.model_json_schema()


def described() -> str:
    """The schema in words: every key with what is to be written, its default and its meaning."""
    return "\n".join([summary(Scene), *CONVENTIONS.splitlines(), *lines(Scene)]) + "\n"
