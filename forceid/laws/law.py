"""A law of what pushes a body: coefficients times terms, of the air and of the ground."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from forceid.aero import flow
from forceid.config import AeroSetting, Settings
from forceid.errors import ConfigError
from forceid.laws import ground
from forceid.laws.air_components import BY_STRIPS, WHOLE_BODY, StripSetting, strip_fields, whole_body_fields
from forceid.laws.ground import Ground, GroundSetting, ground_of
from forceid.laws.state import State
from forceid.laws.terms import AIR, Term, Variables, term_of
from forceid.records import Array
from forceid.sections import Section, validate

RISE = Term("height", lambda of, time: np.asarray(0.0), {})  # m, of the ground: no force of its own


class LawSetting(Section):
    """What `forceid coefficients` fits: terms by component, air, sizes and ground, whether to choose terms.

    law: lift, drag, side (wind axes), roll, pitch, yaw (body axes), strip_lift, strip_drag; contact,
    friction, rolling. aero: left out, that of the first result. keep: components or `component.term` that
    stay whatever the evidence says.
    """

    law: dict[str, tuple[str, ...]]
    aero: AeroSetting | None = None
    strips: StripSetting | None = None
    ground: GroundSetting | None = None
    choose: bool = True
    keep: tuple[str, ...] = ()

    @property
    def of_air(self) -> bool:
        """Whether it has components of the air."""
        return any(c not in ground.COMPONENTS for c in self.law)


@dataclass(frozen=True)
class Law:
    """Terms with the component that each scales; aero, strips, ground: what those go by.

    strips: positions (strip, 3) m and areas (strip,) m2.
    """

    components: tuple[str, ...]
    terms: tuple[Term, ...]
    aero: AeroSetting | None = None
    strips: tuple[Array, Array] | None = None
    ground: Ground | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coefficients: component and term."""
        return tuple(f"{c}.{t.text}" for c, t in zip(self.components, self.terms, strict=True))

    @property
    def on_ground(self) -> bool:
        """Whether any of its terms is of the ground."""
        return any(c in ground.COMPONENTS for c in self.components)

    def only(self, which: Sequence[int]) -> Law:
        """The law of some of its terms."""
        parts = tuple(self.components[k] for k in which), tuple(self.terms[k] for k in which)
        return replace(self, components=parts[0], terms=parts[1])

    def wrench(self, value: Array, time: float | Array, at: State) -> tuple[Array, Array]:
        """Force and moment (..., 3), world axes, under coefficients (..., term)."""
        force, moment = np.zeros_like(at.velocity), np.zeros_like(at.velocity)
        if self.aero is not None:
            add(self.by_air(self.aero, value, time, at), force, moment)
        if self.ground is not None and at.touching is not None and at.touching.any():
            add(self.by_ground(self.ground, value, time, at, (force, moment)), force, moment)
        return force, moment

    def by_air(self, aero: AeroSetting, value: Array, time: float | Array, at: State) -> tuple[Array, Array]:
        """What the air does."""
        seen = flow(aero, at.air, at.R, at.omega)
        of, sums = Variables(seen, aero.lengths), dict[str, Array]()
        for k, (component, term) in enumerate(zip(self.components, self.terms, strict=True)):
            if component not in ground.COMPONENTS:
                part = np.asarray(value[..., k] * term.value(of, time))
                sums[component] = sums[component] + part if component in sums else part
        fields = whole_body_fields(sums, aero, seen)
        if self.strips is not None:
            fields |= strip_fields(sums, aero, seen, at, self.strips)
        force, moment = np.zeros_like(at.air), np.zeros_like(at.air)
        for name, (f, m) in fields.items():
            add(
                tuple(None if part is None else sums[name][..., None] * part for part in (f, m)),
                force,
                moment,
            )
        return force, moment

    def by_ground(
        self, below: Ground, value: Array, time: float | Array, at: State, others: tuple[Array, Array]
    ) -> tuple[Array, Array]:
        """What the ground does to a body under other forces and moments."""
        each = list(enumerate(zip(self.components, self.terms, strict=True)))

        def total(component: str, of: Mapping[str, Array]) -> Array:
            own = [value[..., k, None] * term.value(of, time) for k, (c, term) in each if c == component]
            return np.asarray(sum(own, np.zeros_like(of["depth"])))

        return below.wrench(total, self.rise(value), at, others)

    def rise(self, value: Array) -> Array:
        """How far (...) m the ground is above the height that is stated, under coefficients (..., term)."""
        return np.asarray(value[..., [k for k, term in enumerate(self.terms) if term is RISE]].sum(-1))

    def gaps(self, value: Array, center: Array, R: Array) -> Array:
        """Heights (..., point) m of the places of contact above the ground."""
        assert self.ground is not None
        return self.ground.gaps(center, self.ground.arms(R), self.rise(value))

    def columns(self, time: Array, at: State) -> Array:
        """Force and moment (time, 6, term) that each coefficient of one of the air makes along a path."""
        each = [self.only([k]).wrench(np.ones((1, 1)), time, at) for k in range(len(self.terms))]
        return np.stack([np.concatenate(pair, -1) for pair in each], -1)


