"""Who factors many frames, or follows free bodies, on the chart: forceid, and numpy and scipy.

Points of one line: steps, or tolerances, from coarse to fine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from evidence.subject import Answer, Contestant, at_once
from evidence.subjects.affine.bodies import Throw
from evidence.subjects.affine.cases import BODIES, FOLLOWED, AffineCase
from evidence.subjects.affine.contestants import by_loop, by_svd
from evidence.subjects.affine.movers import by_reduced_form, material_of, run
from evidence.subjects.affine.reduced import left_reduced, two_sided
from forceid.pseudorigid import Body, polar
from forceid.records import Array

TOLERANCES = (1e-3, 1e-6, 1e-9)
STEPS: dict[str, dict[str, Sequence[float]]] = {  # s, by kind of case and method
    "body": {
        "verlet": (0.1, 0.02, 0.004), "suzuki_4": (0.2, 0.1, 0.02), "blanes_moan_6": (0.4, 0.2, 0.1),
        "kahan_li_8": (0.5, 0.25),
    },
    "bodies": {"verlet": (0.1, 0.02, 0.004), "blanes_moan_6": (0.4, 0.2, 0.1)},
    "stiff": {
        "verlet": (0.008, 0.002, 0.0005), "blanes_moan_6": (0.02, 0.01, 0.005),
    },
    "held": {"verlet": (0.05, 0.01, 0.002), "suzuki_4": (0.1, 0.05), "kahan_li_8": (0.4, 0.2)},
}  # fmt: skip


def ways(kind: str) -> list[Contestant]:
    """Ours first, then peers, for a kind of case."""
    if kind == "factors":
        return FACTORS
    own = [
        at_once(
            f"{method} {h:g}", partial(simulated, method, h), about=f"Body.simulate, {method}, {h:g} s",
            line=method,
        )
        for method, chosen in STEPS[kind].items()
        for h in chosen
    ]  # fmt: skip
    if kind == "bodies":
        return [*own, *tolerated(("RK45", "DOP853", "LSODA"), BODIES / FOLLOWED)]
    own.append(at_once("reference", partial(simulated, "dop853", None), about="Body.simulate, dop853"))
    if kind == "body":
        forms = {"left-reduced": left_reduced, "two-sided": two_sided}
        own += [at_once(n, partial(by_reduced_form, f), about=n.replace("-", "_")) for n, f in forms.items()]
    return [*own, *tolerated(("RK45", "DOP853", "LSODA", "Radau"))]


def tolerated(methods: Sequence[str], whole: float = 1.0) -> list[Contestant]:
    """Methods of solve_ivp at relative tolerances, absolute ones a thousandth."""
    return [
        at_once(
            f"scipy {m} {t:.0e}", partial(solved_ivp, m, t), kind="peer", about=f"solve_ivp {m}, {t:.0e}",
            line=f"scipy {m}", whole=whole,
        )
        for m in methods
        for t in TOLERANCES
        if not (m == "Radau" and t < 1e-6)
    ]  # fmt: skip


def simulated(method: str, step: float | None, case: AffineCase) -> Answer:
    """`Body.simulate`, body built and all; of many bodies the first."""
    throw: Any = case.given
    F0, V0 = case.starts or (throw.F0, throw.dF0)
    found = Body(throw.E, material_of(throw)).simulate(F0, V0, throw.time, method, step)
    known = slice(None, None if F0.ndim == 2 else FOLLOWED)
    return Answer((found.F[:, known], found.dF[:, known]))


def solved_ivp(method: str, tolerance: float, case: AffineCase) -> Answer:
    """solve_ivp on one body, or on the first of many, one after another."""
    throw: Any = case.given
    if case.starts is None:
        return Answer(followed_by(throw, throw.start, method, tolerance))
    starts = [np.concatenate([F.ravel(), V.ravel()]) for F, V in zip(*case.starts, strict=True)][:FOLLOWED]
    paths = [followed_by(throw, start, method, tolerance) for start in starts]
    return Answer((np.stack([F for F, _ in paths], 1), np.stack([V for _, V in paths], 1)))


def followed_by(throw: Throw, start: Array, method: str, tolerance: float) -> tuple[Array, Array]:
    """F and F' (time, 3, 3) by solve_ivp."""
    y, _ = run(throw.rates, start, throw.time, method, rtol=tolerance, atol=1e-3 * tolerance)
    return y[:, :9].reshape(-1, 3, 3), y[:, 9:].reshape(-1, 3, 3)


def factored(by: Callable[[Array], Array], case: AffineCase) -> Answer:
    """Rotation and stretch of all frames, of a function that gives rotations."""
    F = case.given.F  # type: ignore[union-attr]
    L = by(F)
    U = L.swapaxes(1, 2) @ F
    return Answer((L, 0.5 * (U + U.swapaxes(1, 2))))


def own_polar(case: AffineCase) -> Answer:
    """`polar`, which gives both."""
    return Answer(polar(case.given.F))  # type: ignore[union-attr]


def by_roots(F: Array) -> Array:
    """U from the eigenvalues of F^T F."""
    value, vector = np.linalg.eigh(F.swapaxes(1, 2) @ F)
    inverse = (vector / np.sqrt(np.maximum(value, 1e-300))[:, None]) @ vector.swapaxes(1, 2)
    return np.asarray(F @ inverse)


def by_newton(F: Array) -> Array:
    """Newton's iteration, scaled while it is far, on all at once."""
    X = F
    for _ in range(20):
        Y = np.linalg.inv(X).swapaxes(1, 2)
        g = np.sqrt(np.linalg.norm(Y, axis=(1, 2)) / np.linalg.norm(X, axis=(1, 2)))[:, None, None]
        g = np.where(np.abs(g - 1) < 0.01, 1.0, g)
        last, X = X, 0.5 * (g * X + Y / g)
        if np.abs(X - last).max() < 1e-14:
            break
    return np.asarray(X)


PEERS = {
    "scipy.linalg.polar": (by_loop, "a loop over frames"), "numpy svd": (by_svd, "all at once"),
    "numpy eigh of F^T F": (by_roots, "all at once"), "numpy Newton": (by_newton, "scaled, all at once"),
}  # fmt: skip
FACTORS = [
    at_once("polar", own_polar, about="polar, all at once"),
    *(at_once(name, partial(factored, by), kind="peer", about=about) for name, (by, about) in PEERS.items()),
]
