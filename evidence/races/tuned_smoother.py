"""A smoother tuned by likelihood on six channels, counted in filter passes of filterpy over one of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from evidence.races import models, peers
from evidence.races.paired import Goal, Race, RaceAnswer, Racer
from forceid import kalman
from forceid.flight.channels import driven, start_of
from forceid.flight.tuning import tune_loads

STEP, NOISE, CHANNELS = 1e-3, 1e-4, 6
OURS, PASS = "forceid, six channels tuned and smoothed", "filterpy, one filter pass over one channel, n = 3"


def races(quick: bool) -> Iterator[Race]:
    samples = 20_000 if quick else 100_000
    time, z, load = drawn_channels(samples)
    chain = kalman.integrate(kalman.integrate(kalman.matern(1, 1.0, 10.0), 1.0), 1.0)
    F, Q = kalman.discretize(chain, STEP)
    one = kalman.StateSpace(F, Q, chain.output[None], np.array([[NOISE**2]]), np.zeros(3), chain.P0)

    def error(answer: RaceAnswer) -> dict[str, float]:
        n = len(answer["load"])
        inner = slice(n // 20, n - n // 20)
        power = np.mean(load[:n][inner] ** 2, 0)
        relative = np.sqrt(np.mean((answer["load"] - load[:n])[inner] ** 2, 0) / power)
        return {"rms error of the load over its rms": float(np.median(relative))}

    def read(found) -> RaceAnswer:
        return {"load": np.stack([x @ row for x, row in found], axis=1)}

    def ours(size: int):
        return lambda: tune_and_smooth(time[:size], z[:size])

    def reference(size: int):
        return peers.filterpy(one, z[:size, :1], smooth=False)

    yield Race(
        title=f"Tuned smoother, six channels of {samples:,} samples",
        contestants=[
            Racer(OURS, ours, read, whole=True, judged=False, figures=error),
            Racer(PASS, reference, lambda found: {}, judged=False),
        ],
        base=PASS,
        size=samples,
        check=samples,  # tuning looks at as many samples of any record: no shorter one tells its time
        goals=[Goal(OURS, PASS, 1)],
        rounds=1 if quick else 5,
    )


def drawn_channels(samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, noisy z (time, channel) with z'' = load, and the loads: Matérn 3/2 of six sizes and rates."""
    loads, z = [], []
    for i in range(CHANNELS):
        load = kalman.matern(2, std=1.0 + 0.3 * i, rate=5.0 + 3.0 * i)
        chain = kalman.integrate(kalman.integrate(load, 1e-6), 1e-6)
        F, Q = kalman.discretize(chain, STEP)
        H = np.stack([chain.output, np.eye(4)[2]])
        model = kalman.StateSpace(F, Q, H, np.diag([NOISE**2, 0.0]), np.zeros(4), chain.P0)
        found = models.draw_measurements(model, samples, seed=i)[:, 0]
        z.append(found[:, 0])
        loads.append(found[:, 1])
    return STEP * np.arange(samples), np.stack(z, 1), np.stack(loads, 1)


def tune_and_smooth(time: np.ndarray, z: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """States of every channel (time, state) under what likelihood finds; the row that reads the load."""
    var, drift = np.full(z.shape, NOISE**2), np.zeros(z.shape[1])
    tuned = tune_loads(time, z, 1.0, var, drift, (0.1, 10.0))
    z = z - z[0]
    # remembered for a fraction of a second, a load needs no constant beside it over so long a record, and
    # without one the gains come to rest
    start = start_of(time, z, 1.0)
    load = tuned.kernel.process
    chain = kalman.integrate(kalman.integrate(load, start.first), start.second)
    model = driven(chain, 1.0, tuned.noise**2 * var[:1], drift, np.diff(time))
    row = np.zeros(chain.P0.shape[-1])
    row[2] = 1.0
    return [(kalman.smooth(model.one(i), z[:, i]).x, row) for i in range(z.shape[1])]
