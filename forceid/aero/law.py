"""A law of the air: coefficients times terms times the fields of force and moment that they scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from forceid.aero.air import density_of
from forceid.aero.axes import Flow, cross, flow
from forceid.aero.terms import Term, Variables, term_of
from forceid.config import AeroSetting, Section, Vector, validate
from forceid.errors import ConfigError
from forceid.records import Array

WHOLE_BODY = ("lift", "drag", "side", "roll", "pitch", "yaw")
BY_STRIPS = ("strip_lift", "strip_drag")


class StripSetting(Section):
    """Blade elements: area (strip,) m2 of each at position (strip, 3) m from the mass center, body axes.

    No position: the nodes of the estimate. Lift is along `up` by the velocity across it, drag against it.
    """

    area: tuple[float, ...]
    position: tuple[Vector, ...] | None = None


class LawSetting(Section):
    """What `forceid coefficients` fits: air and sizes, terms by component, and whether to choose among them.

    law: lift, drag, side (wind axes), roll, pitch, yaw (body axes), strip_lift, strip_drag. aero: left out,
    that of the first result. keep: components or `component.term` that stay whatever the evidence says.
    """

    law: dict[str, tuple[str, ...]]
    aero: AeroSetting | None = None
    strips: StripSetting | None = None
    choose: bool = True
    keep: tuple[str, ...] = ()


@dataclass(frozen=True)
class Law:
    """Terms with the component that each scales; strips: positions (strip, 3) m and areas (strip,) m2."""

    aero: AeroSetting
    components: tuple[str, ...]
    terms: tuple[Term, ...]
    strips: tuple[Array, Array] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coefficients: component and term."""
        return tuple(f"{c}.{t.text}" for c, t in zip(self.components, self.terms, strict=True))

    def only(self, which: Sequence[int]) -> Law:
        """The law of some of its terms."""
        parts = tuple(self.components[k] for k in which), tuple(self.terms[k] for k in which)
        return replace(self, components=parts[0], terms=parts[1])

    def fields(self, seen: Flow, air: Array, R: Array) -> dict[str, tuple[Array | None, Array | None]]:
        """Force and moment (..., 3), world axes, that a coefficient of one makes, by component."""
        qA = (0.5 * density_of(self.aero) * self.aero.area * seen.speed**2)[..., None]
        chord, span = self.aero.lengths
        used: dict[str, tuple[Array | None, Array | None]] = {}
        for name in dict.fromkeys(self.components):
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
        return used if self.strips is None else used | self.strip_fields(air, R, seen.omega, -seen.z)

    def strip_fields(
        self, air: Array, R: Array, omega: Array, up: Array
    ) -> dict[str, tuple[Array | None, Array | None]]:
        """Force and moment (..., 3) of lift and drag of all strips, for coefficients of one."""
        assert self.strips is not None
        position, area = self.strips
        arm = np.einsum("...ab,sb->...sa", R, position)
        v = air[..., None, :] + cross(omega[..., None, :] + 0 * arm, arm)
        climb = (v * up[..., None, :]).sum(-1)
        square = (v * v).sum(-1)
        dynamic = 0.5 * density_of(self.aero) * area
        lift = (dynamic * (square - climb**2))[..., None] * up[..., None, :]
        drag = -(dynamic * np.sqrt(square))[..., None] * v
        return {
            name: (f.sum(-2), cross(arm, f).sum(-2))
            for name, f in (("strip_lift", lift), ("strip_drag", drag))
            if name in self.components
        }

    def wrench(
        self, value: Array, time: float | Array, air: Array, R: Array, omega: Array
    ) -> tuple[Array, Array]:
        """Force and moment (..., 3), world axes, under coefficients (..., term).

        air (..., 3) m/s: velocity against the air; R (..., 3, 3); omega (..., 3) rad/s.
        """
        seen = flow(self.aero, air, R, omega)
        of, sums = Variables(seen, self.aero.lengths), dict[str, Array]()
        for k, (component, term) in enumerate(zip(self.components, self.terms, strict=True)):
            part = np.asarray(value[..., k] * term.value(of, time))
            sums[component] = sums[component] + part if component in sums else part
        force, moment = np.zeros_like(air), np.zeros_like(air)
        for name, (f, m) in self.fields(seen, air, R).items():
            share = sums[name][..., None]
            if f is not None:
                force += share * f
            if m is not None:
                moment += share * m
        return force, moment

    def columns(self, time: Array, air: Array, R: Array, omega: Array) -> Array:
        """Force and moment (time, 6, term) that each coefficient of one makes along a path."""
        each = [self.only([k]).wrench(np.ones((1, 1)), time, air, R, omega) for k in range(len(self.terms))]
        return np.stack([np.concatenate(pair, -1) for pair in each], -1)


def law_of(setting: LawSetting, aero: AeroSetting, nodes: Array, where: str) -> Law:
    """The law of all candidate terms. ConfigError: an unknown component or term, strips that do not fit."""
    known = (*WHOLE_BODY, *BY_STRIPS)
    pairs = [(c, term_of(t, f"{where} law.{c}")) for c, terms in setting.law.items() for t in terms]
    for component in setting.law:
        if component not in known:
            what = f"key 'law': unknown component {component!r}, expected one of {', '.join(known)}"
            raise ConfigError(what, where, "rename it")
    if not pairs:
        raise ConfigError("key 'law' holds no term", where, 'add one, as lift = ["1", "alpha"]')
    if len({(c, t.text) for c, t in pairs}) < len(pairs):
        raise ConfigError("key 'law' names a term twice", where, "leave one out")
    strips = None
    if any(c in BY_STRIPS for c in setting.law):
        if setting.strips is None:
            raise ConfigError(
                "key 'strips' is missing, which strip_lift and strip_drag go by", where, "add it"
            )
        position = nodes if setting.strips.position is None else np.array(setting.strips.position)
        area = np.array(setting.strips.area)
        if len(area) != len(position) or not (area > 0).all():
            what = f"key 'strips.area': has {len(area)} areas for {len(position)} places, expected one each"
            raise ConfigError(what, where, "state areas above zero, one a place")
        strips = position, area
    return Law(aero, tuple(c for c, _ in pairs), tuple(t for _, t in pairs), strips)


def law_setting(table: Mapping[str, Any], where: str) -> LawSetting:
    """The settings of a fit, checked; a ConfigError names the key."""
    return validate(LawSetting, dict(table), where)
