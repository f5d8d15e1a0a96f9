"""A body in partitions as it moves: implicit time steps, the interface forces of each by conjugate gradients.

M u'' + K u = f - B lambda, L_f^T lambda = 0, B^T u = L_f u_f, by average acceleration (Newmark, beta 1/4,
gamma 1/2): second order, unconditionally stable, energy kept. Each step solves with the flexibility
F = B^T (K + 4/dt^2 M)^-1 B. It is definite, so rigid motions of the parts need no coarse problem to make the
step solvable; carried exactly beside (principal deflation) they make it fast where steps are long, and are a
burden where steps are short. Source: principal equations 2.7, 2.8, 4i, 5.3; the deflation is the
F-orthogonal one of R. A. Nicolaides, SIAM J. Numer. Anal. 24 (1987) 355.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from forceid.errors import DataError
from forceid.partition.operators.conjugate_gradient import projected_cg
from forceid.partition.operators.inverse import block_products
from forceid.partition.operators.projection import FLOATING
from forceid.partition.solution.assembly import Assembly
from forceid.partition.system import PartitionedSystem
from forceid.partition.validation import finite
from forceid.records import Array, Indices


@dataclass(frozen=True)
class PartitionedMotion:
    """Every partition over time, and what holds them together.

    time (time,) s; u (time, dof) m, v m/s, a m/s2 of all partitions, one after the other; lam (time,
    multiplier) N: forces of the partitions on the interface; iterations (time,): of conjugate gradients.
    """

    time: Array
    u: Array
    v: Array
    a: Array
    lam: Array
    iterations: Indices


@dataclass(frozen=True)
class TiedParts:
    """Parts of definite matrices D_s tied at their interface: D u = g - B lambda, B^T u = L_f u_f.

    deflation: carry the rigid motions of the parts exactly, W = P_L R_b, in the F-orthogonal projection
    Q = I - W (W^T F W)^-1 W^T F; preconditioner: none, lumped or dirichlet, of D; tolerance: of |P r|, by
    the gap |P_L^T b| that untied parts would show; most: iterations allowed.
    """

    system: PartitionedSystem
    matrix: tuple[Any, ...]
    deflation: bool = True
    preconditioner: str = "none"
    tolerance: float = 1e-10
    most: int = 1000

    @cached_property
    def parts(self) -> Assembly:
        """The parts with D for their stiffness, which leaves no motion free."""
        held = tuple(np.zeros((D.shape[0], 0)) for D in self.matrix)
        return Assembly(self.system.topology, self.matrix, None, held)

    @cached_property
    def coarse(self) -> tuple[Array, Array, Array]:
        """W (multiplier, mode) orthonormal, P_L^T F W and (W^T F W)^-1; no columns without deflation."""
        P = self.system.projection
        value, vector = P.spectrum
        kept = (value >= FLOATING * max(value.max(initial=0.0), 1e-300)) & self.deflation
        W = P.coarse @ (vector[:, kept] / np.sqrt(value[kept]))
        FW = np.empty_like(W)
        for k in range(W.shape[1]):
            FW[:, k] = P.averaged(self.flexibility(W[:, k]))
        return W, FW, np.linalg.inv(W.T @ FW)

    def flexibility(self, lam: Array) -> Array:
        """F lambda = B^T D^-1 B lambda, step by step: as a matrix it would lose what stiff parts move."""
        B = self.system.topology.B
        return np.asarray(B.T @ self.parts.inverse(B @ lam))

    def forces(self, x: Array) -> Array:
        """Q P_L x: forces in balance at every node, F-orthogonal to rigid motions of the parts."""
        W, FW, A = self.coarse
        x = self.system.projection.balanced(x)
        return np.asarray(x - W @ (A @ (FW.T @ x)))

    def gaps(self, x: Array) -> Array:
        """(Q P_L)^T x: gaps that rigid motions of the parts do not close."""
        W, FW, A = self.coarse
        x = self.system.projection.averaged(x)
        return np.asarray(x - FW @ (A @ (W.T @ x)))

    def solve(self, g: Array, guess: Array) -> tuple[Array, Array, int]:
        """Motion (dof,), lambda (multiplier,) and iterations under loads g (dof,), from a guess of lambda."""
        P, B, (W, _, A) = self.system.projection, self.system.topology.B, self.coarse
        F, precondition = self.flexibility, self.parts.precondition(self.preconditioner)
        free = self.parts.inverse(g)
        b = B.T @ free
        r = b - F(guess)
        start = guess + W @ (A @ (W.T @ r))
        left = b - F(start)
        gap = max(np.linalg.norm(P.averaged(b)), np.linalg.norm(P.averaged(r)))
        size = float(np.linalg.norm(self.gaps(left)))
        tolerance = self.tolerance * float(gap) / size if size else 1.0
        done = projected_cg(F, left, self.forces, self.gaps, precondition, tolerance, self.most)
        lam = P.balanced(start + done.x)
        return self.joined(free - self.parts.inverse(B @ lam)), lam, done.count

    def joined(self, u: Array) -> Array:
        """Motions (dof,) with one value at what is shared: what the tolerance leaves open, as a mean.

        A gap left here would swing from step to step for ever, as average acceleration damps nothing.
        """
        B = self.system.topology.B
        return np.asarray(u - B @ self.system.projection.averaged(B.T @ u))


def integrate(
    system: PartitionedSystem,
    load: ArrayLike,
    step: float,
    u: ArrayLike | None = None,
    v: ArrayLike | None = None,
    a: ArrayLike | None = None,
    deflation: bool = True,
    preconditioner: str = "none",
    tolerance: float = 1e-10,
    most: int = 1000,
) -> PartitionedMotion:
    """The motion of a partitioned body under loads over time, by average acceleration.

    load (time, size) N assembled, shared equally, or (time, dof) of all partitions; its first row acts at
    the start. step s; u (size,) m and v (size,) m/s assembled, at the start, None = at rest; a (size,) m/s2,
    None = that of the equations of motion, for which every degree of freedom needs inertia. deflation,
    preconditioner, tolerance, most: as in `TiedParts`. Raises DataError, ConfigError, EstimationError where
    the iterations do not suffice. Source: principal equations 2.8, 4i.

    >>> parts = [[[1.0]], [[1.0]]]
    >>> tied = PartitionedSystem([[[0.0]], [[0.0]]], parts, parts)
    >>> motion = integrate(tied, np.full((3, 1), 4.0), step=0.5)
    >>> motion.u[:, 0].tolist(), motion.lam[2].tolist()
    ([0.0, 0.25, 1.0], [0.0, 0.0])
    """
    if not step > 0:
        raise DataError(f"is {step}, expected a time above zero", "step")
    K, M = system.stiffness, system.masses
    over_time = np.asarray(load, dtype=float)
    if over_time.ndim != 2 or not len(over_time):
        raise DataError(f"has shape {over_time.shape}, expected (time, {system.topology.size})", "load")
    loads = [system.loads(row) for row in over_time]
    options = (deflation, preconditioner, tolerance, most)
    D = tuple(sp.csr_array(k + 4 / step**2 * m) for k, m in zip(K, M, strict=True))
    tied, heavy = TiedParts(system, D, *options), block_products(M, system.topology.dofs)
    now_u, now_v = on_partitions(system, u, "u"), on_partitions(system, v, "v")
    out = loads[0] - system.strained(now_u)
    if a is None:
        check_inertia(M)
        inertia = TiedParts(system, M, *options)
        now_a, lam, taken = inertia.solve(out, np.zeros(len(system.topology.frame)))
    else:
        now_a, taken = on_partitions(system, a, "a"), 0
        lam = system.projection.balanced(system.topology.B.T @ (out - heavy(now_a)))
    history, counts = [(now_u, now_v, now_a, lam)], [taken]
    for f in loads[1:]:
        # only what is added to a coasting motion is solved for: no digits are lost in a long flight, nor, as
        # would be with the acceleration in it, by steps many periods of the fastest mode long
        ahead = now_u + step * now_v
        more, lam, taken = tied.solve(f - system.strained(ahead) + heavy(now_a), lam)
        now_u, now_v, now_a = ahead + more, now_v + 2 / step * more, 4 / step**2 * more - now_a
        history.append((now_u, now_v, now_a, lam))
        counts.append(taken)
    all_u, all_v, all_a, all_lam = (np.array(column) for column in zip(*history, strict=True))
    time = np.asarray(step * np.arange(len(loads)), dtype=float)
    return PartitionedMotion(time, all_u, all_v, all_a, all_lam, np.array(counts, dtype=np.intp))


def on_partitions(system: PartitionedSystem, motion: ArrayLike | None, name: str) -> Array:
    """An assembled motion (size,), None = none, on the partitions (dof,)."""
    top = system.topology
    given = np.zeros(top.size) if motion is None else finite(motion, name)
    if given.shape != (top.size,):
        raise DataError(f"has shape {given.shape}, expected ({top.size},) assembled", name)
    return given[np.concatenate(top.glob)]


def check_inertia(mass: Sequence[Any]) -> None:
    """DataError where the masses of partitions leave a degree of freedom without inertia."""
    for s, m in enumerate(mass):
        bare = np.flatnonzero(m.diagonal() <= 0)
        if len(bare):
            raise DataError(
                f"leaves degree of freedom {bare[0]} without inertia", f"mass of partition {s}",
                "give the acceleration at the start, or give it inertia",
            )  # fmt: skip


def mean_motion(system: PartitionedSystem, u: Array) -> Array:
    """Mean motion alpha (time, alpha) of every partition: M_alpha alpha = R^T M u, the mass gauge.

    u (time, dof) m, or rates of it. Rigid modes of a partition without inertia raise a DataError. Obeys
    M_alpha alpha'' = R^T (f - B lambda) whatever the deformation. Source: principal equations 2.5, 2.8.
    """
    found = []
    modes = system.rigid_modes
    for s, (m, R, d) in enumerate(zip(system.masses, modes, system.topology.dofs, strict=True)):
        try:
            found.append(np.linalg.solve(R.T @ (m @ R), R.T @ (m @ u[:, d].T)).T)
        except np.linalg.LinAlgError:
            raise DataError("moves rigidly without inertia", f"partition {s}", "give it mass") from None
    return np.concatenate(found, axis=1)
