"""Which of the bipolar factors of a frame are nearest to those of another.

Factors are known up to (L, D, R) -> (L Q^T, Q D Q^T, Q R): Q one of the 24 proper signed permutations, times
any rotation within a cluster of equal singular values. Against L', R' the Q with the largest tr(Q^T G),
G = L'^T L + R' R^T, is taken (Procrustes). Source: pseudo-rigid bodies 2.
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from forceid.records import Array, Flags, Indices


def _signed_permutations() -> Array:
    """The 24 of them that are rotations; the identity is the first."""
    every = [
        np.eye(3)[list(order)] * sign
        for order in permutations(range(3))
        for sign in product((1, -1), repeat=3)
    ]
    return np.array([Q for Q in every if np.linalg.det(Q) > 0])


SIGNED = _signed_permutations()
TABLE: Indices = np.argmax(np.einsum("aik,bkj,cij->abc", SIGNED, SIGNED, SIGNED), axis=2)  # number of a b


def nearest_signed(G: Array) -> Indices:
    """Numbers (n,) in SIGNED of the signed permutations with the largest tr(Q^T G), G (n, 3, 3)."""
    return np.asarray(np.argmax(G.reshape(-1, 9) @ SIGNED.reshape(-1, 9).T, axis=1))


def nearest_rotation(G: Array, near: Flags) -> Array:
    """The Q (n, 3, 3) with the largest tr(Q^T G): signed permutations, but any rotation within a cluster.

    G (n, 3, 3); near (n, 2): whether columns 0 and 1, and 1 and 2, are of one cluster. det Q = 1.
    """
    Q = np.empty(G.shape)
    alone, both = ~near.any(1), near.all(1)
    Q[alone] = SIGNED[nearest_signed(G[alone])]
    U, _, Vt = np.linalg.svd(G[both])
    U[..., 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    Q[both] = U @ Vt
    for single, pair in ((2, near[:, 0] & ~both), (0, near[:, 1] & ~both)):
        if pair.any():
            Q[pair] = _nearest_pair(G[pair], single)
    return Q


def _nearest_pair(G: Array, single: int) -> Array:
    """`nearest_rotation` for a cluster of the two columns other than `single`."""
    i, j = (k for k in range(3) if k != single)
    best, Q = np.full(len(G), -np.inf), np.zeros(G.shape)
    for row, sign in product(range(3), (1.0, -1.0)):
        a, b = (k for k in range(3) if k != row)
        mirror = sign * (-1.0) ** (row + single)  # determinant of the block of the pair
        c, s = G[:, a, i] + mirror * G[:, b, j], G[:, b, i] - mirror * G[:, a, j]
        size = np.hypot(c, s)
        score = sign * G[:, row, single] + size
        c, s = np.where(size > 0, c, 1.0), np.where(size > 0, s, 0.0)
        size = np.where(size > 0, size, 1.0)
        found = np.zeros(G.shape)
        found[:, row, single] = sign
        found[:, a, i], found[:, b, i] = c / size, s / size
        found[:, a, j], found[:, b, j] = -mirror * s / size, mirror * c / size
        Q[score > best] = found[score > best]
        best = np.maximum(score, best)
    return Q


def multiplied_up(number: Indices, first: Flags) -> Indices:
    """Running products, from each `first` on, of signed permutations by numbers (n,)."""
    table, product, out = TABLE.tolist(), 0, []
    for own, begins in zip(number.tolist(), first.tolist(), strict=True):
        product = own if begins else table[product][own]
        out.append(product)
    return np.array(out, np.intp)
