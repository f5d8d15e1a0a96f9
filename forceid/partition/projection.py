"""Multipliers that balance every part and every node of the interface: the start vector and the projector.

Multipliers have to leave no resultant on a floating part, R_b^T lambda = R^T f, and to add up to nothing at
every interface degree of freedom, L_f^T lambda = 0. The projector P takes any others to such of the
homogeneous constraints; weights W of the multipliers average by multiplicity, or by stiffness.
Source: principal equations 2.10, 4i.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from forceid.partition.topology import Topology
from forceid.records import Array

HIDDEN = 1e-20  # of the largest diagonal entry of the coarse matrix, of modes that rest at the interface
FREE = 1e-10  # of the largest eigenvalue of the coarse matrix, below which the assembly floats


@dataclass(frozen=True)
class Projection:
    """P = P_L - P_L W R_b (R_b^T P_L W R_b)^+ R_b^T P_L, with P_L = I - W L_f (L_f^T W L_f)^-1 L_f^T.

    R_b (multiplier, alpha): rigid modes of all parts at the interface, each in its own columns; weight
    (multiplier,): the diagonal of W.
    """

    topology: Topology
    R_b: Array
    weight: Array

    def averaged(self, x: Array) -> Array:
        """P_L^T x: displacements (multiplier, ...) less their weighted mean at each interface node."""
        frame, count = self.topology.frame, len(self.topology.interface)
        w = self.weight.reshape(-1, *[1] * (x.ndim - 1))
        total = np.zeros((count, *x.shape[1:]))
        np.add.at(total, frame, w * x)
        share = np.bincount(frame, self.weight, count).reshape(-1, *[1] * (x.ndim - 1))
        return np.asarray(x - (total / share)[frame])

    def balanced(self, x: Array) -> Array:
        """P_L x: forces (multiplier, ...) less what they add up to at each interface node, in shares by W."""
        frame, count = self.topology.frame, len(self.topology.interface)
        w = self.weight.reshape(-1, *[1] * (x.ndim - 1))
        total = np.zeros((count, *x.shape[1:]))
        np.add.at(total, frame, x)
        share = np.bincount(frame, self.weight, count).reshape(-1, *[1] * (x.ndim - 1))
        return np.asarray(x - w * (total / share)[frame])

    @cached_property
    def coarse(self) -> Array:
        """P_L W R_b (multiplier, alpha): what the rigid motions of the parts do to each other."""
        return self.balanced(self.weight[:, None] * self.R_b)

    @cached_property
    def spectrum(self) -> tuple[Array, Array]:
        """Eigenvalues and vectors of the coarse matrix R_b^T P_L W R_b: zero for motions of the whole."""
        if not self.R_b.shape[1]:
            return np.zeros(0), np.zeros((0, 0))
        matrix = self.R_b.T @ self.coarse
        size = np.diag(matrix)
        # a mode that rests at the interface has a diagonal of rounding size, not to be scaled up to one
        scale = 1 / np.sqrt(np.where(size > HIDDEN * size.max(), size, 1.0))
        value, vector = np.linalg.eigh(0.5 * (matrix + matrix.T) * scale * scale[:, None])
        return value, scale[:, None] * vector

    @cached_property
    def free(self) -> int:
        """How many motions of the whole are free, counted with weights of one: stiffness decides nothing."""
        if (self.weight != 1).any():
            return Projection(self.topology, self.R_b, np.ones_like(self.weight)).free
        value = self.spectrum[0]
        return int((value < FREE * max(value.max(initial=0.0), 1e-300)).sum())

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
        return np.asarray(self.coarse @ self.solve_coarse(resultant))

    def forces(self, x: Array) -> Array:
        """P x."""
        x = self.balanced(x)
        return np.asarray(x - self.coarse @ self.solve_coarse(self.R_b.T @ x))

    def gaps(self, x: Array) -> Array:
        """P^T x: displacements less rigid motions of the parts and what all parts at a node share."""
        for _ in range(2):  # the second time takes off what rounding left, where the stiffness jumps
            x = self.averaged(x)
            x = x - self.averaged(self.R_b @ self.solve_coarse(self.coarse.T @ x))
        return np.asarray(x)
