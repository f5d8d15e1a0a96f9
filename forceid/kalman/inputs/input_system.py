"""A linear system with an input: its seven matrices, and what a white prior on the input adds to it.

x_{k+1} = A x_k + B u_k + w_k, z_k = C x_k + D u_k + v_k, cov w = Q, cov v = R, E[w v^T] = S.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import ConfigError
from forceid.kalman.covariance import square_root
from forceid.records import Array, Flags

SystemMatrices = tuple[Array, Array, Array, Array, Array, Array, Array]  # A, B, C, D, Q, R, S


def validated_system(
    A: Array, B: Array, C: Array, D: Array, Q: Array, R: Array, S: Array, z: Array
) -> SystemMatrices:
    """The matrices as arrays of numbers, if their shapes fit each other and the channels of z."""
    states, channels, inputs = len(A), z.shape[1], np.shape(B)[-1]
    shapes = {
        "A": (states, states), "B": (states, inputs), "C": (channels, states), "D": (channels, inputs),
        "Q": (states, states), "R": (channels, channels), "S": (states, channels),
    }  # fmt: skip
    for (name, shape), matrix in zip(shapes.items(), (A, B, C, D, Q, R, S), strict=True):
        if np.shape(matrix) != shape:
            raise ConfigError(
                f"has shape {np.shape(matrix)}, expected {shape}",
                f"{name} of the model",
                f"A says {states} states, z {channels} channels, B {inputs} inputs",
            )
    A, B, C, D, Q, R, S = (np.asarray(a, float) for a in (A, B, C, D, Q, R, S))
    return A, B, C, D, Q, R, S


def uncorrelated(system: SystemMatrices, seen: Flags) -> tuple[Array, Array, Array, Array]:
    """A, B, gain of the sample and factor of Q of a step whose noise has nothing in common with its sample.

    x_{k+1} = A x + B u + w + G (z - C x - D u - v), G = S R^-1: w - G v is independent of v.
    """
    A, B, C, D, Q, R, S = system
    G = np.linalg.solve(R[np.ix_(seen, seen)], S[:, seen].T).T
    return A - G @ C[seen], B - G @ D[seen], np.asarray(G, float), square_root(Q - G @ S[:, seen].T)


def with_prior(system: SystemMatrices, z: Array, var: ArrayLike) -> tuple[SystemMatrices, Array]:
    """The system with one more channel for each input, which measures it as zero, with variance `var`."""
    A, B, C, D, Q, R, S = system
    n, inputs = B.shape
    C, D = np.vstack([C, np.zeros((inputs, n))]), np.vstack([D, np.eye(inputs)])
    S, z = np.hstack([S, np.zeros((n, inputs))]), np.hstack([z, np.zeros((len(z), inputs))])
    R = np.pad(R, [(0, inputs)] * 2)
    R[-inputs:, -inputs:] = np.diag(np.broadcast_to(np.asarray(var, float), inputs))
    return (A, B, C, D, Q, R, S), z
