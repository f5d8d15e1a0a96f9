"""Drawn flights of a plate on springs under nodal loads that bend it, slower than all of its modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from evidence.drawn.plate_face import plate
from evidence.vectors import GRAVITY
from forceid.records import Array, Body, Motion, Recording

MODES = 6  # that are integrated; the stiffer ones answer the loads as they do in steady vibration
TIGHT = 1e-9  # m, rad and their rates: error of a step of the integration


@dataclass(frozen=True)
class PlatePush:
    """Loads p = sum of sines on nodes: pattern (load, node, 3) N, body axes; size, rate rad/s, phase (load,
    sine)."""

    pattern: Array
    size: Array
    rate: Array
    phase: Array

    def at(self, time: Array) -> Array:
        """Loads (..., load) at times (...)."""
        return np.asarray(
            (self.size * np.sin(self.rate * np.asarray(time)[..., None, None] + self.phase)).sum(-1)
        )


def flown(seed: int, sigma: float, rate: float, markers: int) -> tuple[Recording, Array, Array]:
    """A second of flight of a drawn plate with its stiffness, its loads (time, load), and their patterns.

    sigma (m): of marker noise, stated; rate Hz; markers: drawn on the upper face, or on all nodes.
    """
    rng = np.random.default_rng([seed, markers, int(rate)])
    X, mass, K = plate(rng)
    square, shape = eigh(K, np.diag(np.repeat(mass, 3)))
    w2, Phi = square[6:], shape[:, 6:].T.reshape(-1, *X.shape)
    push, time = drawn_push(rng, X), np.arange(0, 1.0, 1 / rate)
    c, R, q = fly(X, mass, w2[:MODES], Phi[:MODES], push, time, rng.uniform(-2, 2, 3))
    pushed = np.einsum("kna,lna->kl", Phi[MODES:], push.pattern)
    waves = push.size * np.sin(push.rate * time[:, None, None] + push.phase)
    steady = np.einsum("kl,tls,kls->tk", pushed, waves, 1 / (w2[MODES:, None, None] - push.rate**2))
    u = np.einsum("tk,kna->tna", np.concatenate([q, steady], 1), Phi)
    r = np.einsum("tab,tnb->tna", R, X + u)
    x = c[:, None] + r + sigma * rng.standard_normal(r.shape)
    if markers < len(X):
        face = len(X) // 2 + rng.permutation(len(X) // 2)[:markers]
        x[:, np.setdiff1d(np.arange(len(X)), face)] = np.nan
    loads = push.at(time)
    f = np.einsum("tab,tnb->tna", R, np.einsum("tl,lna->tna", loads, push.pattern))
    truth = {"force": f.sum(1), "moment": np.cross(r, f).sum(1)}
    body = Body(tuple(f"n{k}" for k in range(len(X))), X, mass, stiffness=K)
    motion = Motion(time, x, gravity=GRAVITY, noise_std={"position": sigma})
    return Recording(body, motion, truth), loads, push.pattern


def drawn_push(rng: np.random.Generator, X: Array) -> PlatePush:
    """Loads of 2 to 40 Hz across the plate: one in its middle, one spread over its corners, and a twist."""
    upper = np.flatnonzero(X[:, 2] > 0)
    out = X[upper][:, :2] / np.abs(X[upper][:, :2]).max(0)
    corners = upper[[np.argmax(out @ s) for s in ([1, 1], [1, -1], [-1, 1], [-1, -1])]]
    inner = upper[np.argsort((out**2).sum(1))[:4]]
    pattern = np.zeros((3, len(X), 3))
    pattern[0, inner, 2], pattern[1, corners, 2], pattern[2, corners, 2] = 0.25, 0.25, [0.1, -0.1, -0.1, 0.1]
    rate = 2 * np.pi * np.exp(rng.uniform(np.log(2.0), np.log(40.0), (3, 2)))
    return PlatePush(pattern, rng.uniform(15.0, 40.0, (3, 2)), rate, rng.uniform(0, 2 * np.pi, (3, 2)))


def fly(
    X: Array, mass: Array, w2: Array, Phi: Array, push: PlatePush, time: Array, spin: Array
) -> tuple[Array, Array, Array]:
    """Center (time, 3), rotation (time, 3, 3) and amplitudes (time, mode), by the principle of virtual power.

    The accelerations of all nodes, tested with every motion that the plate has, balance the forces on them.
    """
    m3, modes = np.repeat(mass, 3), len(w2)
    flat = Phi.reshape(modes, -1)

    def change(t: float, y: Array) -> Array:
        R = Rotation.from_quat(y[3:7])
        v, omega, q, dq = y[7:10], y[10:13], y[13 : 13 + modes], y[13 + modes :]  # omega: body axes
        r, dr = X + np.tensordot(q, Phi, 1), np.tensordot(dq, Phi, 1)
        still = np.cross(omega, np.cross(omega, r)) + 2 * np.cross(omega, dr)
        f = np.tensordot(push.at(np.array(t)), push.pattern, 1)
        down = R.inv().apply(GRAVITY)
        G = np.zeros((len(m3), 6 + modes))
        G[:, :3] = np.tile(np.eye(3), (len(X), 1))
        for k, axis in enumerate(np.eye(3)):
            G[:, 3 + k] = np.cross(axis, r).ravel()
        G[:, 6:] = flat.T
        load = G.T @ (f + mass[:, None] * (down - still)).ravel()
        load[6:] -= w2 * q
        a = np.linalg.solve(G.T @ (m3[:, None] * G), load)
        x, z = y[3:7], omega
        turn = 0.5 * np.append(x[3] * z + np.cross(x[:3], z), -x[:3] @ z)
        return np.concatenate([v, turn, R.apply(a[:3]), a[3:6], dq, a[6:]])

    start = np.zeros(13 + 2 * modes)
    start[6], start[10:13] = 1.0, spin
    found = solve_ivp(change, (0, time[-1]), start, "DOP853", time, rtol=1e-8, atol=TIGHT)
    y = found.y.T
    return y[:, :3], Rotation.from_quat(y[:, 3:7]).as_matrix(), y[:, 13 : 13 + modes]
