"""What a sample tells where some directions are wholly unknown: least squares without any prior on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.kalman.recursions.square_root import eliminate
from forceid.records import Array, Flags
from forceid.rounding import SINGLE, SOLVED


@dataclass(frozen=True)
class Learned:
    """State x and amounts of unknowns after a sample; see `learn`."""

    x: Array
    W: Array
    error: Array
    amount: Array
    fit: Array
    free: Array
    loose: Array
    surprise: Array


def learn(x: Array, W: Array, reach: Array, C: Array, direct: Array, z: Array, noise: Array) -> Learned:
    """One sample z = C (state) + direct d + noise e of a state x + W e + reach d, no prior on d.

    Afterwards the state is off by W e + error e, the amounts of d by -fit e, with the e of `error` and `fit`
    the same; free, loose: directions of d that stay open; surprise: the white part of the sample that no d
    can imitate. Source: Gillijns and De Moor (2007), in square-root form.
    """
    L, K, W = eliminate(C @ W, W, noise)
    white = np.linalg.inv(L)
    size = np.linalg.norm(np.abs(white) @ (np.abs(C) @ np.abs(reach) + np.abs(direct)), axis=0)
    shown = white @ (C @ reach + direct)
    fit, rest, free, loose = least_squares(shown, size)
    e = white @ (z - C @ x)
    x = x + reach @ (fit @ e) + K @ (rest.T @ (rest @ e))
    return Learned(x, W, (K @ shown - reach) @ fit, fit @ e, fit, free, loose, rest @ e)


def least_squares(G: Array, size: Array) -> tuple[Array, Array, Array, Array]:
    """Least squares of columns G of white rows: the fit, the rest, what stays free, and that without noise.

    fit (unknown, row), minimum-norm inverse; rest (row - rank, row), orthonormal, with rest G = 0; free
    (unknown, unknown - rank): null space. size (unknown,): of the terms that a column was summed from; where
    they cancel to rounding, the column is zero.
    """
    length = np.linalg.norm(G, axis=0)
    zero = length <= SOLVED * size
    scale = np.where(zero, np.where(size > 0, size, 1.0), length)
    U, s, Vt = np.linalg.svd(np.where(zero, 0.0, G / scale))
    rank = int(np.count_nonzero(s > SOLVED))
    null = Vt[rank:].T
    fit = (Vt[:rank].T / s[:rank]) @ U[:, :rank].T / scale[:, None]
    loose = np.where(np.abs(null) > SINGLE, null, 0.0)
    return fit, U[:, rank:].T, null / scale[:, None], loose / scale[:, None]


def independent(E: Array) -> Array:
    """Columns that span those of E (state, direction), each row at its own scale."""
    row = np.abs(E).max(1, initial=0.0)
    row = np.where(row > 0, row, 1.0)[:, None]
    U, s, _ = np.linalg.svd(E / row, full_matrices=False)
    return np.asarray(row * U[:, s > SOLVED])


def mask_lost(mean: Array, cov: Array, lost: Flags) -> tuple[Array, Array]:
    """Mean and covariance, NaN for the entries that are lost."""
    return np.where(lost, np.nan, mean), np.where(lost | lost[:, None], np.nan, cov)


def diffuse_rows(reach: Array, loose: Array) -> Flags:
    """States (state,) that change with the unknowns (unknown, free) along the directions reach."""
    return np.asarray((np.abs(reach @ loose) > SINGLE * (np.abs(reach) @ np.abs(loose))).any(1))
