"""Bodies in parts whose displacements and interface forces are known in closed form: manufactured solutions.

A smooth u_g is chosen, f_g = K_g u_g is its load, and with that in equal shares f_s the forces on the
interface are lambda_s = f_s - K_s u_s: no solver has a hand in the truth.
Source: principal equations 2.7, and 5.3 for the bodies.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from forceid.partition.grids import solid_parts
from forceid.principal.operator import summation_operator
from forceid.records import Array, Flags

YOUNG = 1000.0  # Pa


@dataclass(frozen=True)
class Grid:
    """A box of unit parts, r elements an edge, held where the first axis is zero.

    pattern: which parts are stiffer by the factor jump: "" none, every other of the "strips" along the first
    axis, or of a "checkerboard".
    """

    parts: tuple[int, ...]
    r: int
    pattern: str = ""
    jump: float = 1.0

    @property
    def title(self) -> str:
        """What it is, in words.

        >>> Grid((4, 4), 4, "strips", 1e4).title
        'Plate in 4 x 4 parts, 4 elements an edge, strips stiffer by 1e+04'
        """
        kind = "Plate" if len(self.parts) == 2 else "Solid"
        stiff = f", {self.pattern} stiffer by {self.jump:.0e}" if self.pattern else ""
        return f"{kind} in {' x '.join(map(str, self.parts))} parts, {self.r} elements an edge{stiff}"


GRIDS = {
    "plate_16": Grid((4, 4), 4),
    "plate_64": Grid((8, 8), 4),
    "strips": Grid((4, 4), 4, "strips", 1e4),
    "checkerboard": Grid((4, 4), 4, "checkerboard", 1e4),
    "solid_8": Grid((2, 2, 2), 6),
}


@dataclass(frozen=True)
class PartsCase:
    """A held body in parts, its load and the truth.

    stiffness, boolean, modes: K_s, L_s and R_s, one entry a part; load (size,) N assembled; u (size,) m;
    rigid (size, mode): rigid motions of the nodes that are free, which multigrid wants to know.
    """

    name: str
    title: str
    stiffness: tuple[Any, ...]
    boolean: tuple[Any, ...]
    modes: tuple[Array, ...]
    u: Array
    rigid: Array
    load: Array = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "load", self.L.T @ (self.K @ (self.L @ self.u)))

    @cached_property
    def K(self) -> Any:
        """Stiffness of all parts (dof, dof), one block each."""
        return sp.csr_array(sp.block_diag(self.stiffness))

    @cached_property
    def L(self) -> Any:
        """Assembly (dof, size)."""
        return sp.csr_array(sp.vstack(self.boolean))

    @cached_property
    def assembled(self) -> Any:
        """K_g = L^T K L (size, size)."""
        return sp.csr_array(self.L.T @ self.K @ self.L)

    @cached_property
    def count(self) -> Array:
        """Parts that hold each assembled degree of freedom (size,)."""
        return np.asarray(self.L.sum(axis=0), dtype=float).ravel()

    @cached_property
    def shared(self) -> Flags:
        """Which degrees of freedom of the parts (dof,) lie on the interface."""
        return np.asarray((self.count > 1)[self.L.indices])

    def residual(self, u: Array) -> Array:
        """f_s - K_s u_s (dof,) of assembled displacements (size,): the interface's forces, zero elsewhere."""
        return np.asarray(self.L @ (self.load / self.count) - self.K @ (self.L @ u))

    @cached_property
    def lam(self) -> Array:
        """The true lambda (multiplier,) N, part after part: forces of the parts on the interface."""
        return self.residual(self.u)[self.shared]

    @cached_property
    def key(self) -> str:
        """Hash of matrices and truth."""
        digest = hashlib.sha256(self.name.encode())
        for array in (self.K.data, self.K.indices, self.L.indices, self.u, self.rigid, *self.modes):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()[:16]


def manufactured(name: str, grid: Grid) -> PartsCase:
    """The body of a grid with a displacement that is zero where it is held.

    >>> case = manufactured("two", Grid((2, 1), 1))
    >>> len(case.load), len(case.lam)
    (8, 8)
    """
    places = np.array(list(np.ndindex(*grid.parts)))
    odd = {"strips": places[:, 0], "checkerboard": places.sum(1)}.get(grid.pattern, np.zeros(len(places)))
    body = solid_parts(grid.parts, grid.r, (YOUNG * np.where(odd % 2, grid.jump, 1.0)).tolist())
    fixed = np.isclose(body.place[:, 0], 0)
    system, free = body.system(fixed), body.place[~fixed]
    return PartsCase(
        name, grid.title, tuple(system.stiffness), tuple(system.boolean), tuple(system.rigid_modes or ()),
        displacement(free / np.array(grid.parts)).ravel(), summation_operator(free, free.mean(0)),
    )  # fmt: skip


def displacement(x: Array) -> Array:
    """Displacement (node, axis) m at x (node, axis), 0 to 1: stretch and bending that vanish at x_1 = 0.

    u_1 = sin(pi x_1 / 2) cos(pi x_2 + 0.3), u_a = (1 - cos(pi x_1 / 2)) cos(pi x_a / 2 + 0.2 (a - 1)).
    """
    first = np.sin(np.pi / 2 * x[:, 0]) * np.cos(np.pi * x[:, 1] + 0.3)
    rise = 1 - np.cos(np.pi / 2 * x[:, 0])
    rest = [rise * np.cos(np.pi / 2 * x[:, a] + 0.2 * a) for a in range(1, x.shape[1])]
    return np.stack([first, *rest], axis=1)
