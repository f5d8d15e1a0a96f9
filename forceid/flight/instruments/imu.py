"""Gyros and accelerometers on a flying body: what they read, as rows on the states of a flight.

In body axes, with H, F, T turned into them and the reading of a body that may deform,

    omega  = J^-1 (H - h)
    omega' = J^-1 (T - omega x H - J' omega - h')
    a      = F / m + omega' x r + omega x (omega x r)

F leaves weight out, so F / m is the specific force of the mass center. Exact, and linear in F and T; about a
reference linear in H and in the rotation error, which stands on the left: R^T v gains R^T [v]x theta. Each
channel has a bias that stays, or wanders as b' = w. A family may read on a clock of its own: late by a time
that stays, it reads y + y' times that. The sensor stands still in body axes: its own motion and tilt as the
body deforms are not in the rows. Source: principal equations 4d, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from forceid.flight.attitude import apply
from forceid.flight.priors.load import LoadPrior, chain_along
from forceid.kalman.model import StateSpace
from forceid.motion.pose import exp
from forceid.principal import cross_matrix as skew
from forceid.records import Array, Flags, Indices


@dataclass(frozen=True)
class Sensors:
    """Gyros and accelerometers on the clock of a flight.

    angular_velocity rad/s and specific_force m/s2 (time, sensor, 3), sensor axes, NaN where not sampled;
    position (sensor, 3) m from the mass center and rotation (sensor, 3, 3) sensor to body, body axes;
    noise_std and bias_std (2, sensor), first of the gyros: of white noise, and of the bias before anything
    is read, which may be as good as unknown. Of a family (2,): bias_walk, by which a bias wanders in a second
    (rad/s and m/s2 per root of a second); clock_std s, of the time by which it reads later than its samples
    say, zero where the clocks agree; shifted s, by which its readings have been put on later samples.
    """

    angular_velocity: Array
    specific_force: Array
    position: Array
    rotation: Array
    noise_std: Array
    bias_std: Array
    bias_walk: Array = field(default_factory=lambda: np.zeros(2))
    clock_std: Array = field(default_factory=lambda: np.zeros(2))
    shifted: Array = field(default_factory=lambda: np.zeros(2))

    @property
    def readings(self) -> Array:
        """All channels side by side, (time, channel): gyros, then accelerometers, sensor by sensor."""
        both = (self.angular_velocity, self.specific_force)
        return np.concatenate([a.reshape(len(a), -1) for a in both], 1)

    @property
    def used(self) -> Flags:
        """Channels (channel,) that read anything at all: the others get no row and no bias."""
        return np.asarray(np.isfinite(self.readings).any(0))

    @property
    def family(self) -> Indices:
        """Of every channel used, 0 for a gyro and 1 for an accelerometer."""
        return np.asarray(np.repeat([0, 1], self.readings.shape[1] // 2)[self.used])

    @property
    def clocked(self) -> Indices:
        """The families whose clock is in doubt: each has a state."""
        return np.asarray([i for i in (0, 1) if self.clock_std[i] > 0 and i in self.family], int)

    @property
    def noise_var(self) -> Array:
        """Variance of every channel used."""
        return np.repeat(self.noise_std.ravel() ** 2, 3)[self.used]

    @property
    def bias_var(self) -> Array:
        """Variance before the first sample of the bias of every channel used."""
        return np.repeat(self.bias_std.ravel() ** 2, 3)[self.used]


@dataclass(frozen=True)
class Moved:
    """A flight at the samples of its clock, for its sensors: rotation, momentum and loads in world axes.

    rotation (time, 3, 3); H, T, F (time, 3); mass kg; inertia, inertia_rate (time, 3, 3), h, h_rate (time, 3)
    of the shape, body axes; T_rate, F_rate (time, 3) of the loads.
    """

    rotation: Array
    H: Array
    T: Array
    F: Array
    mass: float
    inertia: Array
    inertia_rate: Array
    h: Array
    h_rate: Array
    T_rate: Array | float = 0.0
    F_rate: Array | float = 0.0

    @property
    def omega(self) -> Array:
        """Angular velocity (time, 3), world axes."""
        Rt = np.asarray(self.rotation.swapaxes(1, 2))
        H = apply(Rt, self.H) - self.h
        return apply(self.rotation, np.asarray(np.linalg.solve(self.inertia, H[..., None])[..., 0]))

    def later(self, s: float) -> Moved:
        """The flight a little later, by s seconds, as its own rates say."""
        H = self.H + s * self.T + 0.5 * s**2 * self.T_rate
        inertia, h = self.inertia + s * self.inertia_rate, self.h + s * self.h_rate
        now = replace(self, H=H, T=self.T + s * self.T_rate, F=self.F + s * self.F_rate, inertia=inertia, h=h)
        ahead = replace(now, rotation=exp(s * self.omega) @ self.rotation).omega
        return replace(now, rotation=exp(0.5 * s * (self.omega + ahead)) @ self.rotation)


def sensed(sensors: Sensors, moved: Moved) -> tuple[Array, Array, Array, Array, Array]:
    """What the channels used read without bias (time, channel), and its derivatives.

    These are (time, channel, 3) by the rotation error theta and by H, T and F, world axes.

    >>> one = np.ones((1, 1, 1))
    >>> sensors = Sensors(0 * one + np.zeros(3), 0 * one + np.zeros(3), np.array([[0.1, 0.0, 0.0]]),
    ...                   np.eye(3)[None], np.ones((2, 1)), np.ones((2, 1)))
    >>> J, at_rest = 1e-3 * np.eye(3)[None], np.zeros((1, 3))
    >>> spun = Moved(np.eye(3)[None], np.array([[0.0, 0, 0.02]]), at_rest, np.array([[0.0, 0, 0.5]]), 0.5,
    ...              J, 0 * J, at_rest, at_rest)
    >>> sensed(sensors, spun)[0].round(9) + 0.0
    array([[  0.,   0.,  20., -40.,   0.,   1.]])
    """
    Rt = moved.rotation.swapaxes(1, 2)
    J_inv = np.asarray(np.linalg.inv(moved.inertia))
    H, T, F = (apply(Rt, v) for v in (moved.H, moved.T, moved.F))
    omega = apply(J_inv, H - moved.h)
    by_H = J_inv @ Rt  # of omega; theta moves H by [H]x theta, and so T and F
    d_omega = {"theta": by_H @ skew(moved.H), "H": by_H, "T": 0 * by_H, "F": 0 * by_H}
    d_H = {"theta": Rt @ skew(moved.H), "H": Rt, "T": 0 * Rt, "F": 0 * Rt}
    d_T = {"theta": Rt @ skew(moved.T), "H": 0 * Rt, "T": Rt, "F": 0 * Rt}
    d_F = {"theta": Rt @ skew(moved.F), "H": 0 * Rt, "T": 0 * Rt, "F": Rt}
    alpha = apply(J_inv, T - np.cross(omega, H) - apply(moved.inertia_rate, omega) - moved.h_rate)
    turned, lags = skew(H) - moved.inertia_rate, skew(omega)
    d_alpha = {v: J_inv @ (d_T[v] + turned @ d_omega[v] - lags @ d_H[v]) for v in d_H}

    read: list[Array] = []
    rows: dict[str, list[Array]] = {v: [] for v in d_H}
    for S in sensors.rotation:
        read.append(omega @ S)
        for v in rows:
            rows[v].append(S.T @ d_omega[v])
    for S, r in zip(sensors.rotation, sensors.position, strict=True):
        swept = np.cross(omega, r)
        read.append((F / moved.mass + np.cross(alpha, r) + np.cross(omega, swept)) @ S)
        by_omega = -skew(swept) - lags @ skew(r)
        for v in rows:
            rows[v].append(S.T @ (d_F[v] / moved.mass - skew(r) @ d_alpha[v] + by_omega @ d_omega[v]))
    used = sensors.used
    y, *d = (np.concatenate(parts, 1)[:, used] for parts in (read, *rows.values()))
    return y, d[0], d[1], d[2], d[3]


def sensed_late(sensors: Sensors, moved: Moved, clock: Array) -> tuple[Array, ...]:
    """What `sensed` says, of families that read later than their samples by clock (2,) s.

    Also, last, the rate of what is read (time, channel).
    """
    same = clock[0] == clock[1]
    parts = []
    for i in (0,) if same else (0, 1):
        then = moved.later(clock[i]) if clock[i] else moved
        y, *rows = sensed(sensors, then)
        rates = (then.omega, then.T, then.T_rate, then.F_rate)
        rate = sum(
            np.einsum("tcs,ts->tc", d, np.broadcast_to(v, then.H.shape))
            for d, v in zip(rows, rates, strict=True)
        )
        parts.append((y, *rows, np.asarray(rate)))
    if same:
        return parts[0]
    gyro = sensors.family == 0
    return tuple(np.concatenate([a[:, gyro], b[:, ~gyro]], 1) for a, b in zip(*parts, strict=True))


def carried(rows: Array, sensors: Sensors, clock: Array, loads: tuple[LoadPrior, ...]) -> tuple[Array, Array]:
    """Rows (time, channel, state) on the states of a sample, of what is read by `clock` (2,) s later.

    Also the covariance (time, channel, channel) of what the chains of the loads do in between by chance.
    """
    rows, noise = rows.copy(), np.zeros((*rows.shape[:2], rows.shape[1]))
    for i, by in enumerate(clock):
        mine = np.flatnonzero(sensors.family == i)
        if by == 0.0 or not len(mine):
            continue
        begin = 0
        for load in loads:
            F, Q, P0 = chain_along(load, np.array([abs(by)]))
            lead, chance, part = F[0], Q[0], slice(begin + 3, begin + len(P0))
            if by < 0:
                lead = np.linalg.inv(lead)
                chance = lead @ chance @ lead.T
            own = rows[:, mine, part]
            noise[:, mine[:, None], mine] += own @ chance[3:, 3:] @ own.swapaxes(1, 2)
            rows[:, mine, part] = own @ lead[3:, 3:]
            begin += len(P0)
    return rows, noise


def with_sensors(
    model: StateSpace, sensors: Sensors, H: Array, noise: Array, rate: Array, step: Array
) -> StateSpace:
    """A model with channels of sensors below its own; behind its states their biases, then their clocks.

    H (time, channel, state): rows of the sensors on the states of the model; noise (time, channel, channel)
    beside their own; rate (time, channel) of what they read; step (time - 1,) s.
    """
    clocked, family = sensors.clocked, sensors.family
    k, n, m, T, c = H.shape[1], len(model.x0), model.R.shape[-1], len(H), len(clocked)
    rows = np.zeros((T, m + k, n + k + c))
    rows[:, :m, :n], rows[:, m:, :n], rows[:, m:, n : n + k] = model.H, H, np.eye(k)
    rows[:, m:, n + k :] = rate[..., None] * (family[:, None] == clocked)
    R, P0 = np.zeros((T, m + k, m + k)), np.zeros((n + k + c, n + k + c))
    R[:, :m, :m], R[:, m:, m:] = model.R, noise + np.diag(sensors.noise_var)
    P0[:n, :n] = model.P0
    P0[n:, n:] = np.diag(np.concatenate([sensors.bias_var, sensors.clock_std[clocked] ** 2]))
    F, Q = (np.zeros((len(a), *P0.shape)) for a in (model.F, model.Q))
    F[:, :n, :n], F[:, n:, n:], Q[:, :n, :n] = model.F, np.eye(k + c), model.Q
    wander = np.diag(sensors.bias_walk[family] ** 2)
    Q[:, n : n + k, n : n + k] = step[:, None, None] * wander
    u = None if model.u is None else np.pad(model.u, ((0, 0), (0, k + c)))
    return StateSpace(F, Q, rows, R, np.pad(model.x0, (0, k + c)), P0, u)
