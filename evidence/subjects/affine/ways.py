"""Who factors many frames, or follows free bodies, on the chart: forceid, and numpy and scipy.

Points of one line: steps, or tolerances, from coarse to fine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import polar as scipy_polar

from evidence.subject import Answer, Contestant, Job
from evidence.subjects.affine.bodies import Frames, Throw
from evidence.subjects.affine.cases import FOLLOWED, AffineCase
from evidence.subjects.affine.movers import material_of
from forceid.pseudorigid import Body, left_reduced, polar, two_sided
from forceid.records import Array

TOLERANCES = (1e-3, 1e-6, 1e-9)


def ways(kind: str) -> list[Contestant]:
    """Ours first, then peers, for a kind of case."""
    if kind == "factors":
        return FACTORS
    if kind == "bodies":
        ours = stepped({"verlet": (0.1, 0.02, 0.004), "blanes_moan_6": (0.4, 0.2, 0.1)})
        peers = tolerated(("RK45", "DOP853", "LSODA"), one_by_one, 1000 / FOLLOWED)
        return [*ours, *peers]
    steps: dict[str, dict[str, Sequence[float]]] = {
        "body": {
            "verlet": (0.1, 0.02, 0.004), "suzuki_4": (0.2, 0.1, 0.02), "blanes_moan_6": (0.4, 0.2, 0.1),
            "kahan_li_8": (0.5, 0.25), "implicit_midpoint": (0.1, 0.02), "energy": (0.1, 0.05),
        },
        "stiff": {
            "verlet": (0.008, 0.002, 0.0005), "blanes_moan_6": (0.02, 0.01, 0.005),
            "implicit_midpoint": (0.02, 0.005), "energy": (0.02,),
        },
        "held": {"verlet": (0.05, 0.01, 0.002), "suzuki_4": (0.1, 0.05), "kahan_li_8": (0.4, 0.2)},
    }  # fmt: skip
    own = stepped(steps[kind])
    own.append(Contestant("reference", simulated("dop853", None), about="Body.simulate, dop853"))
    if kind == "body":
        own += [
            Contestant("left-reduced", partial(reduced, left_reduced), about="left_reduced"),
            Contestant("two-sided", partial(reduced, two_sided), about="two_sided"),
        ]
    return [*own, *tolerated(("RK45", "DOP853", "LSODA", "Radau"), alone)]


def stepped(steps: dict[str, Sequence[float]]) -> list[Contestant]:
    """Methods of `Body.simulate` at steps in s."""
    return [
        Contestant(
            f"{method} {h:g}", simulated(method, h), about=f"Body.simulate, {method}, {h:g} s", line=method
        )
        for method, chosen in steps.items()
        for h in chosen
    ]


def tolerated(methods: Sequence[str], how: Any, whole: float = 1.0) -> list[Contestant]:
    """Methods of solve_ivp at relative tolerances, absolute ones a thousandth."""
    return [
        Contestant(
            f"scipy {m} {t:.0e}",
            partial(how, m, t),
            "peer",
            f"solve_ivp {m}, {t:.0e}",
            f"scipy {m}",
            whole=whole,
        )
        for m in methods
        for t in TOLERANCES
        if not (m == "Radau" and t < 1e-6)
    ]


def simulated(method: str, step: float | None) -> Callable[[AffineCase], Job]:
    """`Body.simulate`, body built and all."""

    def job(case: AffineCase) -> Job:
        throw = case.given
        assert isinstance(throw, Throw)
        F0, V0 = case.starts or (throw.F0, throw.dF0)

        def run() -> Answer:
            found = Body(throw.E, material_of(throw)).simulate(F0, V0, throw.time, method, step)
            one = F0.ndim == 2
            return Answer((found.F, found.dF) if one else (found.F[:, :FOLLOWED], found.dF[:, :FOLLOWED]))

        return run

    return job


def reduced(form: Any, case: AffineCase) -> Job:
    """A reduced form."""
    throw = case.given
    assert isinstance(throw, Throw)

    def run() -> Answer:
        found = form.simulate(throw.E, material_of(throw), throw.F0, throw.dF0, throw.time)
        return Answer((found.F, found.dF))

    return run


def alone(method: str, tolerance: float, case: AffineCase) -> Job:
    """solve_ivp on one body."""
    throw = case.given
    assert isinstance(throw, Throw)
    return lambda: Answer(integrated(throw, throw.start, method, tolerance))


def one_by_one(method: str, tolerance: float, case: AffineCase) -> Job:
    """solve_ivp on the first bodies, one after another."""
    throw, starts = case.given, case.starts
    assert isinstance(throw, Throw)
    assert starts is not None

    def run() -> Answer:
        each = [np.concatenate([F.ravel(), V.ravel()]) for F, V in zip(*starts, strict=True)][:FOLLOWED]
        paths = [integrated(throw, start, method, tolerance) for start in each]
        return Answer((np.stack([F for F, _ in paths], 1), np.stack([V for _, V in paths], 1)))

    return run


def integrated(throw: Throw, start: Array, method: str, tolerance: float) -> tuple[Array, Array]:
    """F and F' (time, 3, 3) by solve_ivp."""
    ends = float(throw.time[0]), float(throw.time[-1])
    options: dict[str, Any] = {"method": method, "t_eval": throw.time, "rtol": tolerance}
    y = np.asarray(solve_ivp(throw.rates, ends, start, atol=1e-3 * tolerance, **options).y.T)
    return y[:, :9].reshape(-1, 3, 3), y[:, 9:].reshape(-1, 3, 3)


def factored(by: Callable[[Array], Array], case: AffineCase) -> Job:
    """Rotation and stretch of all frames, of a function that gives rotations."""
    given = case.given
    assert isinstance(given, Frames)

    def run() -> Answer:
        L = by(given.F)
        U = L.swapaxes(1, 2) @ given.F
        return Answer((L, 0.5 * (U + U.swapaxes(1, 2))))

    return run


def here(case: AffineCase) -> Job:
    """`polar`, which gives both."""
    given = case.given
    assert isinstance(given, Frames)
    return lambda: Answer(polar(given.F))


def by_loop(F: Array) -> Array:
    """scipy.linalg.polar frame by frame."""
    return np.array([scipy_polar(f)[0] for f in F])


def by_svd(F: Array) -> Array:
    """numpy.linalg.svd of all at once."""
    L, _, R = np.linalg.svd(F)
    return np.asarray(L @ R)


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


FACTORS = [
    Contestant("polar", here, about="polar, all at once"),
    *(
        Contestant(name, partial(factored, by), "peer", about)
        for name, by, about in (
            ("scipy.linalg.polar", by_loop, "a loop over frames"),
            ("numpy svd", by_svd, "all at once"),
            ("numpy eigh of F^T F", by_roots, "all at once"),
            ("numpy Newton", by_newton, "scaled, all at once"),
        )
    ),
]
