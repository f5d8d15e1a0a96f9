"""What a body must be: masses and matrices that a body can have, told once or twice alike."""

from __future__ import annotations

from collections import Counter

import numpy as np

from forceid.errors import DataError
from forceid.files.checks.agreement import check_agreement, check_frequencies
from forceid.files.checks.modes import check_modes
from forceid.files.checks.numbers import (
    NEARLY,
    check_definite,
    check_finite,
    check_mass,
    check_range,
    check_symmetric,
)
from forceid.files.schema import BODY
from forceid.records import Array, Body

ROUNDED_MOMENTS = 0.01  # of the largest: three moments of a flat body, each written in three digits


def check_body(body: Body, where: str) -> None:
    """Finite body data of possible size, positive mass, symmetric and definite matrices, told twice alike."""
    names = ("node", "marker", "joint", "rotor", "material")
    check_finite(body, names, where, "body data has no gaps: give every value")
    for name, variable in BODY.items():
        if (value := getattr(body, name)) is not None:
            check_range(np.asarray(value), variable.units, f"{where}/{name}")
    if repeated := [name for name, count in Counter(body.node).items() if count > 1]:
        raise DataError(
            f"names {repeated[0]!r} more than once", f"{where}/node", "give every node its own name"
        )
    if body.mass is not None:
        if (body.mass < 0).any():
            k = int(np.argmin(body.mass))
            node = repr(body.node[k]) if body.node else k
            raise DataError(
                f"is {body.mass[k]:g} kg at node {node}, expected zero or more",
                f"{where}/mass",
                "correct it; a marker that carries no mass has 0",
            )
        check_mass(float(body.mass.sum()), f"{where}/mass", "total mass")
    if body.mass_matrix is not None:
        check_symmetric(body.mass_matrix, f"{where}/mass_matrix")
        numbers = len(body.mass_matrix) // max(len(body.node), 1) or 3  # of a node: six with rotations
        total = float(body.mass_matrix[::numbers, ::numbers].sum())
        check_mass(total, f"{where}/mass_matrix", "total mass along x")
        check_definite(body.mass_matrix, "kinetic energy", f"{where}/mass_matrix")
    if body.stiffness is not None:
        check_symmetric(body.stiffness, f"{where}/stiffness")
    if body.total_mass is not None:
        check_mass(body.total_mass, f"{where}/total_mass", "total mass")
    if body.inertia is not None:
        check_symmetric(body.inertia, f"{where}/inertia")
        check_moments(body.inertia, f"{where}/inertia")
    check_mass_known(body, where)
    check_segments(body, where)
    check_modes(body, where)
    check_agreement(body, where)
    check_frequencies(body, where)


def check_moments(inertia: Array, where: str) -> None:
    """Principal moments of something with mass: none below zero, none above the sum of the others."""
    low, middle, high = np.linalg.eigvalsh(inertia)
    if low < -NEARLY * max(high, 0.0):
        raise DataError(
            f"has principal moment {low:.3g} kg m2, expected none below zero",
            where,
            "give the tensor, its products of inertia with the minus sign",
        )
    if high > low + middle + ROUNDED_MOMENTS * high:
        raise DataError(
            f"has principal moments {low:.3g}, {middle:.3g} and {high:.3g} kg m2, expected none above the "
            "sum of the other two: no mass has these",
            where,
            "give the tensor about the mass center, its products of inertia with the minus sign",
        )


def check_mass_known(body: Body, where: str) -> None:
    """The mass is given node by node, as a matrix, or as a rigid whole."""
    if body.mass is not None or body.mass_matrix is not None:
        return
    missing = [name for name in ("total_mass", "mass_center", "inertia") if getattr(body, name) is None]
    if len(missing) == 3:
        raise DataError(
            "holds no mass, expected `mass`, `mass_matrix`, or `total_mass` with `mass_center` and `inertia`",
            where,
            "add one of them",
        )
    if missing:
        raise DataError(
            f"lacks {' and '.join(missing)}, expected with the rest of the rigid body",
            where,
            f"add {missing[0]}, or give the mass of every node",
        )


def check_segments(body: Body, where: str) -> None:
    """Markers and joints of a body of segments come whole, on nodes that there are."""
    names = ("marker_weight", "marker_segment", "marker_shape", "joint_segment", "joint_shape")
    given = [name for name in names if getattr(body, name) is not None]
    if given and len(given) < len(names):
        lacking = next(name for name in names if name not in given)
        raise DataError(
            f"is missing, expected beside {given[0]}", f"{where}/{lacking}", "import the capture again"
        )
    for name in ("marker_segment", "joint_segment"):
        at = getattr(body, name)
        if at is not None and not np.isin(at, np.arange(-1 if at.ndim == 1 else 0, len(body.node))).all():
            raise DataError(
                f"names a node that is none of {len(body.node)}", f"{where}/{name}", "give indices of nodes"
            )
