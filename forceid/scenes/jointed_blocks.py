"""Blocks held together by joints: accelerations and joint loads of one instant.

Every block keeps its six coordinates. The accelerations and the joint forces, which are the Lagrange
multipliers of the joints, solve the equations of motion of all blocks together with the constraints
differentiated twice:

    m_i a_i = m_i g + f_i + sum of joint forces          c_k + R_k b = c_i + R_i a      (ball, 3 rows)
    H_i'    = sum of joint moments about c_i             u_1' . e = u_2' . e = 0        (hinge, 2 more)

with e the hinge axis in the block before the joint and u' two axes across it in the block behind. Along the
hinge axis, or about all axes of a ball, act a spring (straight chain: no moment) and a damper, and about the
axis of a joint a motor. A joint load acts on the block behind the joint, with its moment about the joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.records import Array


@dataclass(frozen=True)
class Chain:
    """Constants of a chain: mass (block,), inertia (block, 3, 3) in block axes; kind (joint,) "hinge" or
    "ball", arms (joint, 2, 3) m from the centers of the blocks before and behind to the joint, axis (joint,
    3) and two across (joint, 2, 3) it, stiffness N m/rad and damping N m s/rad (joint,); gravity (3,) m/s2,
    and the block whose center is pushed.
    """

    mass: Array
    inertia: Array
    kind: tuple[str, ...]
    arms: Array
    axis: Array
    across: Array
    stiffness: Array
    damping: Array
    gravity: Array
    push_block: int


@dataclass(frozen=True)
class ChainState:
    """One instant, world axes: center, velocity, omega (block, 3), R (block, 3, 3)."""

    center: Array
    velocity: Array
    R: Array
    omega: Array


def cross_matrices(a: Array) -> Array:
    """[a]x of vectors (..., 3)."""
    x, y, z = np.moveaxis(a, -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack(r, -1) for r in ((o, -z, y), (z, o, -x), (-y, x, o))], -2)


def passive_moment(chain: Chain, now: ChainState, motor: Array) -> Array:
    """Moment (joint, 3) N m of spring, damper and motor (joint,) on the block behind each joint."""
    bend = Rotation.from_matrix(now.R[1:] @ now.R[:-1].mT).as_rotvec()
    rate = now.omega[1:] - now.omega[:-1]
    moment = -chain.stiffness[:, None] * bend - chain.damping[:, None] * rate
    e = (now.R[:-1] @ chain.axis[..., None])[..., 0]
    hinge = np.array([kind == "hinge" for kind in chain.kind])[:, None]
    return np.asarray(np.where(hinge, (moment * e).sum(1, keepdims=True) * e, moment) + motor[:, None] * e)


def solve_joints(chain: Chain, now: ChainState, loads: tuple[Array, Array]) -> tuple[Array, Array, Array]:
    """Accelerations (block, 6), joint forces and moments (joint, 3) on the blocks behind, of one instant.

    loads: push (3,) N and motor moments (joint,) N m.
    """
    n, R, w = len(chain.mass), now.R, now.omega
    J = R @ chain.inertia @ R.mT
    M, load = np.zeros((6 * n, 6 * n)), np.zeros((n, 6))
    for i in range(n):
        M[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = chain.mass[i] * np.eye(3)
        M[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = J[i]
    load[:, :3] = chain.mass[:, None] * chain.gravity
    load[chain.push_block, :3] += loads[0]
    load[:, 3:] = -np.cross(w, (J @ w[..., None])[..., 0])
    passive = passive_moment(chain, now, loads[1])
    load[1:, 3:] += passive
    load[:-1, 3:] -= passive
    rows, right = [], []
    for j, kind in enumerate(chain.kind):
        before, behind = R[j] @ chain.arms[j, 0], R[j + 1] @ chain.arms[j, 1]
        G = np.zeros((5 if kind == "hinge" else 3, n, 6))
        G[:3, j, :3], G[:3, j, 3:] = -np.eye(3), cross_matrices(before)
        G[:3, j + 1, :3], G[:3, j + 1, 3:] = np.eye(3), -cross_matrices(behind)
        late = np.cross(w[j], np.cross(w[j], before)) - np.cross(w[j + 1], np.cross(w[j + 1], behind))
        if kind == "hinge":
            e, u = R[j] @ chain.axis[j], chain.across[j] @ R[j + 1].T
            normal = np.cross(u, e)
            G[3:, j, 3:], G[3:, j + 1, 3:] = -normal, normal
            turning = np.cross(np.cross(w[j + 1], u), e) + np.cross(u, np.cross(w[j], e))
            late = np.append(late, -turning @ (w[j + 1] - w[j]))
        rows.append(G.reshape(len(G), 6 * n))
        right.append(late)
    G, k = np.concatenate(rows), sum(map(len, rows))
    system = np.block([[M, -G.T], [G, np.zeros((k, k))]])
    solution = np.linalg.solve(system, np.concatenate([load.ravel(), *right]))
    force, moment, at = np.zeros((n - 1, 3)), passive.copy(), 6 * n
    for j, G_j in enumerate(rows):
        force[j] = solution[at : at + 3]
        moment[j] += G_j[3:, 6 * j + 9 : 6 * j + 12].T @ solution[at + 3 : at + len(G_j)]
        at += len(G_j)
    return solution[: 6 * n].reshape(n, 6), force, moment
