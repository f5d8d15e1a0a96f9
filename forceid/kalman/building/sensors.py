"""What sensors on a structure under loads read, as rows H on its state, and their noise and biases.

Loads are states, so an accelerometer's feedthrough of force is part of its row: z = H x + offset + n.

>>> import numpy as np
>>> from forceid.kalman.building.process import matern, random_walk
>>> from forceid.kalman.building.structure import Structure, drive
>>> particle = Structure(frequency=[0.0], damping=[0.0], participation=[[1 / 0.5]])  # 0.5 kg
>>> system = drive(particle, [matern(2, std=1.0, rate=30.0)], var_q=1.0, var_rate=1.0)
>>> H = np.vstack([sensor_rows(system, [[1.0]], derivative) for derivative in (0, 2)])
>>> H.tolist()
[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0]]
>>> model = state_space(system, step=1e-3, H=H, R=np.diag([1e-4, 5e-2]) ** 2)
>>> colored(model, [None, random_walk(0.0, var=0.1)], step=1e-3).H[1].tolist()  # a bias
[0.0, 0.0, 2.0, 0.0, 1.0]
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import ConfigError
from forceid.kalman.building.clock import discretize_steps
from forceid.kalman.building.process import (
    Diffusion,
    Process,
    block_diagonal,
    discretize,
    superpose,
)
from forceid.kalman.building.structure import System
from forceid.kalman.model import StateSpace
from forceid.records import Array
from forceid.rounding import SINGLE


def sensor_rows(system: System, shape: ArrayLike, derivative: int = 0) -> Array:
    """Rows (..., sensor, state) of what sensors read of the amplitudes q, or of a derivative of them in time.

    shape (sensor, mode): what a unit of each mode shows, along the sensing axis. derivative 0: displacement,
    or strain; 1: velocity, or angular rate; 2: acceleration, with the feedthrough of the loads in the state:
    shape (-2 Z W q' - W^2 q + Phi^T B p). Raises ConfigError for another number of modes.
    """
    shape, m = np.asarray(shape, float), system.modes
    if shape.ndim != 2 or shape.shape[1] != m:
        what, step = f"has shape {shape.shape}, expected (sensor, {m})", "give one column for each mode"
        raise ConfigError(what, "the sensor shape", step)
    if derivative == 2:
        return np.asarray(shape @ system.A[..., m : 2 * m, :])
    return np.asarray(shape @ np.eye(m, system.A.shape[-1], derivative * m))


def specific_force(
    system: System, shape: ArrayLike, direction: ArrayLike, gravity: ArrayLike, tilt: ArrayLike | None = None
) -> tuple[Array, Array]:
    """Rows and offset (sensor,) of accelerometers, which read acceleration less gravity: +9.81 up at rest.

    shape (sensor, mode) along the sensor's direction (sensor, 3), a unit vector; gravity (3,) m/s2, in the
    same axes. tilt (sensor, 3, mode): small rotation of the sensor by each mode, where it turns enough to see
    gravity from aside. Filter z - offset. Source: principal equations 4d, linear in q.

    >>> from forceid.kalman.building.structure import Structure, drive
    >>> particle = drive(Structure([0.0], [0.0], np.zeros((1, 0))), [], var_q=1.0, var_rate=1.0)
    >>> H, offset = specific_force(particle, [[1.0]], direction=[[0, 0, 1]], gravity=[0, 0, -9.81])
    >>> H.tolist(), offset.tolist()
    ([[0.0, 0.0]], [9.81])
    """
    e, g = np.asarray(direction, float), np.asarray(gravity, float)
    H = sensor_rows(system, shape, 2)
    if tilt is not None:
        # the sensor, turned by theta, reads e . (theta x g) = theta . (g x e) more
        H = H + sensor_rows(system, np.einsum("sam,sa->sm", np.asarray(tilt, float), np.cross(g, e)))
    return H, -(e @ g)


def state_space(system: Diffusion, step: ArrayLike, H: ArrayLike, R: ArrayLike) -> StateSpace:
    """The model of samples `step` seconds apart, one number or (time - 1,); state 0 with P0 at the first one.

    H (channel, state) or (time, channel, state); R (channel, channel) or (time, channel, channel). A system
    with a leading axis (model,) gives many models; H and R may then have that axis, or four, (time or 1,
    model, ., .). A known offset of the measurement is not in the model: subtract it from z. Raises
    ConfigError where a step is negative.
    """
    F, Q = transitions(system, step)
    P0 = np.asarray(system.P0)
    H, R = np.asarray(H, float), np.asarray(R, float)
    if P0.ndim > 2:
        H, R = (a if a.ndim > 3 else a.reshape(1, -1, *a.shape[-2:]) for a in (H, R))
    return StateSpace(F, Q, H, R, np.zeros(P0.shape[:-1]), P0)


def colored(model: StateSpace, noise: Process | Sequence[Process | None], step: ArrayLike) -> StateSpace:
    """`model` with noise that has a memory added to its channels: the states of `noise` follow its own.

    noise: of every channel alike, independent, or one a channel with None where there is none; any process,
    mostly a matern, or a random_walk, which is a bias. step: that of the model, s, one number or (time - 1,).
    R stays, as the white part, and may be 0 on channels whose noise is not. Raises ConfigError where noise
    and channels differ in number. Source: principal equations 4d.

    >>> from forceid.kalman.building.process import matern
    >>> level = StateSpace(*np.ones((4, 1, 1)), x0=np.zeros(1), P0=np.eye(1))
    >>> colored(level, matern(1, std=0.3, rate=5.0), step=0.1).H.tolist()
    [[1.0, 1.0]]
    """
    channels = model.R.shape[-1]
    each = [noise] * channels if isinstance(noise, Process) else list(noise)
    if len(each) != channels:
        raise ConfigError(
            f"number {len(each)}, expected {channels}", "the noise processes", "give one a channel, or None"
        )
    rows = [(k, p) for k, p in enumerate(each) if p is not None]
    if not rows:
        return model
    joint = superpose(*(p for _, p in rows))
    channel = np.repeat([k for k, _ in rows], [len(p.output) for _, p in rows])
    C = np.where(np.arange(channels)[:, None] == channel, joint.output, 0.0)
    return append(model, joint, C, step)


def append(model: StateSpace, further: Process, C: Array, step: ArrayLike) -> StateSpace:
    """`model` with the independent states of `further`, which its channels read by C (channel, state)."""
    F, Q = transitions(further, step)
    if model.x0.ndim > 1 or further.P0.ndim > 2:
        F, Q, model = as_many(F), as_many(Q), many_models(model)
    size, P0 = C.shape[-1], block_diagonal(model.P0, further.P0)

    def widened(a: Array) -> Array:
        return np.pad(a, [(0, 0)] * (a.ndim - 1) + [(0, size)])

    return StateSpace(
        block_diagonal(model.F, F),
        block_diagonal(model.Q, Q),
        np.concatenate([model.H, np.broadcast_to(C, (*model.H.shape[:-1], size))], -1),
        model.R,
        np.broadcast_to(widened(model.x0), P0.shape[:-1]),
        P0,
        None if model.u is None else widened(model.u),
    )


def many_models(model: StateSpace) -> StateSpace:
    """One model as many of which there is one; many as they are."""
    if model.x0.ndim > 1:
        return model
    F, Q, H, R = (as_many(a) for a in (model.F, model.Q, model.H, model.R))
    u = None if model.u is None else model.u.reshape(-1, 1, model.u.shape[-1])
    return StateSpace(F, Q, H, R, model.x0[None], model.P0[None], u)


def as_many(a: Array) -> Array:
    """A matrix, or one for each time, with the axes (time or 1, model or 1)."""
    return a if a.ndim > 3 else a.reshape(-1, 1, *a.shape[-2:])


def transitions(process: Diffusion, step: ArrayLike) -> tuple[Array, Array]:
    """F, Q of each step ([time - 1,] state, state), alike where steps are; of many models (., model, ...)."""
    h, many = np.asarray(step, float), np.ndim(process.P0) > 2
    if (h < 0).any():
        raise ConfigError(
            f"holds {h.min():.3g} s, expected none negative", "step", "sort the samples by time"
        )
    if h.ndim and (not h.size or np.ptp(h) <= SINGLE * h.mean()):
        h = np.asarray(h.mean() if h.size else 0.0)
    if not h.ndim:
        F, Q = discretize(process, h)
        return (F[None], Q[None]) if many else (F, Q)
    _, which = np.unique(np.round(h / (SINGLE * h.mean())), return_inverse=True)
    # the mean of those that share a tick: a step by itself is not rounded
    each = np.bincount(which, h) / np.bincount(which)
    F, Q = discretize_steps(process, each)
    return F[which], Q[which]
