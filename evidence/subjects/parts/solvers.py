"""Who solves a body in parts: forceid in parts, and peers on the assembled matrix or on the saddle point.

Each gets the matrices that it works on, builds what it needs, and answers displacements and interface forces;
peers that solve for displacements alone get their interface forces as f_s - K_s u_s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, cg, minres, splu, spsolve

from evidence.subject import Answer, Contestant
from evidence.subjects.parts.cases import PartsCase
from forceid.errors import EstimationError
from forceid.partition import PartitionedSystem, Statics
from forceid.records import Array

TOLERANCES = (1e-4, 1e-7, 1e-10)
MOST = 5000  # iterations
VARIANTS = (
    ("cg none", "none", "multiplicity"),
    ("cg lumped", "lumped", "multiplicity"),
    ("cg dirichlet", "dirichlet", "multiplicity"),
    ("cg dirichlet by stiffness", "dirichlet", "stiffness"),
)
DEFAULT = "cg dirichlet 1e-10"  # what solve_cg does when nothing is said


Solve = Callable[[], Answer]


def entrant(name: str, kind: str, build: Callable[[PartsCase], Solve], about: str, **more: Any) -> Contestant:
    """One way to solve: build(case) does what every load shares, and gives the solution for the load."""

    def prepare(case: PartsCase) -> Solve:
        assert case.assembled.shape[0] == len(case.load)  # matrices are given, and not timed

        def job() -> Answer:
            solve = build(case)
            return replace(solve(), again=solve)

        return job

    return Contestant(name, prepare, kind, about, **more)


def entrants() -> tuple[list[Contestant], list[str]]:
    """Ours first, the peers whose library is installed, and the libraries that are not."""
    found = [entrant("direct", "method", direct, "PartitionedSystem.solve, saddle point")]
    for line, preconditioner, weights in VARIANTS:
        about = f"solve_cg, {preconditioner}, weights by {weights}"
        found += each_tolerance(line, "method", partial(by_projection, preconditioner, weights), about)
    found += [
        entrant("scipy spsolve", "peer", assembled_direct, "spsolve, assembled"),
        entrant("scipy splu", "peer", symmetric_direct, "splu, symmetric mode, assembled"),
        *each_tolerance(
            "scipy cg Jacobi", "peer", cg_with_diagonal, "cg, diagonal preconditioner, assembled"
        ),
        *each_tolerance(
            "scipy MINRES", "peer", saddle_minres, "minres, saddle point, matrix-free", slow=1e-10
        ),
    ]
    missing = [] if find_spec("pyamg") else ["PyAMG"]
    if not missing:
        about = "cg, smoothed aggregation that knows the rigid modes, assembled"
        found += each_tolerance("PyAMG", "peer", multigrid, about)
    return found, missing


def each_tolerance(
    line: str, kind: str, build: Callable[[float, PartsCase], Solve], about: str, slow: float = 0.0
) -> list[Contestant]:
    """A solver at every tolerance; at those up to `slow` not in the short chart."""
    return [
        entrant(f"{line} {t:.0e}", kind, partial(build, t), f"{about}, {t:.0e}", line=line, slow=t <= slow)
        for t in TOLERANCES
    ]


def system_of(case: PartsCase) -> PartitionedSystem:
    """The partitioned system, built from the matrices of the parts."""
    return PartitionedSystem(case.stiffness, None, case.boolean, case.modes)


def direct(case: PartsCase) -> Solve:
    """Ours, directly."""
    system = system_of(case)

    def solve() -> Answer:
        return answer_of_statics(system.solve(case.load))

    return solve


def by_projection(preconditioner: str, weights: str, tolerance: float, case: PartsCase) -> Solve:
    """Ours, by projected conjugate gradients."""
    system = system_of(case)

    def solve() -> Answer:
        return answer_of_statics(system.solve_cg(case.load, preconditioner, weights, tolerance, most=MOST))

    return solve


def answer_of_statics(done: Statics) -> Answer:
    """What forceid answers."""
    steps = done.iterations.count if done.iterations else None
    claimed = done.error, done.lam_error
    return Answer((done.u, done.lam), claimed, done.verdict.level, done.verdict.reasons, steps=steps)


def answer_in_parts(case: PartsCase, u: Array, iterations: int | None = None) -> Answer:
    """The answer that assembled displacements (size,) are."""
    return Answer((case.L @ u, case.residual(u)[case.shared]), steps=iterations)


def assembled_direct(case: PartsCase) -> Solve:
    """SuperLU as it comes."""
    return lambda: answer_in_parts(case, spsolve(sp.csc_array(case.assembled), case.load))


def symmetric_direct(case: PartsCase) -> Solve:
    """SuperLU as one uses it who knows that the matrix is symmetric and definite."""
    options = {"SymmetricMode": True}
    K = sp.csc_array(case.assembled)
    lu = splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    return lambda: answer_in_parts(case, lu.solve(case.load))


def cg_with_diagonal(tolerance: float, case: PartsCase) -> Solve:
    """Conjugate gradients with the diagonal."""
    K, inverse = case.assembled, 1 / case.assembled.diagonal()
    M = LinearOperator(K.shape, matvec=lambda x: inverse * np.ravel(x), dtype=float)

    def solve() -> Answer:
        steps: list[None] = []
        u, short = cg(K, case.load, rtol=tolerance, maxiter=MOST, M=M, callback=lambda _: steps.append(None))
        return answer_in_parts(case, arrived(u, short), len(steps))

    return solve


def saddle_minres(tolerance: float, case: PartsCase) -> Solve:
    """MINRES on [F -R_b L_f; -R_b^T 0 0; L_f^T 0 0], with the factors of the parts that ours has."""
    system = system_of(case)
    top, R_b = system.topology, sp.csr_array(system.R_b)
    B, L_f = top.B, top.L_f
    R: Any = sp.block_diag(case.modes)
    n, a, m = len(top.frame), R_b.shape[1], len(top.interface)
    B_T, R_b_T, L_f_T = (sp.csr_array(matrix.T) for matrix in (B, R_b, L_f))

    def apply(x: Array) -> Array:
        lam, alpha, frame = np.split(np.ravel(x), [n, n + a])
        gap = B_T @ system.inverse(B @ lam) - R_b @ alpha + L_f @ frame
        return np.concatenate([gap, -(R_b_T @ lam), L_f_T @ lam])

    operator = LinearOperator((n + a + m,) * 2, matvec=apply, dtype=float)

    def solve() -> Answer:
        steps: list[None] = []
        f = system.loads(case.load)
        right = np.concatenate([B_T @ system.inverse(f), -system.resultant(f), np.zeros(m)])
        x, short = minres(
            operator, right, rtol=tolerance, maxiter=MOST, callback=lambda _: steps.append(None)
        )
        lam, alpha, _ = np.split(arrived(x, short), [n, n + a])
        return Answer((system.inverse(f - B @ lam) + R @ alpha, lam), steps=len(steps))

    return solve


def multigrid(tolerance: float, case: PartsCase) -> Solve:
    """Conjugate gradients with algebraic multigrid."""
    pyamg = import_module("pyamg")
    levels = pyamg.smoothed_aggregation_solver(sp.csr_matrix(case.assembled), B=case.rigid)

    def solve() -> Answer:
        left: list[float] = []
        # the seed of its estimates of spectral radii is numpy's own: iterations may differ by one or two
        u: Any = levels.solve(case.load, tol=tolerance, accel="cg", residuals=left, maxiter=MOST)
        return answer_in_parts(case, u, len(left) - 1)

    return solve


def arrived(x: Any, short: int) -> Array:
    """The solution; EstimationError where iterations ended before the tolerance was met."""
    if short:
        raise EstimationError(f"does not meet its tolerance in {MOST} steps")
    return np.asarray(x)
