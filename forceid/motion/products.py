"""Inertia and angular momentum of a deforming shape as functions of its amplitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.principal import summation_operator
from forceid.records import Array


@dataclass(frozen=True)
class Products:
    """Inertia and angular momentum of a shape X + q Phi about its mass center, bilinear in (1, q) and q'.

    inertia (mode + 1, mode + 1, 3, 3) kg m2, symmetric; momentum (mode + 1, mode, 3) kg m2.
    """

    inertia: Array
    momentum: Array

    def of(self, q: Array, rate: Array) -> tuple[Array, Array]:
        """J (time, 3, 3) and h (time, 3), body axes, at amplitudes and rates (time, mode)."""
        a = with_one(q)
        J = np.einsum("tk,tl,klij->tij", a, a, self.inertia, optimize=True)
        return J, np.einsum("tk,tl,kli->ti", a, rate, self.momentum, optimize=True)

    def slopes(self, q: Array, rate: Array) -> tuple[Array, Array, Array]:
        """dJ/dq (time, mode, 3, 3), dh/dq and dh/dq' (time, mode, 3)."""
        a = with_one(q)
        dJ = 2 * np.einsum("tl,klij->tkij", a, self.inertia[1:])
        return (
            dJ, np.einsum("tl,kli->tki", rate, self.momentum[1:]), np.einsum("tk,kli->tli", a, self.momentum)
        )  # fmt: skip


def with_one(q: Array) -> Array:
    """Amplitudes (time, mode) behind a one, that of the mean shape."""
    return np.concatenate([np.ones((len(q), 1)), q], 1)


def inertia_products(mass: Array, shape: Array, shapes: Array) -> Products:
    """Products of a mean shape (node, 3) and shapes (mode, node, 3); mass (node,) or (dof, dof).

    >>> ends = np.array([[-1.0, 0, 0], [1, 0, 0]])
    >>> bar = inertia_products(np.ones(2), ends, ends[None])
    >>> bar.of(np.array([[0.5]]), np.zeros((1, 1)))[0][0].diagonal().tolist()
    [0.0, 4.5, 4.5]
    """

    def weighed(x: Array) -> Array:
        return np.asarray(np.repeat(mass, 3) * x if mass.ndim == 1 else x @ mass)

    every = np.concatenate([shape[None], shapes]).reshape(len(shapes) + 1, shape.size)
    uniform = np.tile(np.eye(3), len(shape))
    center = weighed(every) @ uniform.T / np.trace(weighed(uniform) @ uniform.T) * 3
    every = every - center @ uniform
    S = summation_operator(every.reshape(-1, *shape.shape), np.zeros(3))[..., 3:].swapaxes(1, 2)
    J = np.einsum("kai,lbi->klab", S, weighed(S))
    h = np.einsum("kai,li->kla", S, weighed(every[1:]))
    return Products(0.5 * (J + J.swapaxes(0, 1)), h)
