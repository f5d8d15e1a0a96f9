"""W5: the acceleration behind a million noisy positions, with its deviation where a method knows one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from evidence.races import peers
from evidence.races.paired import Answer, Contestant, Goal, Race
from forceid import kalman

STEP, NOISE = 1e-3, 1e-4  # s, m
DENSITY = 10**-0.5  # m2/s7, of the white jerk; like the window below it gives the least error on this signal
WINDOW, ORDER = 181, 5
EDGE = 500  # samples at either end that the rms error leaves out


def races(quick: bool, full: bool) -> Iterator[Race]:
    samples, check = (100_000, 2000) if quick else (1_000_000, 5000)
    z, truth = signal(samples)
    h = STEP
    F = np.array([[1.0, h, h**2 / 2], [0, 1, h], [0, 0, 1]])
    Q = DENSITY * np.array(
        [[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]]
    )
    R = np.array([[NOISE**2]])
    model = kalman.StateSpace(F, Q, np.eye(1, 3), R, np.zeros(3), np.diag([1.0, 1.0, 100.0]))

    def rmse(answer: Answer) -> dict[str, float]:
        n = len(answer["x"])
        inner = slice(EDGE, n - EDGE)
        error = (answer["x"] - truth[:n])[inner]
        found = {"rms error (m/s2)": float(np.sqrt(np.mean(error**2)))}
        if "std" in answer:
            found["claimed (m/s2)"] = float(np.median(answer["std"][inner]))
        return found

    def entry(
        name: str, prepare: Callable[[int], Any], read: Callable[[Any], Answer], judged: bool = True
    ) -> Contestant:
        return Contestant(name, prepare, read, "forceid" in name, judged, rmse)

    def peer(build: Callable[..., Any]) -> Callable[[int], Any]:
        return lambda size: build(model, z[:size], smooth=True)

    def alone(x: np.ndarray) -> Answer:
        return {"x": x}

    def pair(found: Any) -> Answer:
        return {"x": found[0], "std": found[1]}

    smoother = pynumdiff_model(model, z)
    yield Race(
        title=f"W5 second derivative of {samples:.0e} samples".replace("e+0", "e"),
        contestants=[
            entry("forceid", ours(model, z, False), acceleration(peers.read_forceid)),
            entry("forceid, every deviation", ours(model, z, True), pair),
            entry("filterpy", peer(peers.filterpy), acceleration(peers.read_pair)),
            entry("statsmodels", peer(peers.statsmodels), acceleration(peers.read_statsmodels)),
            entry("savgol, no deviation", savgol(z), alone, judged=False),
            entry("PyNumDiff, its smoother on our model", smoother, acceleration(peers.read_pair)),
            entry("PyNumDiff rtsdiff twice, no deviation", pynumdiff_twice(z), alone, judged=False),
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


def acceleration(read: Callable[[Any], Answer]) -> Callable[[Any], Answer]:
    """The third state and its deviation."""

    def of(found: Any) -> Answer:
        x, P = read(found).values()
        return {"x": x[:, 2], "std": np.sqrt(P[:, 2, 2])}

    return of


def ours(model: kalman.StateSpace, z: np.ndarray, every: bool) -> Callable[[int], Any]:
    def prepare(size: int):
        def job() -> Any:
            found = kalman.smooth(model, z[:size])
            return (found.x[:, 2], found.std[:, 2]) if every else found

        return job

    return prepare


def savgol(z: np.ndarray) -> Callable[[int], Any]:
    def prepare(size: int):
        from scipy.signal import savgol_filter

        return lambda: savgol_filter(z[:size, 0], WINDOW, ORDER, deriv=2, delta=STEP)

    return prepare


def pynumdiff_model(model: kalman.StateSpace, z: np.ndarray) -> Callable[[int], Any]:
    """Its public Kalman filter and smoother, given the same model."""

    def prepare(size: int):
        from pynumdiff.kalman_smooth import kalman_filter, rts_smooth

        def job() -> Any:
            found = kalman_filter(z[:size, 0], model.x0, model.P0, model.F, model.Q, model.H, model.R)
            return rts_smooth(model.F, *found)

        return job

    return prepare


def pynumdiff_twice(z: np.ndarray) -> Callable[[int], Any]:
    """What its documentation offers: the first derivative, twice, each under a constant second one."""
    ratio = float(np.log10(DENSITY / NOISE**2))

    def prepare(size: int):
        from pynumdiff import rtsdiff

        def job() -> np.ndarray:
            velocity = rtsdiff(z[:size, 0], STEP, 2, ratio)[1]
            return rtsdiff(velocity, STEP, 2, ratio)[1]

        return job

    return prepare
