"""What a file tells twice: masses and frequencies from one description beside those from another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.errors import DataError
from forceid.principal import mass_properties
from forceid.records import Array, Body

ALIKE = 0.01  # of a number told twice: two that are written in three digits differ by that at most
OTHER_MODE = 2.0  # of a frequency told twice: nearer ones are those of a coarser model, this is another mode


@dataclass(frozen=True)
class Told:
    """Mass kg, center (3,) m and inertia (3, 3) kg m2 about it, as one variable tells them, or None."""

    by: str
    mass: float | None
    center: Array | None
    inertia: Array | None


def check_agreement(body: Body, where: str) -> None:
    """Masses, centers and inertias that are told by more than one variable are the same."""
    nodal = [
        told_by(body, name, where) for name in ("mass", "mass_matrix") if getattr(body, name) is not None
    ]
    whole = [
        Told(
            name, *(getattr(body, n) if n == name else None for n in ("total_mass", "mass_center", "inertia"))
        )
        for name in ("total_mass", "mass_center", "inertia")
        if getattr(body, name) is not None
    ]
    if not nodal:
        return
    first = nodal[0]
    assert first.mass is not None
    assert first.center is not None
    assert first.inertia is not None
    spread = max(float(np.trace(first.inertia)), 0.0)  # of mass on a point below zero, by rounding
    size = np.sqrt(spread / first.mass)
    if body.position is not None:
        size = max(size, float(np.ptp(body.position, axis=0).max(initial=0.0)))
    for other in [*nodal[1:], *whole]:
        here, named = f"{where}/{other.by}", f"/body/{first.by}"
        step = f"give one of {first.by} and {other.by}, or the same in both"
        if other.mass is not None and abs(other.mass - first.mass) > ALIKE * max(other.mass, first.mass):
            what = (
                f"tells {other.mass:.4g} kg where {named} adds up to {first.mass:.4g} kg, expected the same"
            )
            raise DataError(what, here, step)
        if other.center is not None and (off := np.linalg.norm(other.center - first.center)) > ALIKE * size:
            what = f"tells a mass center {off:.3g} m from that of {named}, expected the same"
            raise DataError(what, here, step)
        if other.inertia is not None:
            largest = max(np.abs(other.inertia).max(), np.abs(first.inertia).max())
            off = np.abs(other.inertia - first.inertia).max()
            if off > ALIKE * largest:
                what = f"tells an inertia {off:.3g} kg m2 from that of {named}, expected the same"
                raise DataError(what, here, step)


def told_by(body: Body, name: str, where: str) -> Told:
    """What masses of nodes, or their matrix, tell. DataError: other masses along other axes."""
    if body.position is None:
        raise DataError(
            "is missing, expected the reference shape of the nodes",
            f"{where}/position",
            "add the position of every node, for example from a frame that shows all",
        )
    try:
        p = mass_properties(getattr(body, name), body.position)
    except DataError as e:
        raise DataError(e.what, f"{where}/{name}", e.next_step) from e
    return Told(name, p.mass, p.center, p.inertia)


def check_frequencies(body: Body, where: str) -> None:
    """Frequencies beside a stiffness are those that mode shapes have by it, up to another mode."""
    shape, stated, K = body.mode_shape, body.mode_frequency, body.stiffness
    M = body.mass_matrix if body.mass is None else np.repeat(body.mass, 3)
    if shape is None or stated is None or K is None or M is None or len(K) != len(M):
        return
    flat = shape.reshape(len(shape), -1)
    if flat.shape[1] != len(K):  # nodes that have rotations too: shapes tell their places alone
        return
    pushed = flat * M if M.ndim == 1 else flat @ M
    stiff, heavy = (np.einsum("ki,ki->k", flat, a) for a in (flat @ K, pushed))
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.sqrt(np.maximum(stiff, 0.0) / heavy) / (2 * np.pi)
    off = ~((found <= OTHER_MODE * stated) & (stated <= OTHER_MODE * found)) & (heavy > 0)
    if off.any():
        k = int(np.argmax(off))
        raise DataError(
            f"is {stated[k]:.4g} Hz for mode {k}, which swings at {found[k]:.4g} Hz by /body/stiffness and "
            "the masses, expected about the same",
            f"{where}/mode_frequency",
            "give Hz, not rad/s, and shapes in the order of the frequencies, or leave one of them out",
        )
