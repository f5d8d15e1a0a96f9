"""First moments of force of an affine body, and what its markers and its material leave open."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from forceid.config import Settings
from forceid.errors import ForceIdError
from forceid.estimation.affine.applied import applied_moments, row_by_row
from forceid.estimation.affine.motion import AffineMotion, affine_motion
from forceid.estimation.body.material import Solid, solid_of
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import engine
from forceid.pseudorigid import circulation
from forceid.records import Array, Finding, Level

UNCLEAR = 0.2  # of F, in a frame


def observed_first_moments(
    solution: Solution, settings: Settings
) -> tuple[AffineMotion | None, tuple[Finding, ...]]:
    """The affine motion of a flight smoothed at the affine level, and what is open of it; None elsewhere."""
    kin, deformation = solution.kinematics, solution.deformation
    if kin.model != "affine" or solution.smoothing is None or deformation.motion_cov is None:
        return None, ()
    motion = affine_motion(kin, solution.state, deformation)
    said = undetermined(solution, motion, settings.model == "affine")
    solid = None if kin.markers is None else solid_of(kin.markers.body)
    if solid is None:
        return motion, said
    if motion.shapes.plane or not motion.shapes.whole:
        return motion, (*said, note("stress-open"))
    try:
        return with_stress(motion, solution, solid, settings), said
    except ForceIdError as e:
        return motion, (*said, note("no-applied-moments", error=str(e)))


def with_stress(motion: AffineMotion, solution: Solution, solid: Solid, settings: Settings) -> AffineMotion:
    """The motion with the first moments applied: K F^T, of F'' E = K - P with the stress P of the material.

    F follows better with it, and so does all that acts, (K - P) F^T.
    """
    kin, state, E = solution.kinematics, solution.state, motion.shapes.second_moment
    axes = state.rotation if settings.load_axes == "body" else np.tile(np.eye(3), (len(kin.time), 1, 1))
    found = applied_moments(kin, E, motion.F, motion.dF, solid, axes, engine(settings.engine))
    P, (by_F, by_dF) = solid.stress(found.F, found.dF), solid.slopes(found.F, found.dF)
    turned = row_by_row(np.eye(3), found.F.mT)

    def changes(K: Array) -> Array:
        """Of K F^T by F."""
        return np.asarray(np.einsum("bd,tac->tabdc", np.eye(3), K).reshape(-1, 9, 9))

    by_own = np.concatenate([turned, changes(found.K), np.zeros_like(turned)], 2)
    by_all = np.concatenate([turned, changes(found.K - P) - turned @ by_F, -turned @ by_dF], 2)
    return replace(
        motion, F=found.F, F_cov=found.cov[:, 9:18, 9:18], dF=found.dF,
        first_moment=(found.K - P) @ found.F.mT, first_moment_cov=by_all @ found.cov @ by_all.mT,
        applied_first_moment=found.K @ found.F.mT, applied_first_moment_cov=by_own @ found.cov @ by_own.mT,
    )  # fmt: skip


def undetermined(solution: Solution, motion: AffineMotion, asked: bool) -> tuple[Finding, ...]:
    """What markers and mass leave open of stretch, force and first moments; and where the markers of a frame
    hardly show F, so that nothing stands out of their noise.

    asked: for the affine level. Who asked for force and moment alone misses no stretch that moves no mass.
    """
    shapes, found = motion.shapes, []
    level: Level | None = None if asked or shapes.breadth else "ok"
    if shapes.plane:
        found.append(note("stretch-open", level))
    elif not shapes.breadth:
        found.append(note("stretch-without-breadth", level))
    if shapes.off:
        found.append(note("affine-force-open"))
    if not shapes.whole:
        found.append(note("first-moments-open"))
    kin = solution.kinematics
    assert kin.markers is not None
    x, noise = kin.markers.X[kin.seen], kin.noise["position"]
    observed = motion.shapes.span.shape[1]  # directions in which F is looked at
    off = noise / float(np.linalg.svd(x - x.mean(0), compute_uv=False)[observed - 1])
    if not off < UNCLEAR:
        found.append(note("stretch-in-noise", stretch=off, noise_m=noise))
    return tuple(found)


def given_stress(state: FlightState, motion: AffineMotion | None, known: Array) -> FlightState:
    """The state of a flight with the moment of first moments that stress tells apart, if there are any.

    known (time, 3) or (3,): of what the state is beside.
    """
    if motion is None or motion.applied_first_moment is None:
        return state
    cov = state.wrench_cov.copy()
    cov[:, 3:], cov[:, :, 3:] = 0.0, 0.0
    cov[:, 3:, 3:] = motion.moment_cov
    return replace(state, moment=motion.moment - known, wrench_cov=cov)


def polar_motion(motion: AffineMotion | None) -> dict[str, Any]:
    """F with covariance and rate, its polar rotation (time, 3, 3) and the spin of that, circulation, by name.

    Nothing where F is open in part.
    """
    if motion is None or motion.polar is None:
        return {}
    rotation, spin = motion.polar
    return {
        "rotation": rotation, "F": motion.F, "F_cov": motion.F_cov, "F_rate": motion.dF, "spin": spin,
        "circulation": circulation(motion.F, motion.dF, motion.shapes.second_moment),
    }  # fmt: skip
