"""Multipliers that balance every part and every node of the interface: the start vector and the projector.

Multipliers have to leave no resultant on a floating part, R_b^T lambda = R^T f, and to add up to nothing at
every interface degree of freedom, L_f^T lambda = 0. The projector P takes any others to such of the
homogeneous constraints; weights W of the multipliers average by multiplicity, or by stiffness.
Source: principal equations 2.10, 4i.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from forceid.partition.operators.topology import Topology
from forceid.records import Array

RESTING = 1e-20  # of the largest diagonal entry of the coarse matrix, of modes that rest at the interface
FLOATING = 1e-10  # of the largest eigenvalue of the coarse matrix, below which the assembly floats


@dataclass(frozen=True)
class Projection:
    """P = P_L - P_L W R_b (R_b^T P_L W R_b)^+ R_b^T P_L, with P_L = I - W L_f (L_f^T W L_f)^-1 L_f^T.

    R_b (multiplier, alpha): rigid modes of all parts at the interface, each in its own columns; weight
    (multiplier,): the diagonal of W.
    """

    topology: Topology
    R_b: Array
    weight: Array

    @cached_property
    def carried(self) -> Array:
        """L_f^T W L_f (frame,): the weight at each interface node."""
        return np.asarray(self.topology.L_f.T @ self.weight)

    def averaged(self, x: Array) -> Array:
        """P_L^T x: displacements (multiplier, ...) less their weighted mean at each interface node."""
        total = self.topology.L_f.T @ across(self.weight, x)
        return np.asarray(x - across(1 / self.carried, total)[self.topology.frame])

    def balanced(self, x: Array) -> Array:
        """P_L x: forces (multiplier, ...) less what they add up to at each interface node, in shares by W."""
        total = across(1 / self.carried, self.topology.L_f.T @ x)
        return np.asarray(x - across(self.weight, total[self.topology.frame]))

    @cached_property
    def modes(self) -> Any:
        """R_b, sparse."""
        return sp.csr_array(self.R_b)

    @cached_property
    def pushed(self) -> Any:
        """P_L W R_b, sparse (multiplier, alpha): what the rigid motions of the parts do to each other."""
        pushed = self.modes * self.weight[:, None]
        mean = (self.topology.L_f.T @ pushed) * (1 / self.carried)[:, None]
        return sp.csr_array(pushed - (self.topology.L_f @ mean) * self.weight[:, None])

    @property
    def coarse(self) -> Array:
        """The same, dense."""
        return np.asarray(self.pushed.toarray())

    @cached_property
    def spectrum(self) -> tuple[Array, Array]:
        """Eigenvalues and vectors of the coarse matrix R_b^T P_L W R_b: zero for motions of the whole."""
        if not self.R_b.shape[1]:
            return np.zeros(0), np.zeros((0, 0))
        matrix = (self.modes.T @ self.pushed).toarray()
        size = np.diag(matrix)
        # a mode that rests at the interface has a diagonal of rounding size, not to be scaled up to one
        scale = 1 / np.sqrt(np.where(size > RESTING * size.max(), size, 1.0))
        value, vector = np.linalg.eigh(0.5 * (matrix + matrix.T) * scale * scale[:, None])
        return value, scale[:, None] * vector

    @cached_property
    def free(self) -> int:
        """How many motions of the whole are free, counted with weights of one: stiffness decides nothing."""
        if (self.weight != 1).any():
            return Projection(self.topology, self.R_b, np.ones_like(self.weight)).free
        value = self.spectrum[0]
        return int((value < FLOATING * max(value.max(initial=0.0), 1e-300)).sum())

    @cached_property
    def whole(self) -> Array:
        """Motions of the parts (alpha, mode) that are one motion of the assembly: its rigid modes."""
        return self.spectrum[1][:, : self.free]

    def solve_coarse(self, b: Array) -> Array:
        """(R_b^T P_L W R_b)^+ b, in the metric of the matrix's own diagonal."""
        value, vector = self.spectrum[0][self.free :], self.spectrum[1][:, self.free :]
        return np.asarray(vector @ ((vector.T @ b) / value))

    def start(self, resultant: Array) -> Array:
        """lambda_alpha: the multipliers least in W^-1 that balance the resultants R^T f (alpha,)."""
        return np.asarray(self.pushed @ self.solve_coarse(resultant))

    def forces(self, x: Array) -> Array:
        """P x."""
        x = self.balanced(x)
        return np.asarray(x - self.pushed @ self.solve_coarse(self.modes.T @ x))

    def gaps(self, x: Array) -> Array:
        """P^T x: displacements less rigid motions of the parts and what all parts at a node share."""
        for _ in range(2):  # the second time takes off what rounding left, where the stiffness jumps
            x = self.averaged(x)
            x = x - self.averaged(self.modes @ self.solve_coarse(self.pushed.T @ x))
        return np.asarray(x)


def across(weight: Array, x: Array) -> Array:
    """Weights (row,) times x (row, ...)."""
    return np.asarray(weight * x if x.ndim == 1 else weight[:, None] * x)
