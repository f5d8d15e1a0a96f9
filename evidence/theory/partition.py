"""Iterations of partitioned solvers against size, number of parts and jumps of stiffness, and against peers.

    python -m evidence.theory.partition -o docs [--quick]

Writes partition.md and partition.png. Bodies, loads and tolerance are those of the theory note, section 5.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, minres, spsolve

from evidence.written import asked, pictured, table, written
from forceid.partition import PartitionedSystem
from forceid.partition.grids import Parts, solid_parts
from forceid.records import Array, Flags

NAMES = ("none", "lumped", "dirichlet")
JUMPS = (1.0, 1e2, 1e4, 1e6)
TOLERANCE = 1e-10


def plate(parts: tuple[int, int], r: int, young: Any = 1000.0) -> tuple[Parts, Array, Flags]:
    """The plate of section 5.3: parts, assembled nodal load (node, 2) and which nodes are held."""
    body = solid_parts(parts, r, young)
    x = body.place
    f = np.zeros_like(x)
    tip = np.isclose(x[:, 0], parts[0])
    f[tip] += np.array([0.3, -1.0]) / tip.sum()
    top = np.isclose(x[:, 1], parts[1])
    f[top, 1] += 0.1 * x[top, 0] / (parts[0] * r)
    return body, f, np.isclose(x[:, 0], 0)


def counted(body: Parts, f: Array, held: Flags) -> dict[str, Any]:
    """Iterations and conditions by preconditioner, of MINRES on the saddle point, and of CG without R."""
    system = body.system(held)
    load = f[~held].ravel()
    found: dict[str, Any] = {"size": system.topology.size, "multipliers": len(system.topology.frame)}
    for name in NAMES:
        done = system.solve_cg(load, name, most=5000).iterations
        assert done is not None
        found[name], found[f"{name} condition"] = done.count, done.condition
    found["minres"] = by_minres(system, load)
    found["violated"] = without_principal_part(system, load)
    return found


def by_minres(system: PartitionedSystem, load: Array) -> int:
    """Iterations of MINRES on the saddle-point system, matrix-free, to the same residual."""
    top, f = system.topology, system.loads(load)
    B, R_b, L_f = top.B, system.R_b, top.L_f
    n, a, m = len(top.frame), R_b.shape[1], len(top.interface)

    def apply(x: Array) -> Array:
        lam, alpha, frame = np.split(np.ravel(x), [n, n + a])
        return np.concatenate(
            [system.flexibility(lam) - R_b @ alpha + L_f @ frame, -R_b.T @ lam, L_f.T @ lam]
        )

    steps = 0

    def count(_: Array) -> None:
        nonlocal steps
        steps += 1

    right = np.concatenate([B.T @ system.inverse(f), -system.resultant(f), np.zeros(m)])
    operator = LinearOperator((n + a + m,) * 2, matvec=apply, dtype=float)
    minres(operator, right, rtol=TOLERANCE, maxiter=20000, callback=count)
    return steps


def without_principal_part(system: PartitionedSystem, load: Array) -> float:
    """What CG on P_L F P_L alone leaves of R_b^T lambda = R^T f, over the size of R^T f."""
    from forceid.partition.conjugate_gradient import projected_cg

    P, f = system.projection, system.loads(load)
    b = np.asarray(system.topology.B.T @ system.inverse(f))
    done = projected_cg(system.flexibility, b, P.balanced, P.averaged, lambda x: x, TOLERANCE, 5000)
    out = system.R_b.T @ done.x - system.resultant(f)
    return float(np.linalg.norm(out) / np.linalg.norm(system.resultant(f)))


def checked(body: Parts, f: Array, held: Flags) -> float:
    """Largest error of the displacements over their largest, of CG against the assembled scipy solution."""
    system = body.system(held)
    load = f[~held].ravel()
    L, K = system.topology.L, sp.block_diag(system.stiffness)
    u = spsolve(sp.csc_array(L.T @ K @ L), load)
    return float(np.abs(system.solve_cg(load).u - L @ u).max() / np.abs(u).max())


def jumped(parts: tuple[int, int], r: int, jump: float, pattern: str) -> dict[str, Any]:
    """Iterations with both weights where every other strip, or field of a checkerboard, is stiffer."""
    place = [(i, j) for i in range(parts[0]) for j in range(parts[1])]
    stiff = [(i % 2 if pattern == "strips" else (i + j) % 2) for i, j in place]
    body, f, held = plate(parts, r, [1000.0 * (jump if s else 1.0) for s in stiff])
    system, load = body.system(held), f[~held].ravel()
    found: dict[str, Any] = {"pattern": pattern, "jump": jump}
    for weights in ("multiplicity", "stiffness"):
        for name in NAMES:
            try:
                done = system.solve_cg(load, name, weights, most=3000).iterations
                found[f"{name}, {weights}"] = done.count if done else 0
            except Exception as error:  # that it does not get there is the finding
                found[f"{name}, {weights}"] = f"> 3000 ({type(error).__name__})"
    return found


def draw(by_size: Sequence[dict[str, Any]], by_parts: Sequence[dict[str, Any]], jumps: Sequence[Any]) -> Any:
    """Iterations against H/h, number of parts, and jump."""
    import matplotlib as mpl

    from forceid.report.style import CYCLE, INK, STYLE, panels

    with mpl.rc_context(STYLE):
        figure, axes = panels(1, 3, (12.0, 3.8))
        for ax, rows, key, label in (
            (axes[0, 0], by_size, "r", "elements an edge of a part, H/h"),
            (axes[0, 1], by_parts, "parts", "parts"),
        ):
            at = [row[key] for row in rows]
            for color, name in zip(CYCLE, (*NAMES, "minres"), strict=False):
                ax.plot(at, [row[name] for row in rows], "o-", color=color, label=name)
            ax.set(xscale="log", yscale="log", xlabel=label, ylabel="iterations")
            ax.set_xticks(at, [f"{v}" for v in at])
            ax.minorticks_off()
        first = by_size[0]
        grown = [first["dirichlet"] * ((1 + log(row["r"])) / (1 + log(first["r"]))) for row in by_size]
        axes[0, 0].plot([row["r"] for row in by_size], grown, ":", color=INK, label="1 + log H/h")
        axes[0, 0].legend()
        axes[0, 0].set_title("Plate in 2 x 2 parts")
        axes[0, 1].set_title("Four elements an edge")
        ax = axes[0, 2]
        for color, (pattern, weights) in zip(
            CYCLE,
            [(p, w) for p in ("strips", "checkerboard") for w in ("multiplicity", "stiffness")],
            strict=False,
        ):
            rows = [row for row in jumps if row["pattern"] == pattern]
            count = [row[f"dirichlet, {weights}"] for row in rows]
            known = [(row["jump"], c) for row, c in zip(rows, count, strict=True) if isinstance(c, int)]
            ax.plot(*zip(*known, strict=True), "o-", color=color, label=f"{pattern}, weights by {weights}")
        ax.set(xscale="log", yscale="log", xlabel="jump of stiffness", ylabel="iterations, Dirichlet")
        ax.set_title("Stiffness that jumps, 4 x 4 parts")
        ax.legend()
    return figure


def main() -> None:
    """The study."""
    given = asked("evidence.theory.partition", __doc__, quick=False)
    sizes, grids = ((2, 4), (2, 3)) if given.quick else ((2, 4, 8, 16), (2, 3, 4, 6, 8))
    by_size = [{"r": r, **counted(*plate((2, 2), r))} for r in sizes]
    by_parts = [{"parts": p * p, **counted(*plate((p, p), 4))} for p in grids]
    right = checked(*plate((grids[-1],) * 2, 4))
    jumps = [jumped((4, 4), 4, j, pattern) for pattern in ("strips", "checkerboard") for j in JUMPS]
    heads = ["size", "multipliers", *NAMES, *(f"{n} condition" for n in NAMES), "minres", "violated"]
    page = [
        "# Bodies in parts: iterations",
        f"`{given.command}`: the plate of the theory "
        f"note, section 5.3, to {TOLERANCE:.0e} of the projected residual. *violated*: what conjugate "
        "gradients without the principal part, on P_L F P_L, leave of the balance of the parts, over its "
        f"size. Against the assembled scipy solution the displacements of the largest plate are {right:.0e} "
        "off.",
        "![iterations](partition.png)",
        "## Against the size of a part, 2 x 2 parts", table(by_size, ["r", *heads]),
        "## Against the number of parts, r = 4", table(by_parts, ["parts", *heads]),
        "## Stiffness that jumps, 4 x 4 parts, r = 4", table(jumps),
    ]  # fmt: skip
    written(given.output, "partition.md", "\n\n".join(page) + "\n")
    pictured(given.output, "partition", draw(by_size, by_parts, jumps))


if __name__ == "__main__":
    main()
