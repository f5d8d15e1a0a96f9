"""Loads as they are found, by where they act, and what may hide beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.records.arrays import Array, Claims, Flags
from forceid.records.verdict import Verdict


@dataclass(frozen=True)
class Loads:
    """Applied loads p of f = B p. load (time, load) N, load_cov (time, load, load_2) N2.

    null_space (load, null): directions of p the motion cannot see. estimable (functional, load): rows
    whose combination of loads is determined. chi_square (time,): misfit of resultants and
    forces on modes, with `dof` degrees of freedom.
    """

    name: tuple[str, ...]
    load: Array
    load_cov: Array
    null_space: Array
    estimable: Array
    chi_square: Array
    dof: int


@dataclass(frozen=True)
class ModalForces:
    """Forces g = shape^T f of the applied loads f, body axes, on modes of a body: force (time, mode) N.

    shape (mode, node, 3): of the modes, of unit norm, body axes; cov (time, mode, mode) N2; with_wrench
    (time, 6, mode): covariance with force and moment, world axes, None where their errors share nothing.
    """

    shape: Array
    force: Array
    cov: Array
    with_wrench: Array | None = None


@dataclass(frozen=True)
class Interface(Claims):
    """What passes through the joints of a body in parts, as the first part named does to the second.

    name (joint,), parts: the pair of each; force (time, joint, 3) N and moment (time, joint, 3) N m about
    point (time, joint, 3) m, world axes; wrench_cov (time, joint, 6, 6). determined (joint,): whether the
    motion tells a joint's wrench; where not, it is NaN, and null_space (joint, 6, null) holds the wrenches
    about the mass center of all parts that leave no trace. gap (time, joint, 3) m: by which the second part
    is off the first at the joint. chi_square (time,): misfit of the balances that repeat each other, with
    `dof` degrees of freedom; consistency: its mean per degree of freedom. verdict: of the joints alone.
    """

    name: tuple[str, ...]
    parts: tuple[tuple[str, str], ...]
    force: Array
    moment: Array
    wrench_cov: Array
    point: Array
    determined: Flags
    null_space: Array
    gap: Array
    chi_square: Array
    dof: int
    verdict: Verdict

    @property
    def consistency(self) -> float:
        """Mean misfit per degree of freedom: one or less where the balances agree; NaN without any."""
        seen = np.isfinite(self.chi_square)
        return float(self.chi_square[seen].mean() / self.dof) if self.dof and seen.any() else float("nan")


@dataclass(frozen=True)
class HiddenLoad:
    """What an estimate leaves out.

    band (wrench,) Hz: up to which each load was followed, 0 where none was found; amplitude (frequency,
    wrench) N, N m: of an oscillating load at `frequency` (frequency,) Hz that would have gone unseen with
    probability one half, along each world axis. NaN where nothing is known.
    """

    frequency: Array
    amplitude: Array
    band: Array


@dataclass(frozen=True)
class Impulses:
    """What the loads give in each piece of a record in which they are of one character.

    start, stop (piece,) s; impulse (piece, 6) N s and N m s, about the mass center, world axes, from the last
    sample before the start to the first behind the stop; cov (piece, 6, 6).
    """

    start: Array
    stop: Array
    impulse: Array
    cov: Array


@dataclass(frozen=True)
class Feet:
    """The force of the ground on each of two feet, world axes.

    name (foot,); force (time, foot, 3) N with force_cov (time, foot, 3, 3); contact (time, foot): 1 where it
    touches; share (time, foot) of the whole, and share_std (time,): zero where one stands alone.
    """

    name: tuple[str, ...]
    force: Array
    force_cov: Array
    contact: Array
    share: Array
    share_std: Array
