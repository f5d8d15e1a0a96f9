"""The peers: each the pipeline that an expert would write on a public library, from the same raw markers.

All begin with `expert.paths_of`; none is told anything but the recording, save those that are told the truth:
of their cuts and routes they take the ones of least error, for force and for moment apart.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np

from evidence.subject import Answer, Contestant
from evidence.subjects.flights.cases import LOADS, Case
from evidence.subjects.flights.methods import halves
from evidence.subjects.flights.peers import differentiators as scipy_ways
from evidence.subjects.flights.peers import kalman as kalman_peers
from evidence.subjects.flights.peers.expert import Paths, paths_of
from forceid.errors import DataError
from forceid.records import Array

CUT = 15.0  # Hz: what an expert takes who knows nothing of the load
CUTS = tuple(np.geomspace(0.3, 150.0, 28))  # Hz, to choose from on the truth
FEW_CUTS = CUTS[::3]
LIBRARIES = {"filterpy": "filterpy", "statsmodels": "statsmodels", "PyNumDiff": "pynumdiff"}
TOLD = " (told)"

Second = Callable[..., Any]


def peers() -> tuple[list[Contestant], list[str]]:
    """Contestants whose library is installed, and the names of the libraries that are not."""
    found = [
        blind_peer("numpy gradient", scipy_ways.numpy_gradient, "numpy.gradient twice"),
        blind_peer("scipy savgol", scipy_ways.savgol, f"savgol_filter, order 4, {CUT:g} Hz", cut=CUT),
        informed_peer("scipy savgol", scipy_ways.savgol, "the same, window chosen on the truth", "cut", CUTS),
        blind_peer(
            "Butterworth", scipy_ways.butterworth, f"sosfiltfilt at {CUT:g} Hz, then gradient", cut=CUT
        ),
        informed_peer(
            "Butterworth", scipy_ways.butterworth, "the same, cut chosen on the truth", "cut", CUTS
        ),
        blind_peer(
            "scipy quintic spline", scipy_ways.quintic_spline, "UnivariateSpline, noise known", noise=1.0
        ),
        blind_peer("scipy GCV spline", scipy_ways.smoothing_spline, "make_smoothing_spline"),
    ]
    missing = [name for name, module in LIBRARIES.items() if find_spec(module) is None]
    if "filterpy" not in missing:
        rts = kalman_peers.filterpy_rts
        found += [
            blind_peer("filterpy RTS", rts, "rts_smoother, random-walk acceleration, q by likelihood"),
            informed_peer(
                "filterpy RTS", rts, "the same, q chosen on the truth", "rate", FEW_CUTS, slow=True
            ),
        ]
    if "statsmodels" not in missing:
        about = "MLEModel, random-walk acceleration, q and noise by likelihood"
        found.append(blind_peer("statsmodels", kalman_peers.statsmodels_fit, about))
    if "PyNumDiff" not in missing:
        found += pynumdiff_entrants()
    return found, missing


def pynumdiff_entrants() -> list[Contestant]:
    """Three methods of PyNumDiff at a cut, and the best of them told the truth."""

    def savgol(z: Array, step: float, cut: float) -> Array:
        window = 2 * int(np.clip(round(5 / (6.4 * cut * step) + 1.4), 3, len(z) // 4)) + 1
        settings = {"degree": 4, "window_size": window, "smoothing_win": max(window // 4, 1)}
        return kalman_peers.pynumdiff_twice(z, step, "savgoldiff", **settings)

    def butter(z: Array, step: float, cut: float) -> Array:
        part = min(2 * cut * step, 0.9)
        return kalman_peers.pynumdiff_twice(z, step, "butterdiff", filter_order=2, cutoff_freq=part)

    def rts(z: Array, step: float, cut: float) -> Array:
        # white jerk over the noise of one sample, where accelerations are followed up to `cut`
        ratio = float(np.log10((2 * np.pi * cut) ** 6 * step))
        return kalman_peers.pynumdiff_twice(z, step, "rtsdiff", order=2, log_qr_ratio=ratio)

    return [
        blind_peer("PyNumDiff savgol", savgol, f"savgoldiff twice, {CUT:g} Hz", cut=CUT),
        blind_peer("PyNumDiff Butterworth", butter, f"butterdiff twice, {CUT:g} Hz", cut=CUT),
        blind_peer("PyNumDiff RTS", rts, f"rtsdiff twice, order 2, {CUT:g} Hz", cut=CUT),
        informed_peer(
            "PyNumDiff RTS", rts, "the same, ratio chosen on the truth", "cut", FEW_CUTS, slow=True
        ),
    ]


def answer_from_markers(case: Case, second: Second, by_mass: bool | None, settings: dict[str, Any]) -> Answer:
    """From raw markers to the answer."""
    paths = paths_of(case.blind, by_mass)
    return answer_of(paths, second(paths.z, paths.step, **settings))


def answer_of(paths: Paths, found: Any) -> Answer:
    """Second derivatives, with or without their variances, as an answer."""
    wrench = paths.wrench(first(found))
    std = paths.spread(found[1]) if isinstance(found, tuple) else None
    if not paths.moment:
        wrench[:, 3:] = np.nan
    return Answer(halves(wrench), None if std is None else halves(std))


def blind_peer(name: str, second: Second, about: str, **settings: Any) -> Contestant:
    """A peer that is told nothing."""

    def prepare(case: Case) -> Callable[[], Answer]:
        return lambda: answer_from_markers(case, second, None, settings)

    return Contestant(name, prepare, "peer", about, key=f"{about} {settings}")


def informed_peer(
    name: str, second: Second, about: str, over: str, values: tuple[float, ...], slow: bool = False
) -> Contestant:
    """A peer that chooses its route and one number on the truth, for force and for moment apart.

    What it spends on choosing is not timed.
    """

    def prepare(case: Case) -> Callable[[], Answer]:
        choices = best_choices(case, second, over, values)

        def job() -> Answer:
            wrench = np.full_like(case.wrench, np.nan)
            paths = {route: paths_of(case.blind, route) for route in {route for route, _ in choices.values()}}
            for load, (route, value) in choices.items():
                part, way = LOADS[load], paths[route]
                found = np.zeros_like(way.z)
                found[:, part] = first(second(way.z[:, part], way.step, **{over: value}))
                wrench[:, part] = way.wrench(found)[:, part]
            said = ", ".join(f"{load} {value:.3g} Hz" for load, (_, value) in choices.items())
            return Answer(halves(wrench), chosen=said)

        return job

    key = f"{about} {over} {values}"
    return Contestant(name + TOLD, prepare, "peer", about, key=key, told=True, slow=slow)


def first(found: Any) -> Array:
    """Second derivatives, of a way that may give their variances with them."""
    return np.asarray(found[0] if isinstance(found, tuple) else found)


def best_choices(
    case: Case, second: Second, over: str, values: tuple[float, ...]
) -> dict[str, tuple[bool, float]]:
    """Route and number of least error for force and for moment."""
    best: dict[str, tuple[float, tuple[bool, float]]] = {}
    for by_mass in (False, True):
        try:
            paths = paths_of(case.blind, by_mass)
        except DataError:
            continue
        for value in values:
            wrench = np.hstack(answer_of(paths, second(paths.z, paths.step, **{over: value})).found)
            for load, part in LOADS.items():
                error = float(np.sqrt(np.mean((wrench - case.wrench)[case.judged, part] ** 2)))
                if np.isfinite(error) and (load not in best or error < best[load][0]):
                    best[load] = error, (by_mass, float(value))
    return {load: choice for load, (_, choice) in best.items()}
