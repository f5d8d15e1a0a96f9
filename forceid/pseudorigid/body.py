"""Affine bodies: a second moment, a material, and their motion.

The master system F'' E = -dW/dF (+ Lambda cof F where det F = 1 is imposed) is regular at every det F > 0,
without a chart and without a special case at equal stretches. Source: pseudo-rigid bodies, sections 1, 9.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import ConfigError, DataError
from forceid.pseudorigid.material.material_law import Material, check_above, check_material_of
from forceid.pseudorigid.motion.constrained import check_volume, rattle_steps
from forceid.pseudorigid.motion.reference import Load, drive_of, reference
from forceid.pseudorigid.motion.splittings import COMPOSITIONS, SPLITTINGS, Splitting, split_steps
from forceid.pseudorigid.motion.system import EVENT_DTYPE, AffineSystem, Path, State, side_by_side
from forceid.pseudorigid.motion.trajectory import Trajectory, stop_of, trajectory_of
from forceid.pseudorigid.validation import (
    STEPS_AT_MOST,
    check_step,
    instants,
    validated_second_moment,
    validated_start,
)
from forceid.records import Array

BODIES_TOGETHER = 1024  # bodies whose arrays stay in the cache of a processor
REFERENCE = "dop853"
METHODS = (*SPLITTINGS, REFERENCE)  # of `simulate`; where det F = 1, the compositions and the reference
PHASE = {  # rad a step of the fastest vibration, where no step is given
    "verlet": 0.05, "suzuki_4": 0.3, "kahan_li_6": 0.6, "blanes_moan_6": 1.0, "kahan_li_8": 1.0,
}  # fmt: skip
UNSTABLE = 2.0  # rad a step, for Verlet


@dataclass(frozen=True)
class Body:
    """Body of second moment E = int rho X X^T dX (3, 3), no factor 1/2, and material; or E = mu I by mu.

    incompressible: keep det F = 1 by a multiplier, which then carries what Gamma of the material did; also by
    `material.incompressible`. mass kg: of a body that a force moves. Raises DataError where E is not
    symmetric positive definite: a flat body has no affine motion of its own.
    Source: pseudo-rigid bodies, section 1.

    >>> from forceid.pseudorigid.material.materials import MooneyRivlin
    >>> body = Body(1.7, MooneyRivlin(0.6, 0.25, 0.4, 3.0))
    >>> F0, time = np.diag([1.02, 1.0, 0.98]), np.linspace(0, 10, 101)
    >>> motion = body.simulate(F0, np.zeros((3, 3)), time, method="verlet", step=0.05)
    >>> bool(np.ptp(motion.energy) < 1e-5), motion.event
    (True, None)
    """

    second_moment: ArrayLike
    material: Material
    incompressible: bool = False
    mass: float | None = None
    system: AffineSystem = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        E = validated_second_moment(self.second_moment)
        check_material_of("Body", self.material)
        if self.mass is not None:
            check_above("Body", "mass", self.mass)
        object.__setattr__(self, "second_moment", E)
        object.__setattr__(self, "system", AffineSystem(self.material, E, self.constrained))

    @property
    def constrained(self) -> bool:
        """Whether det F = 1 is imposed."""
        return self.incompressible or bool(getattr(self.material, "incompressible", False))

    def simulate(
        self,
        F0: ArrayLike,
        dF0: ArrayLike,
        time: ArrayLike,
        method: str | None = None,
        step: float | None = None,
        *,
        force: Load | None = None,
        first_moment: Load | None = None,
        weight: ArrayLike | None = None,
        damping: float = 0.0,
        center: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
    ) -> Trajectory:
        """Motion from F0, dF0 (..., 3, 3) at time[0] through the samples time (time,) s.

        method: verlet (where none is given), suzuki_4, kahan_li_6, kahan_li_8 (compositions; of RATTLE where
        det F = 1), blanes_moan_6 (compressible only), dop853 (the reference). step: the longest, s; samples
        are reached by equal steps. Without it, from the fastest vibration at the start. Bodies of a batch
        share samples, step and loads, and move independently.

        A body is driven by any of: force (3,) N, without weight, and first_moment N = sum f X^T (3, 3) N m of
        applied forces f at X, rows in world, columns in body axes, about the mass center; each a constant, a
        function of t, or one of t and an `AffineState`; weight (3,) N, world axes; damping J s of Kelvin and
        Voigt, P = dW/dF + damping F d(F^T F)/dt; center m and velocity m/s (3,) of the mass center at the
        start, zero if not given. Force and weight need `mass`. dop853 alone moves driven bodies, and no step
        is longer than the samples are apart.

        Raises DataError for det F0 <= 0, for incompressible bodies with det F0 != 1 or tr(F0^-1 dF0) != 0,
        for a step beyond the stability of Verlet, for loads of another shape or not finite; ConfigError for
        an unknown method. Source: pseudo-rigid bodies, sections 1 and 9.

        >>> from forceid.pseudorigid.material.materials import MooneyRivlin
        >>> ball = Body(0.1, MooneyRivlin.natural(2.0, 0.5, 3.0), mass=0.5)
        >>> pull = lambda t: [[0.0, 0.2 * np.sin(9 * t), 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
        >>> moved = {"first_moment": pull, "weight": [0, 0, -4.905], "velocity": [3.0, 0, 0], "damping": 0.02}
        >>> ball.simulate(np.eye(3), np.zeros((3, 3)), [0.0, 0.5, 1.0], **moved).center.round(6).tolist()
        [[0.0, 0.0, 0.0], [1.5, 0.0, -1.22625], [3.0, 0.0, -4.905]]
        """
        F, V = validated_start(F0, dF0)
        t = instants(time)
        if self.constrained:
            check_volume(F, V)
        lead = F.shape[:-2]
        F, V = F.reshape(-1, 3, 3), V.reshape(-1, 3, 3)
        drive = None
        if damping or any(x is not None for x in (force, first_moment, weight, center, velocity)):
            if method not in (None, REFERENCE):
                self._table(method)
                raise ConfigError(f"method {method!r} moves free bodies", "simulate:", f"take {REFERENCE}")
            drive = drive_of(force, first_moment, weight, damping, self.mass, (center, velocity))
        if drive is not None or method == REFERENCE:
            each = [reference(self.system, f, v, t, drive=drive) for f, v in zip(F, V, strict=True)]
            return trajectory_of(self.system, t, side_by_side(each), lead, REFERENCE, drive=drive)
        method = "verlet" if method is None else method
        table = self._table(method)
        step = self._step(method, step, F, V, t)
        counts = np.maximum(1, np.ceil(np.diff(t) / step - 1e-9)).astype(int)
        blocks = [slice(i, i + BODIES_TOGETHER) for i in range(0, len(F), BODIES_TOGETHER)]
        path = side_by_side([self._marched(table, F[b], V[b], t, counts) for b in blocks])
        name, longest = f"rattle_{method}" if self.constrained else method, np.diff(t) / counts
        return trajectory_of(self.system, t, path, lead, name, float(longest.max(initial=0.0)))

    def _table(self, method: str) -> Splitting:
        """The splitting of a method by name."""
        offered = COMPOSITIONS if self.constrained else SPLITTINGS
        if method not in offered:
            what = "does not keep det F = 1" if method in SPLITTINGS else "is unknown"
            names = ", ".join([*offered, REFERENCE])
            raise ConfigError(f"method {method!r} {what}", "simulate:", f"choose one of {names}")
        return offered[method]

    def _step(self, method: str, step: float | None, F: Array, V: Array, time: Array) -> float:
        """The step given, looked at; or one from the fastest rate of all bodies at the start."""
        if step is not None:
            check_step(step, float(np.ptp(time)))
        if step is not None and (method != "verlet" or self.constrained):
            return step
        vibration = float(self.system.vibration(F).max())
        if step is None:
            fastest = max(vibration, float(self.system.rate(F, V).max()))
            span = float(np.ptp(time))
            found = PHASE[method] / fastest if fastest > 0 else span or 1.0
            if span / found > STEPS_AT_MOST:
                what = f"vibrates at {fastest:.1e} rad/s: {span / found:.1e} steps over {span:g} s"
                raise DataError(what, "the body at the start", 'start it nearer to rest, or give a "step"')
            return found
        if step * vibration > UNSTABLE:
            what = f"is {step:g} s, beyond {UNSTABLE / vibration:.3g} s, where Verlet grows without bound"
            raise DataError(what, "step", "take a shorter one, or none: then it follows from that rate")
        return step

    def _marched(self, table: Splitting, F: Array, V: Array, time: Array, counts: Array) -> Path:
        """The path of one block of free bodies (body, 3, 3)."""
        state, steps = State(F, V), rattle_steps if self.constrained else split_steps
        # component first, as the state is: whole rows are written
        path, speed = (np.moveaxis(np.empty((len(time), 3, 3, len(F))), -1, 1) for _ in range(2))
        path[0], speed[0] = state.F, state.V
        kind, when = np.full(len(F), "", EVENT_DTYPE), np.full(len(F), np.nan)
        with np.errstate(all="ignore"):  # a body that leaves det F > 0 is stopped and told
            for k, n in enumerate(counts):
                before = state.stopped.copy()
                steps(self.system, state, (time[k + 1] - time[k]) / n, int(n), table)
                path[k + 1], speed[k + 1] = state.F, state.V
                for i in np.flatnonzero(state.stopped & ~before):
                    kind[i], when[i] = stop_of(self.system, path[k, i], speed[k, i], time[k], time[k + 1])
                if state.stopped.any():
                    path[k + 1, state.stopped] = speed[k + 1, state.stopped] = np.nan
                    if state.stopped.all():
                        path[k + 1 :] = speed[k + 1 :] = np.nan
                        break
        return Path(path, speed, kind, when, np.zeros((len(time), len(F), 0)))
