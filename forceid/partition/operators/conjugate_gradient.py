"""Conjugate gradients on projected multipliers: P^T F P x = P^T (b - F lambda_alpha).

Source: principal equations 4i; the condition by Lanczos: G. H. Golub, C. F. Van Loan, Matrix Computations,
section 11.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigvalsh_tridiagonal

from forceid.errors import EstimationError
from forceid.partition.operators.blocks import Apply
from forceid.records import Array


@dataclass(frozen=True)
class Iterations:
    """x and how it was come by: residual (step + 1,) |P^T r|; condition: of the operator, by its steps."""

    x: Array
    residual: Array
    condition: float

    @property
    def count(self) -> int:
        """Steps taken."""
        return len(self.residual) - 1


def projected_cg(
    F: Apply,
    b: Array,
    forces: Apply,
    gaps: Apply,
    precondition: Apply,
    tolerance: float,
    most: int,
    least: float = 0.0,
) -> Iterations:
    """X in the range of P with P^T F x = P^T b, to |P^T r| <= tolerance |P^T b|, or to `least`.

    F: symmetric and definite there; forces: P, gaps: P^T, precondition: symmetric. Raises EstimationError
    where `most` steps do not do, or where F or the preconditioner is not definite.
    """
    r = gaps(b)
    x, residual = np.zeros_like(b), [float(np.linalg.norm(r))]
    p, last, steps, turns = np.zeros_like(b), 0.0, [], []
    while residual[-1] > max(tolerance * residual[0], least):
        if len(residual) > most:
            raise EstimationError(
                f"leave {residual[-1] / residual[0]:.1e} of the residual after {most} steps, expected "
                f"{tolerance:.0e}",
                "conjugate gradients",
                "take the Dirichlet preconditioner, weights by stiffness, or the direct solution",
            )
        z = forces(precondition(r))
        now = float(r @ z)
        if not now > 0:
            raise EstimationError(
                "meet gaps that the preconditioner pulls apart: rounding has taken its sign",
                "conjugate gradients",
                "solve directly, or take weights by multiplicity where stiffness jumps by many decades",
            )
        beta = now / last if last else 0.0
        p, last = z + beta * p, now
        Fp = gaps(F(p))
        bend = float(p @ Fp)
        if not bend > 0:
            raise EstimationError(
                "meet a direction without stiffness",
                "conjugate gradients",
                "look for a hidden mechanism, or solve directly where stiffness jumps by many decades",
            )
        step = now / bend
        x, r = x + step * p, r - step * Fp
        steps.append(step)
        turns.append(beta)
        residual.append(float(np.linalg.norm(r)))
    return Iterations(x, np.array(residual), condition(np.array(steps), np.array(turns)))


def condition(step: Array, turn: Array) -> float:
    """Condition number that steps alpha and turns beta of conjugate gradients show."""
    if not len(step):
        return 1.0
    diagonal = 1 / step + np.append(0.0, turn[1:] / step[:-1])
    value = eigvalsh_tridiagonal(diagonal, np.sqrt(turn[1:]) / step[:-1])
    return float(value[-1] / value[0])
