"""W2: 1000 signals of 1000 samples that share one model, n = 6, m = 2: filter and smoother."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from evidence.races import models, peers
from evidence.races.paired import Goal, Race, Racer
from forceid import kalman

SIGNAL_SAMPLES = 1000


def races(quick: bool) -> Iterator[Race]:
    signals = 100 if quick else 1000
    model = models.matern_bank([3, 3], 2, seed=6)
    z = models.draw_measurements(model, SIGNAL_SAMPLES, seed=1, signals=signals)
    for smooth in (False, True):
        work = "filter and smoother" if smooth else "filter"
        yield Race(
            title=f"W2 {signals} signals x {SIGNAL_SAMPLES}, n = 6, m = 2: {work}",
            contestants=list(contestants(model, z, smooth)),
            base="filterpy",
            size=signals,
            check=4,
            samples=SIGNAL_SAMPLES,
            goals=[Goal("forceid auto", "filterpy", 500), Goal("forceid auto", "dynamax", 2.5)],
        )


def contestants(model: kalman.StateSpace, z: np.ndarray, smooth: bool) -> Iterator[Racer]:
    def on(build, **settings):
        return lambda size: build(model, np.ascontiguousarray(z[:, :size]), smooth, **settings)

    def one_by_one(size: int):
        jobs = [peers.filterpy(model, z[:, j], smooth) for j in range(size)]
        return lambda: [job() for job in jobs]

    def read_list(found) -> peers.PeerAnswer:
        x, P = (np.stack([part[i] for part in found], axis=1) for i in (0, 1))
        return {"x": x, "P": P}

    def read_ours(found) -> peers.PeerAnswer:
        """Covariances that all signals share may come once."""
        x, P = peers.read_forceid(found).values()
        return {"x": x, "P": P if P.ndim == 4 else np.broadcast_to(P[:, None], (*x.shape, x.shape[-1]))}

    for engine in ("auto", "compiled", "numpy"):
        yield Racer(f"forceid {engine}", on(peers.our_engine, engine=engine), read_ours, whole=True)
    every = on(peers.our_engine, engine="auto", expanded=True)
    yield Racer("forceid auto, every P", every, read_ours, whole=True)
    yield Racer("filterpy", one_by_one, read_list)
    yield Racer("simdkalman", on(peers.simdkalman), peers.read_simdkalman_many, whole=True)
    yield Racer("dynamax", on(peers.dynamax), peers.read_pair_many, whole=True)
