"""Forces and moments of the air that coefficients of one make: of a whole body, or by strips."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from forceid.aero import Flow, cross, density_of
from forceid.config import AeroSetting, Vector
from forceid.laws.state import State
from forceid.records import Array
from forceid.sections import Section

WHOLE_BODY = ("lift", "drag", "side", "roll", "pitch", "yaw")
BY_STRIPS = ("strip_lift", "strip_drag")

Fields = dict[str, tuple[Array | None, Array | None]]


class StripSetting(Section):
    """Blade elements: area (strip,) m2 of each at position (strip, 3) m from the mass center, body axes.

    No position: the nodes of the estimate. Lift is along `up` by the velocity across it, drag against it.
    """

    area: tuple[float, ...]
    position: tuple[Vector, ...] | None = None


def whole_body_fields(names: Iterable[str], aero: AeroSetting, seen: Flow) -> Fields:
    """Force and moment (..., 3), world axes, that a coefficient of one makes, by component."""
    qA = (0.5 * density_of(aero) * aero.area * seen.speed**2)[..., None]
    chord, span = aero.lengths
    used: Fields = {}
    for name in names:
        match name:
            case "lift":
                used[name] = -qA * seen.z_wind, None
            case "drag":
                used[name] = -qA * seen.x_wind, None
            case "side":
                used[name] = qA * cross(seen.z_wind, seen.x_wind), None
            case "roll":
                used[name] = None, span * qA * seen.x
            case "pitch":
                used[name] = None, chord * qA * seen.y
            case "yaw":
                used[name] = None, span * qA * seen.z
    return used


def strip_fields(
    names: Iterable[str], aero: AeroSetting, seen: Flow, at: State, strips: tuple[Array, Array]
) -> Fields:
    """The same of lift and drag of all strips: positions (strip, 3) m and areas (strip,) m2."""
    position, area = strips
    up = -seen.z
    arm = np.einsum("...ab,sb->...sa", at.R, position)
    v = at.air[..., None, :] + cross(seen.omega[..., None, :] + 0 * arm, arm)
    climb = (v * up[..., None, :]).sum(-1)
    square = (v * v).sum(-1)
    dynamic = 0.5 * density_of(aero) * area
    lift = (dynamic * (square - climb**2))[..., None] * up[..., None, :]
    drag = -(dynamic * np.sqrt(square))[..., None] * v
    return {
        name: (f.sum(-2), cross(arm, f).sum(-2))
        for name, f in (("strip_lift", lift), ("strip_drag", drag))
        if name in names
    }
