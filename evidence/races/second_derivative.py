"""W5: the acceleration behind a million noisy positions, with its deviation where a method knows one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from evidence.races import peers
from evidence.races.paired import Goal, Race, RaceAnswer, Racer
from forceid import kalman

STEP, NOISE = 1e-3, 1e-4  # s, m
DENSITY = 10**-0.5  # m2/s7, of the white jerk; like the window below it gives the least error on this signal
WINDOW, ORDER = 181, 5
EDGE = 500  # samples at either end that the rms error leaves out


def races(quick: bool) -> Iterator[Race]:
    samples, check = (100_000, 2000) if quick else (1_000_000, 5000)
    z, truth = signal(samples)
    h = STEP
    F = np.array([[1.0, h, h**2 / 2], [0, 1, h], [0, 0, 1]])
    Q = DENSITY * np.array(
        [[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]]
    )
    R = np.array([[NOISE**2]])
    model = kalman.StateSpace(F, Q, np.eye(1, 3), R, np.zeros(3), np.diag([1.0, 1.0, 100.0]))

    def rmse(answer: RaceAnswer) -> dict[str, float]:
        n = len(answer["x"])
        inner = slice(EDGE, n - EDGE)
        error = (answer["x"] - truth[:n])[inner]
        found = {"rms error (m/s2)": float(np.sqrt(np.mean(error**2)))}
        if "std" in answer:
            found["claimed (m/s2)"] = float(np.median(answer["std"][inner]))
        return found

    def entry(name: str, job: Any, read: Callable[[Any], RaceAnswer], judged: bool = True) -> Racer:
        """A job on the first samples of z."""
        return Racer(name, lambda n: partial(job, z[:n]), read, "forceid" in name, judged, rmse)

    def peer(build: Callable[..., Any]) -> Callable[[Any], Any]:
        return lambda z: build(model, z, smooth=True)()

    third = read_acceleration(peers.read_pair)
    filterpy, statsmodels = peer(peers.filterpy), peer(peers.statsmodels)
    yield Race(
        title=f"W5 second derivative of {samples:.0e} samples".replace("e+0", "e"),
        contestants=[
            entry("forceid", partial(kalman.smooth, model), read_acceleration(peers.read_forceid)),
            entry("forceid, every deviation", partial(deviations, model), with_deviation),
            entry("filterpy", filterpy, third),
            entry("statsmodels", statsmodels, read_acceleration(peers.read_statsmodels)),
            entry("savgol, no deviation", race_savgol, without_deviation, judged=False),
            entry("PyNumDiff, its smoother on our model", partial(pynumdiff_smoother, model), third),
            entry("PyNumDiff rtsdiff twice, no deviation", rtsdiff_twice, without_deviation, judged=False),
        ],
        base="filterpy",
        size=samples,
        check=check,
        goals=[
            Goal("forceid", "filterpy", 1000),
            Goal("forceid", "savgol, no deviation", 1),
            Goal("forceid, every deviation", "savgol, no deviation", 1),
        ],
    )


def signal(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Noisy positions (time, 1) and their acceleration (time,), 1 m/s2 rms: twenty tones of 0.5 to 5 Hz."""
    rng = np.random.default_rng(5)
    t = STEP * np.arange(samples)
    w, phase = 2 * np.pi * rng.uniform(0.5, 5.0, 20), rng.uniform(0, 2 * np.pi, 20)
    x, a = np.zeros(samples), np.zeros(samples)
    for w_i, phase_i in zip(w, phase, strict=True):
        wave = np.sqrt(2 / 20) * np.cos(w_i * t + phase_i)
        a, x = a + wave, x - wave / w_i**2
    return (x + NOISE * rng.standard_normal(samples))[:, None], a


def read_acceleration(read: Callable[[Any], RaceAnswer]) -> Callable[[Any], RaceAnswer]:
    """The third state and its deviation."""

    def of(found: Any) -> RaceAnswer:
        x, P = read(found).values()
        return {"x": x[:, 2], "std": np.sqrt(P[:, 2, 2])}

    return of


def without_deviation(x: np.ndarray) -> RaceAnswer:
    return {"x": x}


def with_deviation(found: Any) -> RaceAnswer:
    return {"x": found[0], "std": found[1]}


def deviations(model: kalman.StateSpace, z: np.ndarray) -> Any:
    found = kalman.smooth(model, z)
    return found.x[:, 2], found.std[:, 2]


def race_savgol(z: np.ndarray) -> np.ndarray:
    return savgol_filter(z[:, 0], WINDOW, ORDER, deriv=2, delta=STEP)


def pynumdiff_smoother(model: kalman.StateSpace, z: np.ndarray) -> Any:
    """Its public Kalman filter and smoother, given the same model."""
    from pynumdiff.kalman_smooth import kalman_filter, rts_smooth

    start = model.x0, model.P0
    return rts_smooth(model.F, *kalman_filter(z[:, 0], *start, model.F, model.Q, model.H, model.R))


def rtsdiff_twice(z: np.ndarray) -> np.ndarray:
    """What its documentation offers: the first derivative, twice, each under a constant second one."""
    from pynumdiff import rtsdiff

    ratio = float(np.log10(DENSITY / NOISE**2))
    return rtsdiff(rtsdiff(z[:, 0], STEP, 2, ratio)[1], STEP, 2, ratio)[1]
