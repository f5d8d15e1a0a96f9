"""Settings: TOML to a validated, frozen record; an unknown key names its nearest known one."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, NonNegativeInt, field_validator, model_validator

from forceid.sections import Section, read_toml, validate

Method = Literal["difference", "savgol", "spline", "filter", "smoother"]
Model = Literal["rigid", "affine", "modal", "segments", "auto"]
Vector = tuple[float, float, float]
SKEW = 0.02  # cosine: axes at a right angle to one degree, as they are written by hand


class LoadSetting(Section):
    """One load of f = B p: a unit force along `direction` at `point`, or a unit moment about it.

    `point` is a node name or three coordinates in meters. In its place, `nodes` that share the force evenly,
    or `pattern`, the force (N) on each node that it names, of a load of one. `axes`: "body" turns direction,
    point and pattern with the mean rotation, "world" keeps them fixed in space.
    """

    name: str
    direction: Vector | None = None
    point: str | Vector = "mass_center"
    nodes: tuple[str, ...] = ()
    pattern: dict[str, Vector] = Field(default_factory=dict)
    kind: Literal["force", "moment"] = "force"
    axes: Literal["body", "world"] = "body"

    @model_validator(mode="after")
    def one_place(self) -> Self:
        """One way to say where a load acts, and along what."""
        said = {"point": self.point != "mass_center", "nodes": self.nodes, "pattern": self.pattern}
        ways = [way for way, given in said.items() if given]
        if len(ways) > 1:
            raise ValueError(f"{self.name} has {' and '.join(ways)}, expected one of them")
        if (self.direction is None) != bool(self.pattern):
            raise ValueError(f"{self.name} takes a direction, or a pattern, which has its own")
        if self.kind == "moment" and ways and ways[0] != "point":
            raise ValueError(f"{self.name} is a moment, expected no {ways[0]}")
        return self


class KnownLoadSetting(Section):
    """One load that is known beforehand: constant, or the series of that name in /load_known of the file.

    force (N) and moment (N m) about `point`, which is a node, several nodes that share the force evenly, the
    mass center, or three coordinates in meters. `axes`: "world" keeps vectors and coordinates fixed in space,
    "body" turns them with the mean rotation. force_std, moment_std: standard deviation of each component, of
    an error that may last. A series has its own point and covariance where the file gives them. part: that it
    acts on, of a body in parts.
    """

    name: str
    part: str | None = None
    force: Vector | None = None
    moment: Vector | None = None
    point: str | Vector | tuple[str, ...] = "mass_center"
    axes: Literal["body", "world"] = "world"
    force_std: float = Field(default=0.0, ge=0.0)
    moment_std: float = Field(default=0.0, ge=0.0)


class BodyStdSetting(Section):
    """How uncertain the body is that the file states: standard deviations, which the claims then count.

    mass and inertia as shares of themselves, the inertia about each of its principal axes; mass_center: of
    each coordinate (m), in the axes of the body; joint: of where the joints of segments are (m, each axis),
    10 mm where it is not stated.
    """

    mass: float = Field(default=0.0, ge=0.0, lt=1.0)
    mass_center: float = Field(default=0.0, ge=0.0)
    inertia: float = Field(default=0.0, ge=0.0, lt=1.0)
    joint: float = Field(default=0.0, ge=0.0)


class PriorSetting(Section):
    """What is known of how force or moment vary, before a record is seen; what is left out is tuned on it.

    std of each component (N, N m) about its mean, which stays open; rate (1/s) at which the load forgets
    itself, or bandwidth (Hz), at which its spectral density has fallen to a half; order of the Matern kernel:
    how often the load has a rate, plus one.
    """

    order: int | None = Field(default=None, ge=1, le=6)
    std: float | None = Field(default=None, gt=0.0)
    rate: float | None = Field(default=None, gt=0.0)
    bandwidth: float | None = Field(default=None, gt=0.0)

    @model_validator(mode="after")
    def one_pace(self) -> Self:
        """One way to say how fast a load is."""
        if self.rate is not None and self.bandwidth is not None:
            raise ValueError("has rate and bandwidth, expected one of them")
        return self


class PriorsSetting(Section):
    """Priors of one's own, of the force and of the moment."""

    force: PriorSetting = PriorSetting()
    moment: PriorSetting = PriorSetting()


class WindProfile(Section):
    """Wind by height: velocity (m/s, world axes) at heights (m, against gravity), straight between them."""

    height: tuple[float, ...]
    velocity: tuple[Vector, ...]

    @model_validator(mode="after")
    def of_one_length(self) -> Self:
        """A velocity for every height, and heights that rise."""
        if len(self.height) != len(self.velocity) or not self.height:
            raise ValueError(f"has {len(self.height)} heights and {len(self.velocity)} velocities")
        if any(b <= a for a, b in pairwise(self.height)):
            raise ValueError("has heights that do not rise, expected each above the one before")
        return self


