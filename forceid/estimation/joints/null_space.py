"""Joint wrenches that leave no trace in the motion, in words: which components, and through which joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse.csgraph import connected_components

from forceid.records import Array
from forceid.significance import WHOLE

OPEN_SHARE = 0.02  # of a unit wrench: less is rounding, or noise of the poses


def undetermined_components(block: Array) -> tuple[str, ...]:
    """The components that lie in the span of block (6, k), force before moment; the rest of it is counted.

    >>> undetermined_components(np.eye(6)[:, :4])
    ('force x', 'force y', 'force z', 'moment x')
    >>> undetermined_components(np.array([[1.0, 0, 0, 0, 0, 0.2]]).T)
    ('1 combination of them',)
    """
    inside = (column_space(block) ** 2).sum(1) > WHOLE
    names = [f"{kind} {axis}" for kind in ("force", "moment") for axis in "xyz"]
    found = [name for name, held in zip(names, inside, strict=True) if held]
    if rest := column_space(block).shape[1] - len(found):
        found.append(f"{rest} combination{'s' * (rest > 1)} of them")
    return tuple(found)


def column_space(block: Array) -> Array:
    """Orthonormal columns that span those of block (6, k), as far as these have a share in it."""
    U, s, _ = np.linalg.svd(block, full_matrices=False)
    return np.asarray(U[:, s > OPEN_SHARE])


def listed(components: Sequence[str]) -> str:
    """Components in one phrase.

    >>> listed(("force x", "force y", "moment z", "1 combination of them"))
    'force x, y; moment z; 1 combination of them'
    """
    said: dict[str, list[str]] = {}
    for component in components:
        kind, _, axis = component.partition(" ")
        said.setdefault(kind, []).append(axis)
    return "; ".join(f"{kind} {', '.join(axes)}" for kind, axes in said.items())


def trading_joints(null_space: Array) -> list[tuple[int, ...]]:
    """Joints that trade wrenches with each other unseen, by number; null_space (joint, 6, k).

    >>> loop = np.eye(6) / np.sqrt(2)
    >>> trading_joints(np.stack([loop, np.zeros((6, 6)), -loop]))
    [(0, 2)]
    """
    size = np.einsum("iak,jbk->ijab", null_space, null_space)
    linked = np.abs(size).max((2, 3), initial=0.0) > OPEN_SHARE
    _, group = connected_components(linked, directed=False)
    found = [tuple(np.flatnonzero(group == k).tolist()) for k in np.unique(group)]
    return [joints for joints in found if linked[joints[0], joints[0]]]
