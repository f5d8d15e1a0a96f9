"""The twin of a recording: the same body, markers, clock, gaps and noise, under a load that is known.

A recording that nobody knows the truth of is estimated, and a motion near the one found is written down: the
smoothed one, and beside it what a load drawn from the errors of the estimate does, as its prior and the noise
leave them. Path and angular momentum are splines, force and moment their derivatives, and the rotation is
integrated from the angular momentum by DOP853. The noise is that of the markers beside the motion found, with
the phases of its spectrum drawn anew: as large, and as slow, marker by marker. Source of the last: Theiler et
al., Physica D 58 (1992) 77.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from evidence.judged import LOADS
from evidence.subjects.flights.bodies import TOLERANCE
from evidence.subjects.flights.drawn_loads import SINUSOIDS, Drawn
from forceid.config import Settings
from forceid.errors import DataError
from forceid.estimation.loads.channels import force_channel, moment_channel
from forceid.estimation.loads.hidden.whitened import whitened
from forceid.estimation.long.joined import cut
from forceid.estimation.long.windows import LONG
from forceid.estimation.methods.problem import Solution
from forceid.estimation.run import estimate_shown
from forceid.kalman.engines import engine
from forceid.principal import cross_matrix
from forceid.records import Array, Motion, Recording
from forceid.scenes.mechanics import solve_ode


def twin(recording: Recording, rng: np.random.Generator, where: str = "") -> Recording:
    """A recording as this one might have been, with the force and the moment that acted on it.

    Of one that is estimated in stretches, the stretch in the middle.

    DataError: the recording shows no markers, or its estimate is refused.
    """
    frames = len(recording.motion.time)
    if frames > LONG:
        first = (frames - LONG) // 2
        recording = replace(recording, motion=cut(recording.motion, first, first + LONG, frames))
    motion = recording.motion
    if motion.position is None or motion.readings:
        raise DataError(
            "holds no markers alone, expected /motion/position and no sensors beside it",
            where or "the recording",
            "give the recording its truth, or chart a scene that is near to it",
        )
    estimate, solution = estimate_shown(recording, Settings())
    if solution is None or set(solution.priors) != set(LOADS):
        raise DataError(
            f"has no motion to make a twin of: {'; '.join(estimate.verdict.reasons) or 'nothing turns'}",
            where or "the recording",
            "forceid estimate says what it needs",
        )
    position, truth = flown(recording, solution, rng)
    residual = motion.position - flown_as_found(recording, solution)
    seen = np.isfinite(motion.position)
    noise = surrogate(np.where(seen, residual, 0.0), rng)
    measured = replace(motion, position=np.where(seen, position + noise, np.nan), marker_position=None)
    return Recording(recording.body, measured, truth, title=f"twin of {recording.title or where}")


def flown_as_found(recording: Recording, solution: Solution) -> Array:
    """Nodes (time, node, 3) m where the estimate has them."""
    state, kin = solution.state, solution.kinematics
    shape = kin.shape + np.einsum("tk,kna->tna", solution.deformation.amplitude, kin.shapes)
    return np.asarray(state.center[:, None] + np.einsum("tab,tnb->tna", state.rotation, shape))


def flown(
    recording: Recording, solution: Solution, rng: np.random.Generator
) -> tuple[Array, dict[str, Array]]:
    """Nodes (time, node, 3) m of the twin at the samples, and what acted: force, moment, center."""
    state, kin, motion, moved = solution.state, solution.kinematics, recording.motion, solution.deformation
    t = motion.time - motion.time[0]
    more = {load: drawn_error(solution, motion, load, rng) for load in LOADS}
    path, H, J, h = (spline(t, values) for values in (state.center, state.H, moved.inertia, moved.h))

    def omega(at: float, R: Array, H: Array) -> Array:
        return np.asarray(R @ np.linalg.solve(J(at), R.T @ H - h(at) - kin.inside))

    R = state.rotation[0]
    begin = R @ (moved.inertia[0] @ (R.T @ state.omega[0]) + moved.h[0] + kin.inside) - H(0.0)

    def rate(at: float, y: Array) -> Array:
        R = y.reshape(3, 3)
        turning = omega(at, R, begin + H(at) + more["moment"].impulse(np.array([at]))[0])
        return (cross_matrix(turning) @ R).ravel()

    rotation = solve_ode(rate, R.ravel(), t, TOLERANCE).reshape(-1, 3, 3)
    center = path(t) + more["force"].second(t) / kin.inertia.mass
    force = kin.inertia.mass * (path(t, 2) - motion.gravity) + more["force"].at(t)
    moment = H(t, 1) + more["moment"].at(t)
    shape = kin.shape + np.einsum("tk,kna->tna", moved.amplitude, kin.shapes)
    position = center[:, None] + np.einsum("tab,tnb->tna", rotation, shape)
    return position, {"force": force, "moment": moment, "center": center}


def spline(time: Array, values: Array) -> BSpline:
    """The quintic spline through values (time, ...)."""
    return make_interp_spline(time, values, k=5)


def drawn_error(solution: Solution, motion: Motion, load: str, rng: np.random.Generator) -> Drawn:
    """A load drawn from the errors of an estimate: as many sinusoids, whose powers follow their density."""
    kin = solution.kinematics
    channel = (
        force_channel(kin, motion.gravity) if load == "force" else moment_channel(kin, solution.deformation)
    )
    prior = solution.priors[load]
    at = np.isin(motion.time, channel.time)
    look = whitened(channel, prior, engine(), rotation=solution.state.rotation[at])
    span, step = float(np.ptp(channel.time)), float(np.median(np.diff(channel.time)))
    edges = np.geomspace(0.5 / span, 0.5 / step, SINUSOIDS + 1)
    f = edges[:-1] + np.diff(edges) * rng.random(SINUSOIDS)
    noise, smooth = look.densities(f)
    size = np.sqrt(2 * noise * smooth / (noise + smooth) * np.diff(edges)[:, None])
    axes = prior.axes if prior.body_axes is None else np.eye(3)
    a, b = (size * rng.standard_normal((SINUSOIDS, 3)) @ axes.T for _ in range(2))
    return Drawn(2 * np.pi * f, a, b, np.zeros(3))


def surrogate(residual: Array, rng: np.random.Generator) -> Array:
    """Noise (time, ...) with the spectrum of a residual and phases of its own."""
    waves = np.fft.rfft(residual, axis=0)
    turned = np.exp(2j * np.pi * rng.random(waves.shape))
    return np.asarray(np.fft.irfft(np.abs(waves) * turned, len(residual), axis=0))