HIGHEST, LOWEST = 20000.0, -500.0  # m: between them the standard atmosphere is laid down here


class AeroSetting(Section):
    """What coefficients of the air are taken with: a body in air of known density, size and wind.

    density kg/m3, or altitude m in the standard atmosphere, sea level where neither is stated; area m2;
    chord m, of Cm; span m, of Cl, Cn, advance ratio and spin parameter; the one that is left out is the
    other, the root of the area where both are. wind m/s, world axes: constant, or "measured", which is
    /motion/wind of the file; or wind_profile, by height. forward and up: axes of the body (reference axes).
    axes: of the "body"; of a "disc", whose forward is where it flies, across `up`; or of a "ball", with lift
    along spin x velocity.
    """

    area: float = Field(gt=0.0, examples=["area = 0.05 under [aero], m2"])
    chord: float | None = Field(default=None, gt=0.0)
    span: float | None = Field(default=None, gt=0.0)
    density: float | None = Field(default=None, gt=0.0, le=2e4)
    altitude: float | None = Field(default=None, ge=LOWEST, le=HIGHEST)
    wind: Vector | Literal["measured"] = (0.0, 0.0, 0.0)
    wind_profile: WindProfile | None = None
    axes: Literal["body", "disc", "ball"] = "body"
    forward: Vector = (1.0, 0.0, 0.0)
    up: Vector = (0.0, 0.0, 1.0)

    @field_validator("wind", mode="before")
    @classmethod
    def known_wind(cls, wind: Any) -> Any:
        """Three numbers, or a word."""
        numbers = isinstance(wind, list | tuple) and all(isinstance(v, int | float) for v in wind)
        if wind != "measured" and not (numbers and len(wind) == 3):
            raise ValueError('expected three numbers in m/s, or "measured"')
        return wind

    @model_validator(mode="after")
    def of_one_kind(self) -> Self:
        """One way to say how dense the air is, and axes that span a plane."""
        if self.density is not None and self.altitude is not None:
            raise ValueError("has density and altitude, expected one of them")
        if self.wind_profile is not None and (self.wind == "measured" or any(self.wind)):
            raise ValueError("has wind and wind_profile, expected one of them")
        dot = sum(a * b for a, b in zip(self.forward, self.up, strict=True))
        size = sum(a * a for a in self.forward) * sum(a * a for a in self.up)
        if not dot * dot < SKEW**2 * size:
            raise ValueError("has forward and up that are not at right angles")
        return self

    @property
    def lengths(self) -> tuple[float, float]:
        """Chord and span, m."""
        own = self.chord or self.span or self.area**0.5
        return own, self.span or own


class RotorSetting(Section):
    """A rotor or wheel inside the body, of which nothing is seen from outside.

    axis: in the axes of the body, of any length; inertia kg m2: about that axis; speed rad/s: against the
    body, right-handed about the axis; left out, that of /motion/rotor_speed of the file.
    """

    name: str
    axis: Vector
    inertia: float = Field(gt=0.0)
    speed: float | None = None

    @field_validator("axis")
    @classmethod
    def some_way(cls, axis: Vector) -> Vector:
        """A direction."""
        if not any(axis):
            raise ValueError("is zero, expected a direction")
        return axis


class FootSetting(Section):
    """A foot of two that stand on the ground: its nodes by name, and by how much the pressure under it may be
    off their middle: half of its length over root three.
    """

    name: str
    nodes: tuple[str, ...] = Field(min_length=1)
    reach: float = Field(default=0.07, gt=0.0)


class PartSetting(Section):
    """One part of a body in parts: the nodes (names or zero-based indices) that move as one.

    Three markers off a line at least. Its mass is that of its nodes, or mass kg, center m and inertia kg m2
    about that center, in the axes of the reference shape. external: whether anything but weight and joints
    may push this part; its load is then solved for. rigid: that it does not bend, so that its joints hold it
    exactly; so it is for all parts under model = "rigid". sensors: in place of nodes, where there are no
    markers, the accelerometers on it (from 0); it has to have a mass, and hardly turns.
    """

    name: str
    nodes: tuple[str | int, ...] = ()
    sensors: tuple[NonNegativeInt, ...] = ()
    mass: float | None = Field(default=None, gt=0.0)
    center: Vector | None = None
    inertia: tuple[Vector, Vector, Vector] | None = None
    external: bool = False
    rigid: bool = False

    @model_validator(mode="after")
    def one_sight(self) -> Self:
        """Seen by markers or by accelerometers."""
        if self.nodes and self.sensors:
            raise ValueError(f"{self.name} has nodes and sensors, expected one of them")
        return self


