"""A million degrees of freedom in 64 parts of 3-D bricks: time, memory and iterations beside the peers.

    python -m evidence.theory.million -o docs [--r 17]

Writes million.md. A cube of 4 x 4 x 4 parts of r^3 bricks, held at one face and loaded at the other; every
method is a process of its own, so that each shows its own peak of memory, and is stopped at LIMIT.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np
import scipy.sparse as sp

from evidence.written import asked, paged, table
from forceid.partition.grids import Parts, solid_parts
from forceid.records import Array, Flags

PARTS = 4
TOLERANCE = 1e-8
LIMIT = 20.0  # GB of memory
PATIENCE = 900.0  # s of process time
HEADS = (
    "method", "unknowns", "iterations", "set up, s", "solve, s", "memory, GB", "residual", "energy, J",
    "factors", "stopped by",
)  # fmt: skip

MethodResult = dict[str, Any]


def cube(r: int) -> tuple[Parts, Array, Flags]:
    """The cube, its assembled nodal load (node, 3) N, and which nodes are held."""
    body = solid_parts((PARTS,) * 3, r)
    f = np.zeros_like(body.place)
    tip = np.isclose(body.place[:, 0], PARTS)
    f[tip] = np.array([0.0, 0.4, -1.0]) / tip.sum()
    return body, f, np.isclose(body.place[:, 0], 0)


def in_parts(preconditioner: str) -> Callable[[int], MethodResult]:
    """Projected conjugate gradients of ours."""

    def solve(r: int) -> MethodResult:
        body, f, held = cube(r)
        load, began = f[~held].ravel(), process_time()
        system = body.system(held)
        each, _ = system.factored
        factored = process_time()
        done = system.solve_cg(load, preconditioner, tolerance=TOLERANCE)
        assert done.iterations is not None
        ended = process_time()
        u = np.zeros(len(load))
        u[np.concatenate(system.topology.glob)] = done.u
        return {
            "iterations": done.iterations.count, "set up, s": factored - began, "solve, s": ended - factored,
            "factors": len(each),
        } | judged_answer(assembled(body, held), load, u)  # fmt: skip

    return solve


def by_multigrid(r: int) -> MethodResult:
    """Conjugate gradients with PyAMG's smoothed aggregation that knows the rigid modes."""
    import pyamg

    from forceid import summation_operator

    body, f, held = cube(r)
    A, load, x = assembled(body, held), f[~held].ravel(), body.place[~held]
    residuals: list[float] = []
    began = process_time()
    solver = pyamg.smoothed_aggregation_solver(sp.csr_matrix(A), B=summation_operator(x, x.mean(0)))
    ready = process_time()
    u = solver.solve(load, tol=TOLERANCE, accel="cg", residuals=residuals, maxiter=500)
    ended = process_time()
    return {
        "iterations": len(residuals) - 1, "set up, s": ready - began, "solve, s": ended - ready,
    } | judged_answer(A, load, u)  # fmt: skip


def directly(r: int) -> MethodResult:
    """scipy.sparse.linalg.spsolve on the assembled matrix."""
    from scipy.sparse.linalg import spsolve

    body, f, held = cube(r)
    A, load = sp.csc_array(assembled(body, held)), f[~held].ravel()
    began = process_time()
    u = spsolve(A, load, permc_spec="MMD_AT_PLUS_A")
    return {"solve, s": process_time() - began} | judged_answer(A, load, u)


METHODS: dict[str, Callable[[int], MethodResult]] = {
    "projected CG, lumped": in_parts("lumped"),
    "projected CG, dirichlet": in_parts("dirichlet"),
    "CG with PyAMG": by_multigrid,
    "scipy spsolve": directly,
}


def assembled(body: Parts, held: Flags) -> Any:
    """K of the whole, free degrees of freedom only."""
    L, K = sp.vstack([sp.csr_array(b) for b in body.boolean]), sp.block_diag(body.stiffness, format="csr")
    free = np.flatnonzero(np.repeat(~held, 3))
    return sp.csr_array(sp.csr_array(L.T @ K @ L)[free][:, free])


def judged_answer(A: Any, load: Array, u: Array) -> MethodResult:
    """Unknowns, residual of the assembled equations and energy of an answer."""
    left = float(np.linalg.norm(load - A @ u) / np.linalg.norm(load))
    return {"unknowns": len(u), "residual": left, "energy, J": f"{0.5 * float(load @ u):.12g}"}


def run_alone(method: str, r: int) -> MethodResult:
    """What one method does in a process of its own, or what stopped it."""
    argv = [sys.executable, "-m", "evidence.theory.million", "-o", ".", "--one", method, "--r", str(r)]
    done = subprocess.run(argv, capture_output=True, text=True, check=False)
    last = (done.stderr.strip().splitlines() or [f"stopped by signal {-done.returncode}"])[-1]
    found: MethodResult = json.loads(done.stdout) if done.returncode == 0 else {"stopped by": last[:80]}
    return {"method": method, "r": r} | found


def run_method(method: str, r: int) -> None:
    """The one method, as JSON; a direct one within the limit of memory, which it would take all of."""
    if METHODS[method] is directly:
        resource.setrlimit(resource.RLIMIT_AS, (int(LIMIT * 1e9),) * 2)
    resource.setrlimit(resource.RLIMIT_CPU, (int(PATIENCE),) * 2)
    found = METHODS[method](r)
    print(json.dumps(found | {"memory, GB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6}))


def main() -> None:
    """The study."""
    given = asked("evidence.theory.million", __doc__, r=(8, 17), one="all")
    if given.one != "all":
        run_method(given.one, given.r[0])
        return
    rows = []
    for r in given.r:
        for method in METHODS:
            rows.append(run_alone(method, r))
            print(rows[-1], flush=True)
    about = (
        f"`{given.command}`: a cube of {PARTS} x {PARTS} x {PARTS} parts of "
        f"{', '.join(f'{r}^3' for r in given.r)} bricks, to {TOLERANCE:.0e} of the residual that each method "
        "iterates on. CPU time of one thread from the matrices on; every method is a process of its own; "
        f"memory: its peak, which includes making the matrices; residual: of the assembled equations. A "
        f"method is stopped after {PATIENCE:.0f} s, a direct one at {LIMIT:.0f} GB. Parts that are equal are "
        "factored once."
    )
    title = "A million degrees of freedom in 64 parts of 3-D bricks"
    paged(given.output, "million", title, about, table(rows, HEADS))


if __name__ == "__main__":
    main()