def add(parts: Sequence[Array | None], force: Array, moment: Array) -> None:
    """Add a force and a moment to others, in place; None is none."""
    for part, whole in zip(parts, (force, moment), strict=True):
        if part is not None:
            whole += part


def law_of(setting: LawSetting, aero: AeroSetting | None, nodes: Array, where: str) -> Law:
    """The law of all candidate terms. ConfigError: an unknown component or term, strips that do not fit."""
    known = (*WHOLE_BODY, *BY_STRIPS, *ground.COMPONENTS)
    for component in setting.law:
        if component not in known:
            what = f"key 'law': unknown component {component!r}, expected one of {', '.join(known)}"
            raise ConfigError(what, where, "rename it")
    pairs = [
        (c, term_of(t, f"{where} law.{c}", ground.VARIABLES if c in ground.COMPONENTS else AIR))
        for c, terms in setting.law.items()
        for t in terms
    ]
    if not pairs:
        raise ConfigError("key 'law' holds no term", where, 'add one, as lift = ["1", "alpha"]')
    if len({(c, t.text) for c, t in pairs}) < len(pairs):
        raise ConfigError("key 'law' names a term twice", where, "leave one out")
    strips = strips_of(setting, nodes, where) if any(c in BY_STRIPS for c in setting.law) else None
    below = ground_below(setting, where) if any(c in ground.COMPONENTS for c in setting.law) else None
    if setting.ground is not None and setting.ground.height is None and "contact" in setting.law:
        pairs.append(("contact", RISE))
    return Law(tuple(c for c, _ in pairs), tuple(t for _, t in pairs), aero, strips, below)


def strips_of(setting: LawSetting, nodes: Array, where: str) -> tuple[Array, Array]:
    """Positions (strip, 3) m and areas (strip,) m2 of the blade elements."""
    if setting.strips is None:
        raise ConfigError("key 'strips' is missing, which strip_lift and strip_drag go by", where, "add it")
    position = nodes if setting.strips.position is None else np.array(setting.strips.position)
    area = np.array(setting.strips.area)
    if len(area) != len(position) or not (area > 0).all():
        what = f"key 'strips.area': has {len(area)} areas for {len(position)} places, expected one each"
        raise ConfigError(what, where, "state areas above zero, one a place")
    return position, area


def ground_below(setting: LawSetting, where: str) -> Ground:
    """The ground that contact, friction and rolling go by."""
    if setting.ground is None:
        what = "key 'ground' is missing, which contact, friction and rolling go by"
        raise ConfigError(what, where, "add [ground] with radius or points, m, and height")
    if setting.ground.glued and not setting.law.get("contact"):
        what = "key 'law.contact' is missing, which a ground that is glued goes by"
        raise ConfigError(what, where, 'add contact = ["depth", "depth_rate"], or leave out glued')
    if "rolling" in setting.law and setting.ground.radius is None:
        raise ConfigError("key 'ground.radius' is missing, which rolling goes by", where, "add it, m")
    return ground_of(setting.ground, setting.law)


def law_setting(table: Mapping[str, Any], where: str) -> LawSetting:
    """The settings of a fit, checked; a ConfigError names the key."""
    others = {"import", *Settings.model_fields} - LawSetting.model_fields.keys()  # one file may serve all
    return validate(LawSetting, {k: v for k, v in table.items() if k not in others}, where)
