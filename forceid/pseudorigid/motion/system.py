"""The master system F'' E = -dW/dF as integrators see it, and its state with the digits that sums lose.

Source: pseudo-rigid bodies, sections 1 and 9.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forceid.pseudorigid.factors.cofactors import EYE, by_component, determinant, product
from forceid.pseudorigid.material.material_law import Material
from forceid.records import Array, Flags

BASIS = np.eye(9).reshape(9, 3, 3)
EventKinds = NDArray[np.str_]
EVENT_DTYPE = "<U9"


@dataclass(frozen=True)
class AffineSystem:
    """Material and second moment E (3, 3), symmetric positive definite; constrained: det F = 1 is imposed."""

    material: Material
    E: Array
    constrained: bool = False

    @cached_property
    def inverse(self) -> Array:
        """E^-1."""
        return np.asarray(np.linalg.inv(self.E))

    @cached_property
    def columns(self) -> Array | None:
        """1/e of E = diag(e), else nothing."""
        e = self.E.diagonal()
        return 1 / e if np.array_equal(self.E, np.diag(e)) else None

    def over_moment(self, P: Array) -> Array:
        """P E^-1 (..., 3, 3)."""
        return product(P, self.inverse) if self.columns is None else np.asarray(P * self.columns)

    def acceleration(self, F: Array) -> Array:
        """F'' = -dW/dF E^-1 (..., 3, 3), without the multiplier of a constraint."""
        return self.over_moment(-self.material.gradient(F))

    def vibration(self, F: Array) -> Array:
        """Largest frequency (...,) rad/s of small vibrations about F; 0 where none is stable."""
        value, vector = np.linalg.eigh(self.E)
        root = np.asarray((vector / np.sqrt(value)) @ vector.T)  # E^-1/2 on both sides: symmetric
        H = np.broadcast_to((BASIS @ root).reshape(9, *(1,) * (F.ndim - 2), 3, 3), (9, *F.shape))
        rows = self.material.hessian(np.broadcast_to(F, H.shape), H) @ root
        K = np.moveaxis(rows.reshape(9, *F.shape[:-2], 9), 0, -1)
        return np.asarray(np.sqrt(np.linalg.eigvalsh(K).max(-1).clip(0)))

    def rate(self, F: Array, V: Array) -> Array:
        """Rate (...,) 1/s of the motion itself: |V E^1/2| by |F E^1/2|."""
        root = np.linalg.cholesky(self.E)
        size = np.linalg.norm(F @ root, axis=(-2, -1))
        return np.asarray(np.linalg.norm(V @ root, axis=(-2, -1)) / size)


class Path(NamedTuple):
    """F and V (time, body, 3, 3), NaN after a stop; kind of stop (body,), "" for none, and its time (body,).

    center (time, body, 6): place and velocity of the mass center of driven bodies, (time, body, 0) of free
    ones.
    """

    F: Array
    V: Array
    kind: EventKinds
    stop: Array
    center: Array


def side_by_side(paths: list[Path]) -> Path:
    """Paths of blocks of bodies as one."""
    joined = [np.concatenate(part, 0 if part[0].ndim == 1 else 1) for part in zip(*paths, strict=True)]
    return Path(*joined)


@dataclass
class State:
    """F and V = F' of many bodies (body, 3, 3), component first, with what their sums have lost so far.

    push: acceleration at F where it is known. stopped: bodies parked at rest at F = I.
    """

    F: Array
    V: Array
    F_low: Array = field(init=False)
    V_low: Array = field(init=False)
    push: Array | None = None
    stopped: Flags = field(init=False)

    def __post_init__(self) -> None:
        self.F, self.V = by_component(self.F), by_component(self.V)
        self.F_low, self.V_low = np.zeros_like(self.F), np.zeros_like(self.V)
        self.stopped = np.zeros(len(self.F), bool)

    def drift(self, change: Array) -> None:
        """F += change, compensated (Kahan)."""
        self.F = compensated(self.F, self.F_low, change)

    def kick(self, change: Array) -> None:
        """V += change, compensated."""
        self.V = compensated(self.V, self.V_low, change)

    def guard(self) -> None:
        """Park bodies whose det F is not positive and finite: no material is asked about them."""
        J = determinant(self.F)
        inside = (J > 0) & np.isfinite(J)
        if not inside.all():
            self.park(~inside)

    def park(self, which: Flags) -> None:
        """Stop bodies (body,)."""
        self.stopped |= which
        self.F[which], self.V[which] = EYE, 0.0
        self.F_low[which] = self.V_low[which] = 0.0


def compensated(x: Array, low: Array, change: Array) -> Array:
    """The sum x + change, rounded, the rounding kept in `low`; `change` is used up."""
    change += low
    total = x + change
    np.subtract(x, total, out=low)
    low += change
    return np.asarray(total)
