"""Import settings: the [import] table, which says what the columns and markers of a source mean."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, create_model, model_validator

from forceid.config import RotorSetting, Vector
from forceid.errors import ConfigError
from forceid.records import SENSED, SENSOR
from forceid.sections import Section, read_toml, validate

Columns = tuple[str, str, str]
Dim = Literal["time", "node", "axis"]
Matrix = tuple[Vector, Vector, Vector]
ON_SENSORS = tuple(name for name, variable in SENSED.items() if variable.dims == SENSOR)
UNITS_OF = (
    "time",
    "position",
    "displacement",
    "center",
    "orientation",
    *SENSED,
    "rotor_speed",
    "current_mass",
    "geometry",
)
if TYPE_CHECKING:
    SensorSetting = Section
else:  # a key for each variable of sensors
    named = (dict[str, Columns | str] | str, Field(default_factory=dict))
    SensorSetting = create_model("SensorSetting", __base__=Section, **dict.fromkeys(ON_SENSORS, named))


class ChannelSetting(SensorSetting):
    """Which channels of a MAT, UFF or TDMS file, or columns of a CSV file, hold what.

    position, displacement (from [import.body] position or the nodes of the file) and the sensors map the name
    of a node or sensor to its three channels, or to one channel of three columns; or they are one pattern for
    all, as in "{name}_{axis}", or one array of all nodes. orientation: its channels in the order x, y, z, w,
    body to world. `q(:,2)` is the second column of q. time names a channel; or rate (Hz) is a number, or
    names one; or the file has a clock. units by variable overrule those of the file. dims: the order of the
    axes of an array of all nodes; nodes: their names, or the variable that lists them.
    """

    time: str | None = None
    rate: Annotated[float, Field(gt=0)] | str | None = None
    position: dict[str, Columns | str] | str = Field(default_factory=dict)
    displacement: dict[str, Columns | str] | str = Field(default_factory=dict)
    center: Columns | str | None = None
    orientation: tuple[str, str, str, str] | str | None = None
    strain: tuple[str, ...] = ()
    rotor_speed: tuple[str, ...] = ()
    current_mass: str | None = None
    units: dict[str, str] = Field(default_factory=dict)
    nodes: tuple[str, ...] | str = ()
    dims: tuple[Dim, Dim, Dim] = ("time", "node", "axis")

    @model_validator(mode="after")
    def _check(self) -> ChannelSetting:
        if len(set(self.dims)) != 3:
            raise ValueError("dims: expected time, node and axis, each once")
        for name in self.units:
            if name not in UNITS_OF:
                near = get_close_matches(name, UNITS_OF, n=1, cutoff=0.0)[0]
                raise ValueError(f"units: unknown variable {name!r}; did you mean {near!r}?")
        return self


class CsvSetting(ChannelSetting):
    """Which columns of a CSV file hold what.

    group: the column whose values part the file into recordings; select keeps those named.
    """

    delimiter: str = Field(default=",", min_length=1, max_length=1)
    group: str | None = None
    select: str | float | tuple[str | float, ...] = ()


class SegmentSetting(Section):
    """A mass point at a fixed combination of markers; the weights add up to one.

    mass in kg, or mass_fraction of `total_mass` in [import.body]; cluster: the markers that stay on the
    segment, which show how it moves. gyration: weights that add up to zero, by which half of the mass is off
    the point one way and half the other, so that the segment has a spin of its own: two points for one.
    """

    name: str
    markers: dict[str, float] = Field(min_length=1)
    cluster: tuple[str, ...] = ()
    gyration: dict[str, float] = Field(default_factory=dict)
    mass: float | None = Field(default=None, ge=0)
    mass_fraction: float | None = Field(default=None, ge=0)

    @model_validator(mode="after")
    def _check(self) -> SegmentSetting:
        if abs(total := sum(self.markers.values()) - 1.0) > 1e-6:
            raise ValueError(f"segment {self.name}: marker weights add up to {total + 1:g}, expected 1")
        if abs(off := sum(self.gyration.values())) > 1e-6:
            raise ValueError(f"segment {self.name}: weights of gyration add up to {off:g}, expected 0")
        if (self.mass is None) == (self.mass_fraction is None):
            raise ValueError(f"segment {self.name}: give either mass or mass_fraction")
        return self

    @property
    def points(self) -> dict[str, dict[str, float]]:
        """Marker weights by the name of a mass point: one, or two with half of the mass each."""
        if not self.gyration:
            return {self.name: self.markers}
        names = self.markers | self.gyration
        return {
            f"{self.name}{end}": {
                n: self.markers.get(n, 0.0) + way * self.gyration.get(n, 0.0) for n in names
            }
            for end, way in (("", -1.0), ("_2", 1.0))
        }


class JointSetting(Section):
    """A joint of two segments that have clusters: at a combination of markers in the reference pose."""

    segments: tuple[str, str]
    markers: dict[str, float] = Field(min_length=1)

    @model_validator(mode="after")
    def _check(self) -> JointSetting:
        if abs(total := sum(self.markers.values()) - 1.0) > 1e-6:
            raise ValueError(f"marker weights add up to {total + 1:g}, expected 1")
        return self


class BodySetting(Section):
    """Mass and shape, as in /body of a motion file; position and mass by node name.

    A person: table of segments, mass in kg as one number (or total_mass), height m, and sex, without which a
    table of two is taken in the mean. ends: markers in whose middle a point of the person is; cluster: those
    that stay on a segment, in place of what the names of a known marker set say.

    A rigid body: file, beside the source: URDF, SDF or OpenSim, and in it link; or mass properties as a CAD
    program prints them, products: whether its products of inertia are the "integral" of x y or as in the
    "tensor", where the text does not tell.
    """

    file: str = ""
    link: str = ""
    products: Literal["", "integral", "tensor"] = ""
    table: Literal["", "de_leva", "winter", "dempster"] = ""
    height: float | None = Field(default=None, gt=0.3, lt=3)
    sex: Literal["", "female", "male"] = ""
    ends: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    cluster: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    total_mass: float | None = Field(default=None, gt=0)
    mass_center: Vector = (0.0, 0.0, 0.0)
    inertia: Matrix | None = None
    mass_rate: float | None = None
    position: dict[str, Vector] = Field(default_factory=dict)
    mass: dict[str, float] = Field(default_factory=dict)
    sensor_position: dict[str, Vector] = Field(default_factory=dict)
    sensor_rotation: dict[str, tuple[float, float, float, float]] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _one_mass(cls, given: Any) -> Any:
        if isinstance(given, dict) and isinstance(given.get("mass"), int | float):
            return {k: v for k, v in given.items() if k != "mass"} | {"total_mass": given["mass"]}
        return given


class CaptureSetting(Section):
    """Which part of a capture is the motion.

    body: of several, the rigid body whose pose it is, or how the names of its markers begin; use: "markers"
    or "pose", where both are there; markers: only these.
    """

    body: str = ""
    use: Literal["markers", "pose"] | None = None
    markers: tuple[str, ...] = ()


class UntilSetting(Section):
    """Keep the rows before the lowest point of the body comes within `clearance` (m) of a plane.

    The plane is where the world coordinate `axis` equals `height` (m).
    """

    clearance: float
    axis: str = Field(default="z", pattern="^[xyz]$")
    height: float = 0.0


class PlateSetting(Section):
    """Columns of force plates in a MOT file: prefixes that x, y, z complete; {plate} is one of `plate`.

    The plates are truth, to compare with, but those `known`: they are loads beside which others are found.
    Those of a C3D file are named by numbers from 1; `plate` takes some of them, this table all.
    """

    plate: tuple[str, ...] = ("1",)
    known: tuple[str, ...] = ()
    force: str = "ground_force_{plate}_v"
    point: str = "ground_force_{plate}_p"
    moment: str = "ground_force_{plate}_m"


class ImportSettings(Section):
    """How a source becomes a recording. gravity (m/s2, world axes) is asked for: it is never assumed.

    start and stop (s) keep a window of time, both ends included. noise_std by variable of /motion, SI.
    static: a capture of the body at rest, beside the others, in which joints are placed among the markers;
    without it that is the first frame that shows all of them. rotor: what turns inside, as in an estimate;
    those without a speed have the channels rotor_speed, in order.
    """

    gravity: Vector = Field(examples=["gravity = [0.0, 0.0, -9.81], m/s2 in world axes"])
    title: str = ""
    source: str = ""
    start: float | None = None
    stop: float | None = None
    noise_std: dict[str, float] = Field(default_factory=dict)
    csv: CsvSetting | None = None
    channels: ChannelSetting | None = None
    capture: CaptureSetting | None = None
    body: BodySetting = BodySetting()
    segment: tuple[SegmentSetting, ...] = ()
    joint: dict[str, JointSetting] = Field(default_factory=dict)
    static: str = ""
    until: UntilSetting | None = None
    rotor: tuple[RotorSetting, ...] = ()
    plates: PlateSetting | None = None


def load_import_settings(path: str | Path | None, **overrides: Any) -> ImportSettings:
    """The [import] table of a TOML file, then keys that override it. ConfigError: no such table, a wrong key.

    >>> load_import_settings(None)
    Traceback (most recent call last):
    forceid.errors.ConfigError: import: has no configuration, expected one that says mass and gravity; \
give it with -c: `forceid import --help` shows the shortest
    """
    if path is None and overrides:
        return validate(ImportSettings, overrides, "import:")
    if path is None:
        what = "has no configuration, expected one that says mass and gravity"
        raise ConfigError(what, "import:", "give it with -c: `forceid import --help` shows the shortest")
    table = read_toml(path)
    if "import" not in table:
        next_step = "add it: `forceid import --help` shows the shortest"
        raise ConfigError("has no table [import]", str(path), next_step)
    return validate(ImportSettings, table["import"] | overrides, f"{path}: [import]")