class JointSetting(Section):
    """What holds two parts together at one point, a node or a place (m) in the reference shape.

    One of them may be "ground", which stands still: its place and axes are where the motion shows them. kind:
    what it passes: a "weld" force and moment, a "ball" force, a "hinge" force and the moment across its axis,
    `axis` (reference shape). driven: a spring, damper or motor in it passes moments about its free axes too.
    """

    name: str
    parts: tuple[str, str]
    at: str | Vector
    kind: Literal["weld", "hinge", "ball"] = "weld"
    axis: Vector | None = None
    driven: bool = False


class Settings(Section):
    """How a motion is turned into a wrench. Every field has a default that asks nothing of the user.

    noise_std: standard deviation of one measured component (m; orientation rad) by variable, overrides
    the file and acts as a floor. gravity (m/s2, world axes) overrides the file. moment_about:
    "mass_center", a node name, or a fixed point in world axes (m). model: auto takes segments where a
    body has markers on segments that meet at joints, and they leave the rigid shape. modes: the number of
    deformation modes of the modal model, None chooses it from the data. load_axes: along which force and
    moment are smooth functions of time, those of the "world", or of the "body", which a thrust or a fin turns
    with; "auto" lets the record say it, load by load.
    load_prior: how they vary in time there, one of the kernels in forceid/flight/priors. prior: what is known
    of the matern one of the force, and of the moment.
    internal_momentum: angular momentum (kg m2/s, body axes) of what turns inside at a constant rate, None:
    not known. rotor: what turns inside at a known speed. mass_rate (kg/s): of a body that burns, from the
    first sample on, its force being what acts on what is left. foot: of two between which the force is split.
    joint_loads: whether force and moment of the joints of a person, on its two feet, are found as well.
    lines: oscillating loads beside the smooth one, found by evidence ("auto"), "none", or looked for at these
    frequencies only (Hz). known_load: loads that are known; the force and the moment estimated are those of
    all others. part, joint: bodies that joints hold together, for the forces in these. material: name and
    constants (J, or Pa with `volume` m3) of a body that deforms affinely, in place of /body/material.
    body_std: how uncertain mass, mass center and inertia are. aero: air, sizes and wind for the coefficients
    of the air; None: they are not asked for.
    """

    method: Method = "smoother"
    model: Model = "auto"
    engine: Literal["auto", "compiled", "numpy", "filterpy"] = "auto"
    gauge: Literal["mass", "euclidean", "sensor"] = "mass"
    gravity: Vector | None = None
    moment_about: str | Vector = "mass_center"
    modes: int | None = Field(default=None, ge=0)
    load_axes: Literal["auto", "world", "body"] = "auto"
    load_prior: Literal["matern", "periodic"] = "matern"
    prior: PriorsSetting = PriorsSetting()
    internal_momentum: Vector | None = None
    mass_rate: float | None = None
    foot: tuple[FootSetting, ...] = ()
    joint_loads: bool = False
    rotor: tuple[RotorSetting, ...] = ()
    lines: Literal["auto", "none"] | tuple[Annotated[float, Field(gt=0.0)], ...] = "auto"
    noise_std: dict[str, float] = Field(default_factory=dict)
    load: tuple[LoadSetting, ...] = ()
    known_load: tuple[KnownLoadSetting, ...] = ()
    part: tuple[PartSetting, ...] = ()
    joint: tuple[JointSetting, ...] = ()
    material: dict[str, str | float | tuple[float, ...]] | None = None
    body_std: BodyStdSetting = BodyStdSetting()
    aero: AeroSetting | None = None

    @model_validator(mode="after")
    def joints_of_one_kind(self) -> Self:
        """Joints of segments that a file knows, or of parts that the settings name."""
        if self.joint_loads and self.part:
            raise ValueError("has joint_loads and part, expected one of them")
        return self

    @model_validator(mode="after")
    def prior_of_its_kind(self) -> Self:
        """Numbers of a prior are those of a Matern kernel along axes of the world."""
        if self.prior != PriorsSetting():
            fitting = {"load_prior": ("matern",), "load_axes": ("auto", "world"), "part": ((),)}
            for name, only in fitting.items():
                if getattr(self, name) not in only:
                    raise ValueError(f"prior has numbers, expected {name} = {only[-1]!r} beside them")
        return self


OF_OTHERS = ("import", "law", "strips", "ground", "choose", "keep")  # one file may serve all commands


def load_settings(path: str | Path | None = None, **overrides: Any) -> Settings:
    """Settings from a TOML file, then from keyword overrides (those that are None are ignored).

    >>> load_settings(method="savgol").method
    'savgol'
    >>> load_settings(metod="savgol")
    Traceback (most recent call last):
    forceid.errors.ConfigError: settings: unknown key 'metod'; did you mean 'method'?
    """
    table = read_toml(path) if path is not None else {}
    table = {k: v for k, v in table.items() if k not in OF_OTHERS}
    table |= {k: v for k, v in overrides.items() if v is not None}
    return validate(Settings, table, str(path) if path is not None else "settings:")
