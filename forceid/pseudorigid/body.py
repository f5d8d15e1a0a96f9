"""Affine bodies: a second moment, a material, and their motion.

The master system F'' E = -dW/dF (+ Lambda cof F where det F = 1 is imposed) is regular at every det F > 0,
without a chart and without a special case at equal stretches. Source: pseudo-rigid bodies, sections 1, 9.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import ConfigError, DataError
from forceid.pseudorigid.factors.cofactors import EYE, determinant
from forceid.pseudorigid.material.material_law import Material, check_material_of, validated_constant
from forceid.pseudorigid.motion.constrained import RATTLE, check_volume, multiplier
from forceid.pseudorigid.motion.events import EVENT_DTYPE, Event, EventKinds, stop_of, tension_times
from forceid.pseudorigid.motion.integrators import STEPPERS, Stepper
from forceid.pseudorigid.motion.invariants import angular_momentum, circulation
from forceid.pseudorigid.motion.reference import reference
from forceid.pseudorigid.motion.system import AffineSystem, State
from forceid.pseudorigid.motion.trajectory import Trajectory
from forceid.pseudorigid.validation import instants, matrices, real_values
from forceid.records import Array

BODIES_TOGETHER = 1024  # bodies whose arrays stay in the cache of a processor
REFERENCE = "dop853"
METHODS = (*STEPPERS, REFERENCE)  # of `simulate`; where det F = 1, the compositions and the reference
PHASE = {  # rad a step of the fastest vibration, where no step is given
    "verlet": 0.05, "suzuki_4": 0.3, "blanes_moan_4": 0.4, "yoshida_6": 0.4, "kahan_li_6": 0.6,
    "blanes_moan_6": 1.0, "kahan_li_8": 1.0, "implicit_midpoint": 0.05, "energy": 0.05,
}  # fmt: skip
STEPS_AT_MOST = 1e8  # steps of one motion: an hour and more
UNSTABLE = 2.0  # rad a step, for Verlet


@dataclass(frozen=True)
class Body:
    """Body of second moment E = int rho X X^T dX (3, 3), no factor 1/2, and material; or E = mu I by mu.

    incompressible: keep det F = 1 by a multiplier, which then carries what Gamma of the material did; also by
    `material.incompressible`. Raises DataError where E is not symmetric positive definite: a flat body has no
    affine motion of its own. Source: pseudo-rigid bodies, section 1.

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
    system: AffineSystem = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        E = real_values(self.second_moment, "second_moment", "give E = int rho X X^T dX, or mu")
        E = E * EYE if E.ndim == 0 else E
        check_second_moment(E)
        check_material_of("Body", self.material)
        object.__setattr__(self, "second_moment", E)
        object.__setattr__(self, "system", AffineSystem(self.material, E))

    @property
    def constrained(self) -> bool:
        """Whether det F = 1 is imposed."""
        return self.incompressible or bool(getattr(self.material, "incompressible", False))

    def simulate(
        self,
        F0: ArrayLike,
        dF0: ArrayLike,
        time: ArrayLike,
        method: str = "verlet",
        step: float | None = None,
    ) -> Trajectory:
        """Motion from F0, dF0 (..., 3, 3) at time[0] through the samples time (time,) s.

        method: verlet, suzuki_4, yoshida_6, kahan_li_6, kahan_li_8 (compositions; of RATTLE where det F = 1),
        blanes_moan_4, blanes_moan_6, implicit_midpoint, energy (compressible only), dop853 (the reference).
        step: the longest, s; samples are reached by equal steps. Without it, from the fastest vibration at
        the start. Bodies of a batch share samples and step, and move independently. Raises DataError for
        det F0 <= 0, for incompressible bodies with det F0 != 1 or tr(F0^-1 dF0) != 0, for a step beyond the
        stability of Verlet; ConfigError for an unknown method. Source: pseudo-rigid bodies, section 9.
        """
        F, V = validated_start(F0, dF0)
        t = instants(time)
        if self.constrained:
            check_volume(F, V)
        lead = F.shape[:-2]
        F, V = F.reshape(-1, 3, 3), V.reshape(-1, 3, 3)
        if method == REFERENCE:
            parts, longest = [self._referred(F, V, t)], float("nan")
        else:
            stepper = self._stepper(method)
            step = self._step(method, step, F, V, t)
            counts = np.maximum(1, np.ceil(np.diff(t) / step - 1e-9)).astype(int)
            longest = float((np.diff(t) / counts).max(initial=0.0))
            blocks = [slice(i, i + BODIES_TOGETHER) for i in range(0, len(F), BODIES_TOGETHER)]
            parts = [self._marched(stepper, F[b], V[b], t, counts) for b in blocks]
        path, speed = (np.concatenate([p[i] for p in parts], 1) for i in (0, 1))
        kind, when = (np.concatenate([p[i] for p in parts]) for i in (2, 3))
        return self._record(t, path, speed, kind, when, lead, method, longest)

    def _stepper(self, method: str) -> Stepper:
        """The steps of a method by name."""
        offered = RATTLE if self.constrained else STEPPERS
        if method not in offered:
            what = f"method {method!r} is unknown"
            if method in STEPPERS:
                what = f"method {method!r} does not keep det F = 1"
            raise ConfigError(what, "simulate:", f"choose one of {', '.join([*offered, REFERENCE])}")
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
            raise DataError(what, "step", 'take a shorter one, or method="implicit_midpoint"')
        return step

    def _marched(
        self, stepper: Stepper, F: Array, V: Array, time: Array, counts: Array
    ) -> tuple[Array, Array, EventKinds, Array]:
        """F, V (time, body, 3, 3), kinds and times of stops of one block of bodies."""
        state = State(F, V)
        # component first, as the state is: whole rows are written
        path, speed = (np.moveaxis(np.empty((len(time), 3, 3, len(F))), -1, 1) for _ in range(2))
        path[0], speed[0] = state.F, state.V
        kind, when = np.full(len(F), "", EVENT_DTYPE), np.full(len(F), np.nan)
        stop = partial(stop_of, self.system, constrained=self.constrained)
        with np.errstate(all="ignore"):  # a body that leaves det F > 0 is stopped and told
            for k, n in enumerate(counts):
                before = state.stopped.copy()
                stepper(self.system, state, (time[k + 1] - time[k]) / n, int(n))
                path[k + 1], speed[k + 1] = state.F, state.V
                for i in np.flatnonzero(state.stopped & ~before):
                    kind[i], when[i] = stop(path[k, i], speed[k, i], time[k], time[k + 1])
                if state.stopped.any():
                    path[k + 1, state.stopped] = speed[k + 1, state.stopped] = np.nan
                    if state.stopped.all():
                        path[k + 1 :] = speed[k + 1 :] = np.nan
                        break
        return path, speed, kind, when

    def _referred(self, F: Array, V: Array, time: Array) -> tuple[Array, Array, EventKinds, Array]:
        """The same by the reference integrator, body by body."""
        found = [reference(self.system, f, v, time, self.constrained) for f, v in zip(F, V, strict=True)]
        kinds = np.array([p.kind for p in found], EVENT_DTYPE)
        stops = np.array([p.stop for p in found])
        return np.stack([p.F for p in found], 1), np.stack([p.V for p in found], 1), kinds, stops

    def _record(
        self,
        time: Array,
        F: Array,
        V: Array,
        kind: EventKinds,
        when: Array,
        lead: tuple[int, ...],
        method: str,
        step: float,
    ) -> Trajectory:
        """Invariants, multiplier and events of F, V (time, body, 3, 3)."""
        system, E = self.system, self.system.E
        ended = np.isnan(F[..., 0, 0])
        known = F if not ended.any() else np.where(ended[..., None, None], EYE, F)
        energy = np.where(ended, np.nan, system.energy(known, V))
        pressure = None
        stopped = kind != ""
        if self.constrained:
            pressure = np.where(ended, np.nan, multiplier(system, known, V))
            tension = tension_times(time, F, V, pressure, system)
            tense = ~np.isnan(tension) & ~stopped
            kind, when = np.where(tense, "tension", kind), np.where(tense, tension, when)
        event = None
        if (kind != "").any():
            event = Event(kind.reshape(lead), when.reshape(lead), stopped.reshape(lead))
        shape = (len(time), *lead)
        return Trajectory(
            time,
            F.reshape(*shape, 3, 3),
            V.reshape(*shape, 3, 3),
            energy.reshape(shape),
            angular_momentum(F, V, E).reshape(*shape, 3),
            circulation(F, V, E).reshape(*shape, 3),
            None if pressure is None else pressure.reshape(shape),
            event,
            f"rattle_{method}" if self.constrained and method != REFERENCE else method,
            step,
        )


