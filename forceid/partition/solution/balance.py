"""What interface forces leave of the balances of parts and nodes, beside rounding and noise.

Source: principal equations 4h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from forceid.partition.solution.assembly import Assembly
from forceid.records import Array

BALANCE_ROUNDING = 1e-9  # of the forces in a balance, that may be left of it
NOISE_LIMIT = 5.0  # standard deviations above which a number left of a balance is no noise; of many, more


@dataclass(frozen=True)
class Balance:
    """What is left of the balances: zero for forces that account for the motion.

    parts (..., alpha): R^T (f - M u'' - B lambda), in units of the rigid modes; nodes (..., frame) N:
    L_f^T lambda; reasons: a sentence for each of the two that leaves more than rounding and covariances
    explain. Source: principal equations 4h.
    """

    parts: Array
    nodes: Array
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class NoiseSource:
    """A noise: covariance (n, n) or variances (n,), and what it does to lambda and to R^T (f - M u'')."""

    cov: Array
    to_lam: Array
    to_resultant: Array

    def carried(self, X: Array) -> Array:
        """X C X^T."""
        return np.asarray(X * self.cov @ X.T if self.cov.ndim == 1 else X @ self.cov @ X.T)

    def variance(self, X: Array) -> Array:
        """The diagonal of X C X^T."""
        return np.asarray(X**2 @ self.cov if self.cov.ndim == 1 else ((X @ self.cov) * X).sum(-1))


def balance(system: Assembly, lam: Array, b: Array, size: Array, noise: Sequence[NoiseSource]) -> Balance:
    """What lambda leaves of b = R^T (f - M u''), whose terms have this size, and at the nodes."""
    top, L_f = system.topology, system.topology.L_f
    parts, nodes = b - lam @ system.R_b, applied(L_f.T, lam)
    zero = np.zeros(())
    part_std = np.sqrt(sum((n.variance(n.to_resultant - system.R_b.T @ n.to_lam) for n in noise), zero))
    node_std = np.sqrt(sum((n.variance(L_f.T @ n.to_lam) for n in noise), zero))
    size = size + np.abs(lam) @ np.abs(system.R_b)
    largest = np.abs(lam).max(axis=-1, initial=0.0, keepdims=True)
    part_limit = (
        BALANCE_ROUNDING * size.max(axis=-1, initial=0.0, keepdims=True) + sure(parts.size) * part_std
    )
    node_limit = BALANCE_ROUNDING * largest + sure(nodes.size) * node_std
    owner = np.repeat(np.arange(len(top.glob)), [c.stop - c.start for c in system.columns])
    reasons = []
    for left, limit, name, place, step in (
        (parts, part_limit, "partition", owner, "look at its mass, loads and accelerations"),
        (
            nodes,
            node_limit,
            "assembled degree of freedom",
            top.interface,
            "forces there have to add up to zero",
        ),
    ):
        over = np.abs(left) > limit
        if over.any():
            excess = np.where(over, np.abs(left) / np.maximum(limit, 1e-300), 0.0).reshape(-1, len(place))
            at = np.unravel_index(int(excess.argmax()), excess.shape)
            reasons.append(
                f"the forces leave {np.abs(left).reshape(excess.shape)[at]:.3g} at {name} {place[at[1]]}, "
                f"{excess[at]:.3g} times what rounding and covariances explain; {step}"
            )
    return Balance(parts, nodes, tuple(reasons))


def sure(count: int) -> float:
    """Standard deviations that none of so many numbers passes, as surely as one does not pass SURE."""
    return float(np.sqrt(NOISE_LIMIT**2 + 2 * np.log(max(count, 1))))


def applied(A: Any, x: Array) -> Array:
    """A x of every sample of x (..., n), for a sparse A."""
    return np.asarray((A @ x.reshape(-1, x.shape[-1]).T).T).reshape(*x.shape[:-1], A.shape[0])
