"""What a wrong body costs: force and moment per percent of mass and inertia, per millimeter of a marker.

Averages over a record of the biases of `wrong_body`. A bias too small to stand out of the noise is followed
by the smoother in part only.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.body_errors import (
    SYMMETRIC,
    Turning,
    after_fit,
    center_inertia,
    columns,
    marker_maps,
    shape_columns,
    turning_of,
    wrong_mass,
)
from forceid.flight.channels import CHANNEL_SAMPLES
from forceid.flight.smoother import FlightState
from forceid.records import Array, Flags
from forceid.rounding import ROUNDED


class Unit(float, Enum):
    """Units that costs are told in: of a mass, an inertia, a shape or a clock; m."""

    PERCENT = 0.01
    MILLIMETER = 1e-3


@dataclass(frozen=True)
class Cost:
    """Force N and moment N m, rms length over time, that an error of the stated size costs at worst."""

    force: float
    moment: float


@dataclass(frozen=True)
class Budget:
    """What errors of the body cost, each at the direction, marker or axis that is worst.

    mass: per percent; center: per mm; inertia: per percent of one principal moment; marker: per mm of the
    marker named; shape: per 5 % of error, independent from marker to marker, of the shapes of deformation,
    if the smoother follows loads as fast as they vibrate, or None where none is used; clock: per percent by
    which the clock is slow, of a force that excludes weight.
    """

    mass: Cost
    center: Cost
    inertia: Cost
    marker: Cost
    marker_name: str
    shape: Cost | None = None
    clock: Cost | None = None

    def numbers(self) -> dict[str, float]:
        """Numbers by name, force N and moment N m: what a result carries."""
        found: dict[str, float] = {}
        for name, (unit, _) in UNITS.items():
            cost = getattr(self, name)
            if cost is not None:
                found |= {f"{name}_force_{unit}": cost.force, f"{name}_moment_{unit}": cost.moment}
        return {k: v for k, v in found.items() if np.isfinite(v)}

    @property
    def summary(self) -> list[str]:
        """The same for people, a line each."""

        def digits(v: float) -> str:
            return f"{v:.2g}" if v > ROUNDED else "0"

        lines = []
        for name, (_, words) in UNITS.items():
            cost = getattr(self, name)
            if cost is not None and np.isfinite(cost.force):
                moment = f", {digits(cost.moment)} N m" if np.isfinite(cost.moment) else ""
                lines.append(f"{digits(cost.force)} N{moment} {words.format(self.marker_name)}")
        return lines


UNITS = {
    "mass": ("per_percent", "per percent of mass"),
    "center": ("per_mm", "per mm of mass center"),
    "inertia": ("per_percent", "per percent of a principal moment of inertia"),
    "marker": ("per_mm", "per mm of the place of marker {}"),
    "clock": ("per_percent", "per percent of the clock"),
    "shape": ("per_5_percent", "per 5 % of the shapes of deformation, at most"),
}


def body_sensitivity(
    kin: Kinematics,
    deformation: Deformation,
    state: FlightState,
    node: tuple[str, ...],
    gravity: Array,
    arm: Array | None = None,
) -> Budget:
    """The budget of an estimate: what each kind of error of the body costs at worst.

    node: names of the nodes; gravity (3,) m/s2; arm (time, 3) m: from the point that the
    moment is about to the mass center, None where it is the mass center. NaN where no rotation is known.
    """
    motion = turning_of(kin, deformation, state, arm)
    every = slice(None, None, max(1, len(kin.time) // CHANNEL_SAMPLES))
    few = Turning(
        kin, motion.rotation[every], motion.omega[every], motion.rate[every], motion.force[every],
        motion.moment[every], None if arm is None else arm[every],
    )  # fmt: skip
    force, moment = (gram(c) for c in columns(few))
    loads = motion.force, motion.moment
    mass = Cost(*(length(v) for v in wrong_mass(few, Unit.PERCENT)))

    def cost(d: Array, dJ: Array) -> Cost:
        both = np.concatenate([d, dJ])
        return Cost(*(float(largest_rms(G, m)) for G, m in ((force, d), (moment, both))))

    accelerated = state.force + kin.inertia.mass * gravity
    none, shapes = np.zeros((3, 1)), len(kin.shapes) > 0 and kin.attitude
    values, axes = principal(kin.inertia.tensor)
    scale = [Unit.PERCENT * v * np.outer(a, a) for v, a in zip(values, axes.T, strict=True)]
    by_axis = [cost(none, np.array([[dJ[i, j]] for i, j in SYMMETRIC])) for dJ in scale]
    placed, name = Cost(np.nan, np.nan), ""
    if kin.attitude and kin.inertia.line is None and kin.seen.any():
        d, dJ = (Unit.MILLIMETER * part for part in marker_maps(kin))
        each = largest_rms(force, d), largest_rms(moment, np.concatenate([d, dJ], 1))
        # over the loads themselves, so that markers can be compared
        over = [c / max(length(v), np.finfo(float).tiny) for c, v in zip(each, loads, strict=True)]
        worst = int(np.nansum(over, 0).argmax())
        placed, name = Cost(*(float(c[worst]) for c in each)), node[np.flatnonzero(kin.seen)[worst]]
    return Budget(
        mass,
        cost(Unit.MILLIMETER * np.eye(3), Unit.MILLIMETER * center_inertia(kin)),
        max(by_axis, key=lambda c: c.moment),
        placed,
        name,
        shape_cost(motion, deformation.amplitude) if shapes else None,
        # accelerations and rates of momentum go with the square of the rate of a clock
        Cost(*(2 * Unit.PERCENT * length(v) for v in (accelerated, motion.moment))),
    )


def principal(tensor: Array) -> tuple[Array, Array]:
    """Principal moments (3,) and axes (3, 3), NaN where the tensor is not known."""
    if not np.isfinite(tensor).all():
        return np.full(3, np.nan), np.full((3, 3), np.nan)
    values, axes = np.linalg.eigh(tensor)
    return np.asarray(values), np.asarray(axes)


def shape_cost(motion: Turning, amplitude: Array) -> Cost:
    """Cost of shapes that are wrong by a twentieth of their rms, independently at every marker."""
    kin = motion.kin
    rows = np.repeat(kin.seen, 3)
    center, spread = after_fit(kin, np.eye(len(rows))[:, rows])
    force = moment = 0.0
    for shape, q in zip(kin.shapes, amplitude.T, strict=True):
        size = (5 * Unit.PERCENT) ** 2 * float((shape[kin.seen] ** 2).mean())
        by_center, by_spread = shape_columns(motion, q)
        force += size * float(np.sum(gram(by_center) * (center @ center.T)))
        moment += size * float(np.sum(gram(by_spread) * (spread @ spread.T)))
    return Cost(float(np.sqrt(force)), float(np.sqrt(moment)))


def gram(c: Array) -> Array:
    """Mean over time of c^T c (parameter, parameter), where it is known."""
    known = np.isfinite(c).all((1, 2))
    return (
        np.asarray(np.einsum("tap,taq->pq", c[known], c[known]) / known.sum())
        if known.any()
        else np.full((c.shape[2], c.shape[2]), np.nan)
    )


def largest_rms(G: Array, m: Array) -> Array:
    """Largest rms length (...) over unit directions e of the columns with Gram matrix G times m (...) e."""
    square = m.mT @ G @ m
    known: Flags = np.asarray(np.isfinite(square).all((-2, -1)))
    values = np.linalg.eigvalsh(np.where(known[..., None, None], square, 0.0))[..., -1]
    return np.asarray(np.where(known, np.sqrt(np.maximum(values, 0.0)), np.nan))


def length(v: Array) -> float:
    """Rms length of vectors (time, 3), NaN where none is known."""
    square = (v**2).sum(1)
    known = np.isfinite(square)
    return float(np.sqrt(square[known].mean())) if known.any() else np.nan
