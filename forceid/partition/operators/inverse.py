"""Generalized inverses of the stiffness of a part: sparse factors with fixing degrees of freedom.

A floating part has rigid modes R, K R = 0. Held at as many well chosen degrees of freedom as it has modes, K
is definite, and its inverse, with zeros at those, is a symmetric reflexive K^-: it serves wherever K^+ does,
with another meaning of alpha only. Source: principal equations 2.9.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh, qr
from scipy.sparse.linalg import eigsh, splu

from forceid.errors import DataError
from forceid.partition.operators.blocks import Apply, Blocks, blocks, equal_parts
from forceid.partition.validation import real_matrix
from forceid.records import Array, Indices

LOADS_TOGETHER = 32  # loads that are solved for at a time: more do not stay in the cache
DENSE_PART = 1500  # degrees of freedom up to which modes are counted by a dense eigenvalue problem
MODES_SOUGHT = 24  # zero modes looked for in a larger part
ZERO = 1e-12  # of the largest entry of K, scaled to a unit diagonal, below which an eigenvalue is zero
STRAIN_LIMIT = 1e-8  # of the largest entry of K, that K R may be off for R of unit size
MODES_SAME, MODES_ALIKE = 1e-10, 2e-4  # least singular value of unit modes that are one, or too near
ASYMMETRIC = 1e-9  # of the largest entry of K


@dataclass(frozen=True)
class Factor:
    """K^- of one stiffness: free (dof,) which are not fixed; the factors of K there; size of K."""

    free: Indices
    lu: Any
    size: int

    def solve(self, load: Array) -> Array:
        """K^- f for loads (size,) or (size, load)."""
        x = np.zeros(load.shape)
        if not len(self.free):
            return x
        if load.ndim == 1:
            x[self.free] = self.lu.solve(load[self.free])
        else:
            for first in range(0, load.shape[1], LOADS_TOGETHER):
                some = slice(first, first + LOADS_TOGETHER)
                x[self.free, some] = self.lu.solve(np.asfortranarray(load[self.free, some]))
        return x

    def moved(self, rows: Indices, load: Array) -> Array:
        """Displacements (row, load) of some degrees of freedom under loads (row, load) on these."""
        f = np.zeros((self.size, load.shape[1]))
        f[rows] = load
        return self.solve(f)[rows]


def validated_symmetric(K: Any, part: int, name: str = "stiffness") -> Any:
    """The matrix as sparse rows; a DataError where it is not square, finite, symmetric, or a mass below 0."""
    where = f"{name} of partition {part}"
    K = real_matrix(K, where)
    K.sum_duplicates()
    if K.shape[0] != K.shape[1]:
        raise DataError(f"has shape {K.shape}, expected a square matrix", where, "give all of its rows")
    if not np.isfinite(K.data).all():
        what = f"holds numbers that are not finite, {np.sum(~np.isfinite(K.data))} of them, expected none"
        raise DataError(what, where, "look at the element that makes them")
    if name == "mass" and (light := K.diagonal()).min(initial=0.0) < 0:
        what = f"is {light.min():g} kg at degree of freedom {light.argmin()}, expected zero or more"
        raise DataError(what, where, "correct it")
    off, largest = abs(K - K.T), abs(K).max() if K.nnz else 0.0
    if off.nnz and off.max() > ASYMMETRIC * largest:
        raise DataError(
            f"is not symmetric: entries differ by {off.max() / largest:.1e} of the largest", where,
            "average it with its transpose if that is rounding, else look at the element that makes it",
        )  # fmt: skip
    return K


def all_symmetric(matrices: Sequence[Any], name: str = "stiffness") -> tuple[Any, ...]:
    """The matrices of all partitions as `validated_symmetric` gives them, equal ones looked at once."""
    found: list[Any] = []
    known: dict[str, Any] = {}
    for s, given in enumerate(matrices):
        K = real_matrix(given, f"{name} of partition {s}")
        digest = f"{K.shape} {digest_of(K)}"
        if digest not in known:
            known[digest] = validated_symmetric(K, s, name)
        found.append(known[digest])
    return tuple(found)


def zero_modes(K: Any) -> Array:
    """Orthonormal motions (dof, mode) that a symmetric semidefinite K leaves free, mechanisms among them."""
    diagonal = K.diagonal()
    if (diagonal <= 0).all():
        return np.eye(K.shape[0])
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, diagonal.max()))
    scaled = sp.csr_array(K * scale[:, None] * scale)
    if K.shape[0] <= DENSE_PART:
        value, vector = eigh(scaled.toarray())
    else:
        value, vector = eigsh(scaled, k=MODES_SOUGHT, sigma=-1e-4, which="LM")
    return np.asarray(np.linalg.qr(scale[:, None] * vector[:, value < ZERO])[0])


def rigid_modes(K: Any, R: Any, part: int) -> Array:
    """The modes given, if they are unstrained and independent; those that K has, where none are given."""
    if R is None:
        found = zero_modes(K)
        if found.size and np.abs(K @ found).max() > STRAIN_LIMIT * abs(K).max():
            raise DataError(
                "is not positive semidefinite: some motion gains energy, expected none",
                f"stiffness of partition {part}",
                "look for an element with a negative stiffness",
            )
        return found
    modes: Array = np.asarray(R.toarray() if hasattr(R, "toarray") else R, dtype=float)
    where = f"rigid modes of partition {part}"
    if not modes.size:
        return np.zeros((K.shape[0], 0))
    modes = modes[:, None] if modes.ndim == 1 else modes
    if modes.ndim != 2 or len(modes) != K.shape[0]:
        raise DataError(f"have shape {modes.shape}, expected ({K.shape[0]}, mode)", where)
    length = np.linalg.norm(modes, axis=0)
    if not np.isfinite(length).all() or not length.all():
        raise DataError("hold a mode that is zero or not finite", where)
    unit = modes / length
    strain = np.abs(K @ unit).max() / (abs(K).max() or 1.0)
    if strain > STRAIN_LIMIT:
        raise DataError(
            f"strain it: K R is {strain:.1e} of K, expected zero", where,
            "give them about the shape that K belongs to, or leave them out to have them found",
        )  # fmt: skip
    apart = np.linalg.svd(unit, compute_uv=False).min()
    if apart < MODES_SAME:
        raise DataError("depend on each other", where, "drop those that repeat")
    if apart < MODES_ALIKE:
        raise DataError(
            f"are alike but for {apart:.1e} of their size: a turn about a far point is nearly a translation",
            where, "give them about a point near the body",
        )  # fmt: skip
    return modes


def factor(K: Any, R: Array, part: int) -> Factor:
    """K^- held where R is conditioned best; DataError where K has more zero modes than R names."""
    n, modes = K.shape[0], R.shape[1]
    fixed = qr(R.T, mode="r", pivoting=True)[1][:modes] if modes else np.zeros(0, int)
    free = np.setdiff1d(np.arange(n), fixed)
    held = sp.csc_array(K[free][:, free])
    mechanism = DataError(
        f"has more zero modes than the {modes} given: a mechanism", f"stiffness of partition {part}",
        "stiffen it, or leave the rigid modes out to have all of them found and carried",
    )  # fmt: skip
    if not len(free):
        return Factor(free, None, n)
    try:
        lu = splu(held, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # exactly singular
        raise mechanism from None
    pivot = lu.U.diagonal() if n <= DENSE_PART else None
    if pivot is not None and (pivot <= 0).any():
        raise mechanism
    probe = np.random.default_rng(0).standard_normal(len(free))
    found = lu.solve(held @ probe)
    # a pivot of rounding size leaves a mode in the solution
    if not np.abs(found - probe).max() < 1e-3 * np.abs(probe).max():
        raise mechanism
    return Factor(free, lu, n)


def factor_parts(stiffness: Sequence[Any], modes: Sequence[Array]) -> tuple[tuple[Factor, ...], Indices]:
    """Factors of all parts, equal ones once, and which of them each part (part,) has."""
    keys = [f"{R.shape[1]} {digest_of(K)}" for K, R in zip(stiffness, modes, strict=True)]
    kinds: dict[str, int] = {}
    which = [kinds.setdefault(key, len(kinds)) for key in keys]
    each = (which.index(k) for k in range(len(kinds)))
    return tuple(factor(stiffness[s], modes[s], s) for s in each), np.array(which)


def digest_of(K: Any) -> str:
    """What tells one sparse matrix from another."""
    return hashlib.sha256(K.indptr.tobytes() + K.indices.tobytes() + K.data.tobytes()).hexdigest()


def solved(each: Sequence[Factor], which: Indices, dofs: Sequence[slice], f: Array) -> Array:
    """K^- f of loads (dof,) on all parts, those of equal parts at once."""
    x = np.empty(f.shape)
    for first, rows in equal_parts(which.tolist(), dofs):
        x[rows] = each[which[first]].solve(f[rows].T).T
    return x


def block_products(
    matrices: Sequence[Any], dofs: Sequence[slice], made: Callable[[Any], Any] = lambda K: K
) -> Blocks:
    """The product with what is made of the matrix of each part, equal ones at once."""

    def product(s: int, _: int) -> Apply:
        matrix = made(matrices[s])
        return lambda x: np.asarray(matrix @ x)

    return blocks([digest_of(K) for K in matrices], dofs, product)
