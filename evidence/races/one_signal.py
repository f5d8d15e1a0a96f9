"""W1: one signal of 1e5 samples, filter and smoother, at three sizes of state and measurement."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from evidence.races import models, peers
from evidence.races.paired import Goal, Race, Racer
from forceid import kalman

SIZES = {  # (state, channel): orders of the stacked processes, goals of filter and smoother
    (3, 1): ([3], 1000, 1000),
    (12, 6): ([2] * 6, 400, 400),
    (30, 30): ([2] * 15, 400, 250),
}
OURS = ("auto", "compiled", "numpy")


def races(quick: bool) -> Iterator[Race]:
    samples, check = (20_000, 300) if quick else (100_000, 2000)
    for (n, m), (orders, *least) in SIZES.items():
        model = models.matern_bank(orders, m, seed=n)
        z = models.draw_measurements(model, samples, seed=n + m)[:, 0]
        for smooth, goal in zip((False, True), least, strict=True):
            yield Race(
                title=f"W1, n={n}, m={m}: {'filter, smoother' if smooth else 'filter'}",
                contestants=list(contestants(model, z, smooth)),
                base="filterpy",
                size=samples,
                check=check,
                goals=[Goal("forceid auto", "filterpy", goal)],
            )


def contestants(model: kalman.StateSpace, z: np.ndarray, smooth: bool) -> Iterator[Racer]:
    def on(build, **settings):
        return lambda size: build(model, z[:size], smooth, **settings)

    for engine in OURS:
        ours = on(peers.our_engine, engine=engine)
        yield Racer(f"forceid {engine}", ours, peers.read_forceid, whole=True)
    every = on(peers.our_engine, engine="auto", expanded=True)
    yield Racer("forceid auto, every P", every, peers.read_forceid, whole=True)
    yield Racer("filterpy", on(peers.filterpy), peers.read_pair)
    yield Racer("statsmodels", on(peers.statsmodels), peers.read_statsmodels)
    yield Racer("pykalman", on(peers.pykalman), peers.read_pair)
    yield Racer("simdkalman", on(peers.simdkalman), peers.read_simdkalman)
    yield Racer("dynamax", on(peers.dynamax), peers.read_pair)
