"""What passes between partitions that move: interface forces from measured accelerations, with covariance.

Without stiffness the least multipliers that account for the motion, lambda = N R^T (f - M u''), N = P_L R_b
(R_b^T P_L R_b)^+: exact resultants at every interface that no loop goes through, a guess point by point. With
stiffness and displacements lambda_s = B_s^T (f_s - K_s u_s - M_s u_s''), exact point by point. Source:
principal equations 2.11 A, 4h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from forceid.errors import DataError
from forceid.partition.coupling.resultants import GROUND, LinkResultants, loop_count
from forceid.partition.solution.assembly import Assembly
from forceid.partition.solution.balance import Balance, NoiseSource, applied, balance
from forceid.partition.solution.interfaces import (
    Meeting,
    common_motions,
    interface_sums,
    meetings,
    unseen_resultants,
)
from forceid.partition.validation import finite
from forceid.records import Array, Indices


@dataclass(frozen=True)
class InterfaceForces:
    """Forces of the partitions on the interface, and what they amount to between partitions.

    lam (..., multiplier) N; lam_cov (..., multiplier, multiplier): of what motion tells of them, None where
    no covariance was given. interfaces: one for each set of partitions that meet; between (link,): which of
    them each link of `resultant` crosses. A link goes from a partition to the last one of its interface, so
    an interface of m partitions has m - 1, and passes what the first exerts on the others. resultant: None
    where no rigid motions common to all partitions are known.
    """

    lam: Array
    lam_cov: Array | None
    interfaces: tuple[Meeting, ...]
    between: Indices
    resultant: LinkResultants | None
    balance: Balance


def interface_forces(
    system: Assembly,
    load: Any,
    acceleration: Any = None,
    displacement: Any = None,
    mean_motion: bool = False,
    acceleration_cov: ArrayLike | None = None,
    displacement_cov: ArrayLike | None = None,
    resultant_cov: ArrayLike | None = None,
    motions: ArrayLike | None = None,
) -> InterfaceForces:
    """Interface forces of partitions that move so: without stiffness the least ones that account for it.

    load N and acceleration m/s2: (..., dof) of all partitions, a list with (..., dof) of each, or assembled
    (..., size); loads are then shared equally. acceleration=None: at rest. mean_motion: `acceleration` holds
    (..., alpha) of the rigid modes instead; in the gauge R^T M Phi = 0 nothing is lost. acceleration_cov:
    variances or covariance in the shape of its last axis; resultant_cov (..., alpha, alpha): of
    R^T (f - M u'') beside. motions (size, n): rigid motions of the assembled degrees of freedom,
    `summation_operator` about the point that resultants are wanted about; None: the rigid modes of the
    partitions, where these agree.

    With displacement (..., dof) m about the shape that nothing strains, by stiffness, every one of them:
    lambda_s = B_s^T (f_s - K_s u_s - M_s u_s''). What is left of the balances tests the displacements: a
    stiff body makes large forces of small errors. displacement_cov: as that of the acceleration.

    NaN accelerations give NaN. Raises DataError. Source: principal equations 2.11 A, 4h.

    >>> from forceid.partition.system import PartitionedSystem
    >>> K, M = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.eye(2)
    >>> two_bars = PartitionedSystem([K, K], [M, M], [np.eye(3)[:2], np.eye(3)[1:]], [[[1.0], [1.0]]] * 2)
    >>> pulled = interface_forces(two_bars, [0.0, 0.0, 4.0], acceleration=[1.0, 1.0, 1.0])
    >>> pulled.resultant.links, pulled.resultant.wrench
    (((0, 1),), array([[-2.]]))
    """
    f, R, B = loads(system, load), system.modes, system.topology.B
    N = nominal(system) if displacement is None else None
    b, lam, noise = applied(R.T, f), applied(B.T, f), []
    size = applied(abs(R).T, np.abs(f))
    alpha = R.shape[1]
    if displacement is not None:  # which R^T K = 0 keeps out of b
        u = stacked_parts(system, displacement)
        strains = sp.block_diag(system.stiffness, format="csr") @ prolongation(
            system, u.shape[-1], "displacement"
        )
        lam = lam - applied(B.T @ strains, u)
        size = size + applied(abs(R).T, applied(abs(strains), np.abs(u)))
        if displacement_cov is not None:
            G = (B.T @ strains).toarray()
            C = covariance(displacement_cov, G.shape[1], "displacement_cov")
            noise.append(NoiseSource(C, G, np.zeros((alpha, G.shape[1]))))
    if acceleration is not None:
        a = stacked_parts(system, acceleration)
        carries = sp.block_diag(system.masses, format="csr") @ prolongation(
            system, a.shape[-1], "acceleration", mean_motion
        )
        b, lam = b - applied(R.T @ carries, a), lam - applied(B.T @ carries, a)
        size = size + applied(abs(R.T @ carries), np.abs(a))
        if acceleration_cov is not None:
            D = (R.T @ carries).toarray()
            C = covariance(acceleration_cov, D.shape[1], "acceleration_cov")
            noise.append(NoiseSource(C, (B.T @ carries).toarray() if N is None else N @ D, D))
    if resultant_cov is not None:
        C = covariance(resultant_cov, alpha, "resultant_cov")
        noise.append(NoiseSource(C, np.zeros((B.shape[1], alpha)) if N is None else N, np.eye(alpha)))
    return complete_forces(system, lam if N is None else b @ N.T, b, size, noise, motions, N)


def complete_forces(
    system: Assembly,
    lam: Array,
    b: Array,
    size: Array,
    noise: Sequence[NoiseSource],
    motions: ArrayLike | None,
    N: Array | None,
) -> InterfaceForces:
    """Covariance, resultants and balance of lambda; N, if that is what made it of b = R^T (f - M u'')."""
    interfaces = meetings(system)
    lam_cov = sum((n.carried(n.to_lam) for n in noise), np.zeros(())) if noise else None
    b_cov = sum((n.carried(n.to_resultant) for n in noise), np.zeros(())) if noise else None
    links = [(a, k) for k, i in enumerate(interfaces) for a in i.partitions[:-1]]
    S = common_motions(system) if motions is None else np.asarray(motions, dtype=float)
    if S is not None and (S.ndim != 2 or len(S) != system.topology.size):
        raise DataError(f"has shape {S.shape}, expected ({system.topology.size}, n)", "motions")
    resultant = None
    if S is not None and links:
        H = interface_sums(system, interfaces, S)
        Z = np.zeros((len(H), 0)) if N is None else unseen_resultants(system, N, H, S.shape[1])
        determined = H - Z @ (Z.T @ H)
        pairs = tuple((a, interfaces[k].partitions[-1]) for a, k in links)
        modes = [r.shape[1] for r in system.rigid_modes]
        held = [(s, GROUND) for s, count in enumerate(modes) if count < S.shape[1]]
        whole = system.projection.whole
        out = b @ whole
        weight = np.linalg.pinv(whole.T @ whole if b_cov is None else whole.T @ b_cov @ whole)
        resultant = LinkResultants(
            links=pairs,
            wrench=(lam @ determined.T).reshape(*lam.shape[:-1], len(links), -1),
            joint_cov=None if lam_cov is None else determined @ lam_cov @ determined.T,
            null_space=Z,
            loops=loop_count([*pairs, *held], len(modes)),
            chi_square=np.asarray((out * (weight @ out[..., None])[..., 0]).sum(-1)),
            dof=whole.shape[1],
        )
    between = np.array([k for _, k in links], dtype=np.intp)
    left = balance(system, lam, b, size, noise)
    return InterfaceForces(lam, lam_cov, interfaces, between, resultant, left)


def nominal(system: Assembly) -> Array:
    """N = P_L R_b (R_b^T P_L R_b)^+ (multiplier, alpha)."""
    P = system.projection
    inverse = [P.solve_coarse(e) for e in np.eye(P.R_b.shape[1])]
    return np.asarray(P.coarse @ np.stack(inverse, axis=1)) if inverse else np.zeros(P.R_b.shape)


def stacked_parts(system: Assembly, value: Any) -> Array:
    """An array as it is, or the arrays (..., dof) of each partition one after the other."""
    sizes = [len(g) for g in system.topology.glob]
    if isinstance(value, list | tuple) and [np.shape(x)[-1:] for x in value] == [(n,) for n in sizes]:
        return np.concatenate([np.asarray(x, dtype=float) for x in value], axis=-1)
    return np.atleast_1d(np.asarray(value, dtype=float))


def prolongation(system: Assembly, width: int, name: str, mean_motion: bool = False) -> Any:
    """What takes numbers to all partitions, (dof, width): the identity, L, or R of mean motions."""
    top = system.topology
    total = top.dofs[-1].stop
    if mean_motion:
        R = system.modes
        if width != R.shape[1]:
            raise DataError(f"has {width} columns, expected {R.shape[1]}, one a rigid mode", name)
        return R
    if width not in (total, top.size):
        raise DataError(
            f"has {width} columns, expected {total} of all partitions, or {top.size} assembled", name
        )
    return sp.eye_array(total, format="csr") if width == total else top.L


def loads(system: Assembly, load: Any) -> Array:
    """Loads (..., dof) on the partitions, assembled ones in equal shares."""
    f = finite(stacked_parts(system, load), "load")
    T = prolongation(system, f.shape[-1], "load")
    return applied(T, f / system.topology.count if T.shape[0] != T.shape[1] else f)


def covariance(given: ArrayLike, n: int, name: str) -> Array:
    """Variances (n,) or a covariance (..., n, n)."""
    C = np.asarray(given, dtype=float)
    if C.shape != (n,) and C.shape[-2:] != (n, n):
        raise DataError(f"has shape {C.shape}, expected ({n},) or (..., {n}, {n})", name)
    return C
