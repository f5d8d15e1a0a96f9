"""W3: the six resultants of nodal accelerations, for 3, 100 and 10000 nodes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from evidence.races.paired import Goal, Race, Racer
from forceid.principal.operator import summation_operator
from forceid.principal.wrench import resultant

NUMBERS = 6_000_000  # of the accelerations: 48 MB, beyond the cache of a core


def races(quick: bool) -> Iterator[Race]:
    numbers = NUMBERS // 4 if quick else NUMBERS
    for nodes in (3, 100, 10_000):
        yield race(nodes, numbers // (3 * nodes), moving=False)
    yield race(100, numbers // 600, moving=True)


def race(nodes: int, frames: int, moving: bool) -> Race:
    """Nodes that stand still (the operator is one matrix), or whose current positions change as well."""
    rng = np.random.default_rng(nodes)
    mass = rng.uniform(0.5, 1.5, nodes)
    x = rng.standard_normal((frames, nodes, 3) if moving else (nodes, 3))
    a = rng.standard_normal((frames, nodes, 3))
    center = np.einsum("n,...na->...a", mass, x) / mass.sum()

    def part(of: np.ndarray, size: int) -> np.ndarray:
        return of[:size] if moving else of

    def ours(size: int):
        return lambda: resultant(mass, part(x, size), a[:size])

    def textbook(size: int):
        arm = part(x, size) - part(center, size)[..., None, :]

        def job() -> np.ndarray:
            f = mass[:, None] * a[:size]
            return np.concatenate([f.sum(1), np.cross(arm, f).sum(1)], axis=1)

        return job

    def folded(size: int):
        weights = np.repeat(mass, 3)[:, None] * summation_operator(x, center)
        return lambda: a[:size].reshape(size, -1) @ weights

    def read_through(size: int):
        if moving:
            return lambda: (np.add.reduce(a[:size], axis=None), np.add.reduce(x[:size], axis=None))
        return lambda: np.add.reduce(a[:size], axis=None)

    def answer(found) -> dict[str, np.ndarray]:
        return {"force": found[:, :3], "moment": found[:, 3:]}

    contestants = [
        Racer("forceid", ours, answer),
        Racer("textbook cross product", textbook, answer),
        Racer("reading the data once", read_through, lambda found: {}, judged=False),
    ]
    goals = [Goal("forceid", "reading the data once", 0.5), Goal("forceid", "textbook cross product", 25)]
    if not moving:
        contestants.insert(2, Racer("BLAS on folded weights", folded, answer))
    title = f"W3 six resultants, {nodes} {'moving nodes' if moving else 'nodes'}"
    goals = [] if moving else goals
    return Race(title, contestants, "textbook cross product", frames, frames, goals, unit="frame")
