"""One record of a failure by every contestant: error, claim, bound and verdict."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from evidence.stress.cell import Trial
from evidence.subjects.flights.failures.failure import Case, Failure
from evidence.subjects.flights.oracle import bound
from forceid.config import Settings, load_settings
from forceid.errors import ForceIdError
from forceid.estimation.run import estimate_recording
from forceid.estimation.verdict.sensitivity import UNITS
from forceid.files.validate import check_recording
from forceid.records import Array, Estimate, Recording

METHODS = ("difference", "savgol", "spline", "filter", "smoother")
MODELS = ("rigid", "affine", "modal")

Estimator = Callable[[Recording, Settings], Estimate]


@dataclass(frozen=True)
class Contestant:
    """A method with a model. coarse: whether it may honestly be worse than twice the bound of a smoother."""

    method: str
    model: str = "auto"

    @property
    def name(self) -> str:
        """As it is called in a map."""
        return self.method if self.model == "auto" else f"{self.method}, {self.model}"

    @property
    def coarse(self) -> bool:
        """All but the smoother may."""
        return self.method != "smoother"


def contestants(failure: Failure, short: bool = False) -> tuple[Contestant, ...]:
    """Who meets a failure: every method, and every model where it is about the body; or the default only."""
    if short:
        return (Contestant("smoother"),)
    models = MODELS if failure.deforms else ()
    return (*map(Contestant, METHODS), *(Contestant("smoother", model) for model in models))


def attempt(
    failure: Failure, level: float, seed: int, who: tuple[Contestant, ...], estimator: Estimator | None = None
) -> dict[str, Any]:
    """The trials of one record, as plain numbers under the names of the contestants.

    estimator: in place of `estimate_recording`.
    """
    case = failure.make(level, np.random.default_rng([seed, 2026]))
    limit = bound_of(case)
    found = {}
    for one in who:
        began = process_time()
        trial = tried(case, limit, one, estimator or estimate_recording)
        found[one.name] = {**vars(trial), "seconds": process_time() - began}
    return {"failure": failure.name, "level": level, "seed": seed, "trials": found}


def tried(case: Case, limit: tuple[float, float], who: Contestant, estimator: Estimator) -> Trial:
    """What one contestant makes of a case."""
    nothing = (float("nan"), float("nan"))
    settings = load_settings(method=who.method, model=who.model, **case.settings)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            check_recording(case.recording)
            estimate = estimator(case.recording, settings)
    except ForceIdError as refusal:
        return Trial("refused", nothing, nothing, limit, str(refusal))
    except Exception as crash:  # an error that is none of ours is a finding, and the map goes on
        return Trial("crashed", nothing, nothing, limit, f"{type(crash).__name__}: {crash}")
    reason = next(iter(estimate.verdict.reasons), "")
    if estimate.verdict.level == "refused":
        return Trial("refused", nothing, nothing, limit, reason)
    error, claimed = scores(case, estimate)
    return Trial(estimate.verdict.level, error, claimed, limit, reason, told(case, estimate))


def told(case: Case, estimate: Estimate) -> tuple[float, float]:
    """What the budget of an estimate says of the input that a case misstates, force and moment, per axis."""
    if case.misstated is None:
        return 0.0, 0.0
    name, amount = case.misstated
    unit, _ = UNITS[name]
    force, moment = (estimate.sensitivity.get(f"{name}_{load}_{unit}", 0.0) for load in ("force", "moment"))
    return amount * force / np.sqrt(3), amount * moment / np.sqrt(3)


def scores(case: Case, estimate: Estimate) -> tuple[tuple[float, float], tuple[float, float]]:
    """Rms error and claimed deviation of force, or of the loads asked for, and of moment."""
    truth, force, force_std = case.recording.truth, estimate.force, estimate.force_std
    wanted = truth["force"]
    if case.mixed is not None and estimate.loads is not None:
        force, wanted = estimate.loads.load[:, :3], truth["load"]
        force_std = np.sqrt(np.diagonal(estimate.loads.load_cov, axis1=1, axis2=2))[:, :3]
    errors = rms(force - wanted), rms(estimate.moment - truth["moment"])
    return errors, (rms(force_std), rms(estimate.moment_std))


def bound_of(case: Case) -> tuple[float, float]:
    """Rms bound of force, or of the loads asked for, and of moment."""
    cov = bound(case.flight, case.seen, case.noise, case.place, case.mixed)
    force = cov[:, :3, :3]
    if case.mixed is not None:
        split = np.linalg.pinv(case.mixed)
        force = split @ force @ split.T
    return tuple(  # type: ignore[return-value]
        rms(np.sqrt(np.diagonal(part, axis1=1, axis2=2))) for part in (force, cov[:, 3:, 3:])
    )


def rms(values: Array) -> float:
    """Root mean square per axis over the central three quarters of a record (time, axis), gaps left out."""
    n = len(values)
    square = values[n // 8 : n - n // 8] ** 2
    known = np.isfinite(square)
    return float(np.sqrt(square[known].mean())) if known.any() else float("nan")
