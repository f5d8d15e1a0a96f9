"""A body on the ground: contact along the normal of a plane, friction along it, and resistance to rolling.

Of every point of contact: its depth below the plane and the rate of that give the force N along the normal,
none above the plane and never a pull (a glued contact holds on and pulls too). Where no law of contact is
asked for, N is what holds the body at its height. Friction is mu N against the
slip, and a rolling ball of radius r meets the moment c r N against its turn. Where a slip would end within a
step of integration, friction is what ends it, mu N at most: a contact that sticks does not creep.
Source: Johnson, Contact Mechanics, 4.2 (depth^1.5 of two spheres) and 8.1; Hunt and Crossley 1975, damping by
depth * depth_rate.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from forceid.aero import cross, dot
from forceid.config import Vector
from forceid.laws.state import State
from forceid.principal import cross_matrix
from forceid.records import Array
from forceid.sections import Section

COMPONENTS = ("contact", "friction", "rolling")
VARIABLES = ("depth", "depth_rate", "slip")
Kind = Literal["soft", "glued", "hard"]
LEAST = 1e-300  # what may be divided by, where nothing slips


class GroundSetting(Section):
    """The plane that a body meets, and where it does: all points below it touch.

    normal: out of the ground, world axes, of any length; height m: of the plane along it, from the origin;
    left out: found, as `contact.height`. points (point, 3) m: of the body, from its mass center, body axes;
    or radius m of a ball, or of a leg that springs below the mass center. glued: the contact never lets
    go, as mounts do. A law without contact takes the ground as hard, and the body to stay on it.
    """

    normal: Vector = (0.0, 0.0, 1.0)
    height: float | None = None
    points: tuple[Vector, ...] | None = None
    radius: float | None = Field(default=None, gt=0.0)
    glued: bool = False

    @model_validator(mode="after")
    def one_shape(self) -> Self:
        """Points or a ball, and a normal that points somewhere."""
        if bool(self.points) == (self.radius is not None):
            raise ValueError("expected points, or the radius of a ball, one of them")
        if not any(self.normal):
            raise ValueError("normal is zero, expected the direction out of the ground")
        return self


@dataclass(frozen=True)
class Ground:
    """The plane and the places that meet it: normal (3,) of length one, points (point, 3) or a radius, m.

    kind: a "soft" ground has a contact law and lets go; "glued" does not; "hard" has none, and holds what is
    on it at its height.
    """

    normal: Array
    height: float
    points: Array | None
    radius: float
    kind: Kind

    @property
    def places(self) -> int:
        """How many places of contact there are."""
        return 1 if self.points is None else len(self.points)

    def arms(self, R: Array) -> Array:
        """Places of contact (..., point, 3) from the mass center, world axes."""
        if self.points is None:
            return np.broadcast_to(-self.radius * self.normal, (*R.shape[:-2], 1, 3))
        return np.asarray(np.einsum("...ab,pb->...pa", R, self.points))

    def gaps(self, center: Array, arm: Array, rise: Array) -> Array:
        """Heights (..., point) m of places at arms (..., point, 3) above the plane, that is itself higher."""
        return np.asarray((center[..., None, :] + arm) @ self.normal - self.height - rise[..., None])

    def wrench(
        self,
        total: Callable[[str, Mapping[str, Array]], Array],
        rise: Array,
        at: State,
        others: tuple[Array, Array],
    ) -> tuple[Array, Array]:
        """Force and moment (..., 3) of all contacts, world axes, on a body under others.

        total: sum (..., point) of the terms of a component; rise (...) m: of the plane above its height.
        """
        n, arm = self.normal, self.arms(at.R)
        carried = cross(at.omega[..., None, :] + 0 * arm, arm)
        v = at.velocity[..., None, :] + carried
        depth = -self.gaps(at.center, arm, rise)
        rate = -(v @ n)
        slip = v + rate[..., None] * n
        of = {"depth": depth, "depth_rate": rate, "slip": np.sqrt(dot(slip, slip))}
        if self.kind == "hard":
            swing = self.swung(at, arm, carried, *at.accelerated(*others))
            lever = cross(arm, 0 * arm + n)
            give = 1 / at.mass + dot(lever, (at.inverse[..., None, :, :] @ lever[..., None])[..., 0])
            load = (rate - at.step * (swing @ n)) / (arm.shape[-2] * at.step * give)
        else:
            of["depth"] = depth if self.kind == "glued" else np.maximum(depth, 0.0)
            load = np.where(np.asarray(at.touching), total("contact", of), 0.0)
        load = load if self.kind == "glued" else np.maximum(load, 0.0)
        pressed = np.abs(load)
        f = load[..., None] * n
        force, moment = f.sum(-2), cross(arm, f).sum(-2) + self.rolled(total("rolling", of) * pressed, at)
        most = total("friction", of) * pressed
        if most.any():
            a = at.accelerated(force + others[0], moment + others[1])
            gain = at.step * along(self.swung(at, arm, carried, *a), n)
            rub = self.rubbed(most, slip, gain, arm, at)
            force, moment = force + rub.sum(-2), moment + cross(arm, rub).sum(-2)
        return force, moment

    def swung(self, at: State, arm: Array, carried: Array, a: Array, turn: Array) -> Array:
        """Accelerations (..., point, 3) of the places of contact as the body accelerates and turns faster."""
        swing = a[..., None, :] + cross(turn[..., None, :] + 0 * arm, arm)
        if self.points is None:  # a ball touches below its center, whatever turns by there
            return swing
        return swing + cross(at.omega[..., None, :] + 0 * arm, carried)

    def rubbed(self, most: Array, slip: Array, gain: Array, arm: Array, at: State) -> Array:
        """Friction (..., point, 3), `most` at most, of places that slip (..., point, 3) m/s and would gain as
        much in a step without any: what ends both, or all there is, against the larger of them.
        """
        n, lever = self.normal, cross_matrix(arm)
        give = np.eye(3) / at.mass - lever @ at.inverse[..., None, :, :] @ lever
        flat = np.eye(3) - np.outer(n, n)
        give = arm.shape[-2] * at.step * (flat @ give @ flat) + np.outer(n, n)
        stops = np.linalg.solve(give, -(slip + gain)[..., None])[..., 0]
        way = np.where((dot(slip, slip) > dot(gain, gain))[..., None], slip, slip + gain)
        slides = -(most / np.maximum(np.sqrt(dot(way, way)), LEAST))[..., None] * way
        return np.where((dot(stops, stops) > most**2)[..., None], slides, stops)

    def rolled(self, most: Array, at: State) -> Array:
        """Moment (..., 3) against rolling: what ends the turn along the plane in a step, or all there is."""
        turn = along(at.omega, self.normal)
        size = np.maximum(np.sqrt(dot(turn, turn)), LEAST)
        stops = size / np.maximum(at.step * np.trace(at.inverse, axis1=-2, axis2=-1), LEAST)
        return np.asarray(-(np.minimum(self.radius * most.sum(-1), stops) / size)[..., None] * turn)


def along(a: Array, n: Array) -> Array:
    """The part of vectors (..., 3) along a plane of normal n."""
    return np.asarray(a - (a @ n)[..., None] * n)


def ground_of(setting: GroundSetting, law: Collection[str]) -> Ground:
    """The ground of the settings, for the components of a law."""
    normal = np.array(setting.normal) / np.linalg.norm(setting.normal)
    points = None if setting.points is None else np.array(setting.points)
    kind: Kind = "glued" if setting.glued else "soft" if "contact" in law else "hard"
    return Ground(normal, setting.height or 0.0, points, setting.radius or 0.0, kind)