def check_second_moment(E: Array) -> None:
    """DataError unless E (3, 3) is symmetric positive definite."""
    where = "second_moment"
    if E.shape != (3, 3):
        raise DataError(f"has shape {E.shape}, expected (3, 3)", where, "give E = int rho X X^T dX, or mu")
    if not np.isfinite(E).all() or np.abs(E - E.T).max() > 1e-12 * np.abs(E).max():
        raise DataError("is not a finite symmetric matrix", where, "give E = int rho X X^T dX")
    least, _, most = np.linalg.eigvalsh(E)
    if not least > 1e-12 * most:
        what = f"has the eigenvalue {least:.3g} beside {most:.3g}, expected all positive"
        advice = "a flat or thin body has no affine motion across: use a rigid body, or give it thickness"
        raise DataError(what, where, advice)


def validated_start(F0: ArrayLike, dF0: ArrayLike) -> tuple[Array, Array]:
    """F and V (..., 3, 3) of one shape, copied. DataError where they are not the start of a motion."""
    F, V = matrices(F0, "F0"), matrices(dF0, "dF0")
    try:
        F, V = (A.copy() for A in np.broadcast_arrays(F, V))
    except ValueError:
        what = f"have shapes {F.shape} and {V.shape}, which do not go together"
        raise DataError(what, "F0 and dF0", "give a rate for every start") from None
    if not F.size:
        raise DataError("holds no body", "F0", "give at least one matrix")
    J = determinant(F)
    if not (J > 0).all():
        what = f"has det F0 = {float(J.min()):.6g}, expected > 0"
        raise DataError(what, "F0", "exchange two columns, or flatten the body less")
    return F, V


def check_step(step: float, span: float) -> None:
    """DataError where a step (s) is not above zero, or takes no end of steps over a span (s)."""
    validated_constant("simulate", "step", step)
    if not (np.isfinite(step) and step > 0):
        raise DataError(f"is {step:g} s, expected > 0", "step", "give a positive step")
    if span / step > STEPS_AT_MOST:
        what = f"is {step:g} s, {span / step:.1e} of them over {span:g} s"
        raise DataError(what, "step", f"give one of {span / STEPS_AT_MOST:.2g} s or more, or fewer samples")
