"""Two elastic nets of point masses on a ball joint, in flight, for forces in joints between parts that bend.

Every pair of the nine masses of a net is tied by a spring, and damped to 3 % at the softest mode of the net.
The joint is a mass of each net; the force in it keeps both at one acceleration. They start turning, each by
itself and unstrained, so that they ring. Weight is the only load. DOP853.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from forceid.records import Array, Body, Motion, Recording

MASSES, FRAMES, RATE = 9, 200, 200.0  # of a net, of a record, Hz
DAMPING = 0.03  # of critical, of the softest mode
G = np.array([0.0, 0.0, -9.81])


def joined_nets(seed: int, frequency: tuple[float, float], noise: float) -> Recording:
    """A pair of nets whose softest modes are drawn between two frequencies (Hz), seen with noise (m).

    truth: joint_force (time, 1, 3) N on the second net.
    """
    rng = np.random.default_rng(seed)
    nets = [drawn_net(rng, behind, frequency) for behind in (False, True)]
    X, mass = np.stack([net[0] for net in nets]), np.stack([net[1] for net in nets])
    first, second = np.triu_indices(MASSES, 1)
    length = np.linalg.norm(X[:, second] - X[:, first], axis=2)

    def accelerations(y: Array) -> tuple[Array, Array]:
        x, v = y.reshape(2, 2, MASSES, 3)
        f = mass[..., None] * G
        for k, (_, _, stiffness, damper) in enumerate(nets):
            apart, parting = x[k, second] - x[k, first], v[k, second] - v[k, first]
            size = np.linalg.norm(apart, axis=1)
            along = apart / size[:, None]
            pull = stiffness * (size - length[k]) + damper * (parting * along).sum(1)
            np.add.at(f[k], first, pull[:, None] * along)
            np.add.at(f[k], second, -pull[:, None] * along)
        a = f / mass[..., None]
        lighter = 1 / mass[:, -1]
        force = (a[0, -1] - a[1, -1]) / lighter.sum()
        a[0, -1] -= lighter[0] * force
        a[1, -1] += lighter[1] * force
        return a, force

    def rates(_: float, y: Array) -> Array:
        return np.concatenate([y[len(y) // 2 :], accelerations(y)[0].ravel()])

    time = np.arange(FRAMES) / RATE
    start = np.concatenate([X.ravel(), np.cross(rng.uniform(-4, 4, (2, 1, 3)), X).ravel()])
    flown = solve_ivp(rates, (0, time[-1]), start, "DOP853", time, rtol=1e-8, atol=1e-10).y.T
    x = flown[:, : X.size].reshape(FRAMES, 2 * MASSES, 3)
    force = np.stack([accelerations(y)[1] for y in flown])
    names = tuple(f"{net}{k}" for net in "ab" for k in range(MASSES))
    body = Body(names, X.reshape(-1, 3), mass.ravel(), internal_momentum=np.zeros(3))
    motion = Motion(time, x + noise * rng.standard_normal(x.shape), gravity=G, noise_std={"position": noise})
    return Recording(body, motion, {"joint_force": force[:, None]})


def drawn_net(
    rng: np.random.Generator, behind: bool, frequency: tuple[float, float]
) -> tuple[Array, Array, float, float]:
    """Places (mass, 3) m about the joint, which is the last, masses kg, stiffness N/m and damper N s/m."""
    box = np.array([0.24, 0.12, 0.08]) * rng.uniform(0.7, 1.3, 3)
    corners = np.array([[a, b, c] for a in (0.1, 1.1) for b in (-0.5, 0.5) for c in (-0.5, 0.5)]) * box
    if not behind:
        corners[:, 0] -= 1.2 * box[0]
    X = np.vstack([corners + 0.01 * rng.standard_normal(corners.shape), np.zeros(3)])
    mass = rng.uniform(0.02, 0.06, MASSES)
    first, second = np.triu_indices(MASSES, 1)
    along = X[second] - X[first]
    along /= np.linalg.norm(along, axis=1)[:, None]
    stretch = np.zeros((len(along), MASSES, 3))
    each = np.arange(len(along))
    stretch[each, first], stretch[each, second] = -along, along
    stretch = stretch.reshape(len(along), -1) / np.sqrt(np.repeat(mass, 3))
    softest = np.linalg.eigvalsh(stretch.T @ stretch)[6]
    turn = 2 * np.pi * rng.uniform(*frequency)
    stiffness = turn**2 / softest
    return X, mass, stiffness, 2 * DAMPING * stiffness / turn
