"""A body whose mass changes along the record: a motor that burns, a tank that empties.

Its force is m(t) (a - g), the momentum that leaves with the jet part of it: thrust acts on what is left.
Every part of the body is taken to lose the same share, so that the mass center stays where it is in the body
and the inertia goes with the mass: the moment is J w' + w x J w, with J the stated one times m(t) over the
stated mass. What the jet takes away by its turn is part of it. So all that holds of a flight of constant mass
holds here, times that share.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.methods.problem import Solution
from forceid.records import Array, Body, Motion, Recording, Witness


def share_of_mass(body: Body, motion: Motion, mass: float) -> Array | None:
    """Mass along the motion (time,), over `mass` that the body is stated with; None where it does not change.

    Straight across gaps. DataError: the mass is never known, or falls to zero.

    >>> share_of_mass(Body(mass_rate=-0.5), Motion(np.arange(3.0)), 2.0).tolist()
    [1.0, 0.75, 0.5]
    """
    if motion.current_mass is not None:
        seen = np.isfinite(motion.current_mass)
        if not seen.any():
            raise DataError("is nothing but NaN", "/motion/current_mass", "give the mass, or leave it out")
        course, where = (
            np.interp(motion.time, motion.time[seen], motion.current_mass[seen]),
            "/motion/current_mass",
        )
    elif body.mass_rate:
        course, where = mass + body.mass_rate * (motion.time - motion.time[0]), "/body/mass_rate"
    else:
        return None
    if (course <= 0).any():
        k = int(np.argmax(course <= 0))
        what = f"leaves {course[k]:.3g} kg at {motion.time[k]:.6g} s, expected more than zero"
        raise DataError(what, where, "correct it, or cut the record")
    return np.asarray(course / mass)


def check_constant(recording: Recording, settings: Settings) -> None:
    """A ConfigError where mass changes beside what is solved for with a constant one."""
    body = recording.body
    if recording.motion.current_mass is None and not body.mass_rate:
        return
    turns = body.internal_momentum is not None and bool(body.internal_momentum.any())
    beside = {
        "what turns inside": turns or body.rotor_axis is not None, "parts": bool(settings.part),
        "known loads": bool(settings.known_load) or recording.known_loads is not None,
        "aero": settings.aero is not None,
    }  # fmt: skip
    for name in (name for name, asked in beside.items() if asked):
        what = f"changes beside {name}, expected a constant one there"
        raise ConfigError(what, "the mass", f"leave out mass_rate and /motion/current_mass, or {name}")


def of_changing_mass(solution: Solution, share: Array) -> Solution:
    """The solution of a flight of constant mass as that of one with this share (time,) of it."""
    state, each = solution.state, share[:, None]
    modal = state.modal_cov
    if modal is not None:
        modal = modal.copy()
        modal[:, :6] *= share[:, None, None]
    state = replace(
        state, force=each * state.force, moment=each * state.moment, H=each * state.H, modal_cov=modal,
        wrench_cov=each[..., None] ** 2 * state.wrench_cov, given=None,
    )  # fmt: skip
    hidden = solution.hidden
    if hidden is not None:
        hidden = replace(hidden, amplitude=share.max() * hidden.amplitude)
    return replace(solution, state=state, hidden=hidden, impulses=None)


def seen_by_witness(witness: Witness | None, share: Array) -> Witness | None:
    """The same of the plain route."""
    if witness is None:
        return None
    each = share[:, None]
    return replace(
        witness, force=each * witness.force, moment=each * witness.moment,
        force_std=each * witness.force_std, moment_std=each * witness.moment_std,
    )  # fmt: skip
