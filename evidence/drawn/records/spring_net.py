"""Masses that springs and dashpots hold together, pushed at some of their nodes: DOP853 in space, drawn.

Every node is held to every other, so the net is no mechanism; forces go along the line between two nodes as
they are, however the net turns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from evidence.vectors import GRAVITY
from forceid.records import Array

RATE, SECONDS = 250.0, 1.2  # Hz, s
LOSS = 0.02  # damping ratio of the lowest mode


@dataclass(frozen=True)
class SpringNet:
    """A net: shape (node, 3) m, mass (node,) kg, stiffness (dof, dof) N/m of small motions, and its flight.

    time (time,) s; x (time, node, 3) m as it moved; force, moment (time, 3) of the loads, about the mass
    center; lowest: frequency of the lowest mode, Hz.
    """

    shape: Array
    mass: Array
    stiffness: Array
    time: Array
    x: Array
    force: Array
    moment: Array
    lowest: float


def drawn_net(rng: np.random.Generator) -> SpringNet:
    """A net of six to ten nodes with a lowest mode of 4 to 40 Hz, under three loads of three sines each."""
    n, size = int(rng.integers(6, 11)), float(np.exp(rng.uniform(np.log(0.05), np.log(0.5))))
    X = size * rng.standard_normal((n, 3))
    mass = size**2 * rng.uniform(0.5, 1.5, n) * 10
    X -= mass @ X / mass.sum()
    first, second = np.triu_indices(n, 1)
    arm = X[second] - X[first]
    length = np.linalg.norm(arm, axis=1)
    rigidity = rng.uniform(0.5, 2.0, len(first))
    along = arm / length[:, None]
    K = np.zeros((3 * n, 3 * n))
    for k, (i, j) in enumerate(zip(first, second, strict=True)):
        block = np.kron([[1.0, -1.0], [-1.0, 1.0]], rigidity[k] * np.outer(along[k], along[k]))
        at = np.concatenate([3 * i + np.arange(3), 3 * j + np.arange(3)])
        K[np.ix_(at, at)] += block
    w2 = eigh(K, np.diag(np.repeat(mass, 3)), eigvals_only=True)[6]
    lowest = float(np.exp(rng.uniform(np.log(4.0), np.log(40.0))))
    w = 2 * np.pi * lowest
    rigidity, K = rigidity * w**2 / w2, K * w**2 / w2
    pushed, level = rng.choice(n, 3, replace=False), 4.0 * mass.sum() / 3
    amplitude, phase = level * rng.standard_normal((3, 3, 3)), rng.uniform(0, 2 * np.pi, (3, 3, 1))
    turn = 2 * np.pi * rng.uniform(0.5, 12.0, (3, 3, 1))

    def loads(t: float) -> Array:
        f = np.zeros((n, 3))
        f[pushed] = (amplitude * np.sin(turn * t + phase)).sum(1)
        return f

    def rates(t: float, y: Array) -> Array:
        x, v = y.reshape(2, n, 3)
        d = x[second] - x[first]
        now = np.linalg.norm(d, axis=1)
        u = d / now[:, None]
        pull = rigidity * (now - length + 2 * LOSS / w * np.einsum("ka,ka->k", u, v[second] - v[first]))
        f = loads(t)
        np.add.at(f, first, pull[:, None] * u)
        np.add.at(f, second, -pull[:, None] * u)
        return np.concatenate([v, f / mass[:, None] + GRAVITY]).ravel()

    time = np.arange(0, SECONDS, 1 / RATE)
    v = np.cross(rng.uniform(-6, 6, 3), X) + rng.standard_normal(3)
    start = np.concatenate([X, v]).ravel()
    y = solve_ivp(rates, (0, time[-1]), start, "DOP853", time, rtol=1e-9, atol=1e-10).y.T
    x = y.reshape(len(time), 2, n, 3)[:, 0]
    f = np.array([loads(t) for t in time])
    c = np.einsum("n,tna->ta", mass / mass.sum(), x)
    moment = np.cross(x - c[:, None], f).sum(1)
    return SpringNet(X, mass, K, time, x, f.sum(1), moment, lowest)
