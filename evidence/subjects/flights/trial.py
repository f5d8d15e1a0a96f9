"""Who meets a failure of a flight: every method, with the errors of its answer, and the bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from evidence.judged import LOADS, band_of, judged_part, samples_a_second, scores
from evidence.stress.failure import Failure
from evidence.subject import Answer, Contestant, at_once
from evidence.subjects.flights.failures.record import Faulty
from evidence.subjects.flights.oracle import bound
from forceid.config import Settings, load_settings
from forceid.estimation.long.windows import estimate_of_any_length
from forceid.estimation.verdict.sensitivity import UNITS
from forceid.files.validate import check_recording
from forceid.records import Array, Estimate, Recording

METHODS = ("difference", "savgol", "spline", "filter", "smoother")
MODELS = ("rigid", "affine", "modal")

Estimator = Callable[[Recording, Settings], Estimate]


def contestants(failure: Failure, short: bool = False) -> tuple[Contestant, ...]:
    """Who meets a failure: every method, and every model where it is about the body; or the default only."""
    if short:
        return (contestant("smoother"),)
    models = MODELS if failure.deforms else ()
    return (*map(contestant, METHODS), *(contestant("smoother", model) for model in models))


def contestant(method: str, model: str = "auto", estimator: Estimator = estimate_of_any_length) -> Contestant:
    """A method with a model."""
    name = method if model == "auto" else f"{method}, {model}"
    return at_once(name, partial(answered_flight, estimator, method, model))


def answered_flight(estimator: Estimator, method: str, model: str, case: Faulty) -> Answer:
    """An estimate of force, or of the loads asked for, and of moment, with rms claims."""
    check_recording(case.recording)
    estimate = estimator(case.recording, load_settings(method=method, model=model, **case.settings))
    if estimate.verdict.level == "refused":
        return Answer((estimate.force, estimate.moment), None, "refused", estimate.verdict.reasons)
    judged: Estimate | WithLoads = estimate
    truth = [case.recording.truth[name] for name in LOADS]
    if case.mixed is not None and estimate.loads is not None:
        judged, truth[0] = with_loads(estimate), case.recording.truth["load"]
    scored = scores(judged, truth, band_of(estimate), samples_a_second(estimate.time))
    return Answer(
        (judged.force, judged.moment),
        (central_rms_per_axis(judged.force_std), central_rms_per_axis(judged.moment_std)),
        estimate.verdict.level,
        estimate.verdict.reasons,
        (central_rms_per_axis(judged.force - truth[0]), central_rms_per_axis(judged.moment - truth[1])),
        told=stated_cost(case, estimate),
        over=scored["over"],
        beside=scored["beside"],
        codes=tuple(f.code for f in estimate.verdict.findings if f.level != "ok"),
    )


@dataclass(frozen=True)
class WithLoads:
    """The loads that were asked for in place of the force, (time, 3) each."""

    force: Array
    force_std: Array
    moment: Array
    moment_std: Array


def with_loads(estimate: Estimate) -> WithLoads:
    """The first three loads of an estimate, and its moment."""
    loads = estimate.loads
    assert loads is not None
    std = np.sqrt(np.diagonal(loads.load_cov, axis1=1, axis2=2))[:, :3]
    return WithLoads(loads.load[:, :3], std, estimate.moment, estimate.moment_std)


def errors(case: Faulty, answer: Answer) -> tuple[float, float]:
    """Rms errors of both loads, which the answer brings: which loads were asked for is told there."""
    assert answer.off is not None
    return answer.off


def stated_cost(case: Faulty, estimate: Estimate) -> tuple[float, float]:
    """What the budget of an estimate says of the input that a case misstates, force and moment, per axis."""
    if case.misstated is None:
        return 0.0, 0.0
    name, amount = case.misstated
    unit, _ = UNITS[name]
    force, moment = (estimate.sensitivity.get(f"{name}_{load}_{unit}", 0.0) for load in ("force", "moment"))
    return amount * force / np.sqrt(3), amount * moment / np.sqrt(3)


def bound_of_trial(case: Faulty) -> tuple[float, float]:
    """Rms bound of force, or of the loads asked for, and of moment."""
    cov = bound(case.flight, case.seen, case.noise, case.place, case.mixed)
    force = cov[:, :3, :3]
    if case.mixed is not None:
        split = np.linalg.pinv(case.mixed)
        force = split @ force @ split.T
    return tuple(  # type: ignore[return-value]
        central_rms_per_axis(np.sqrt(np.diagonal(part, axis1=1, axis2=2))) for part in (force, cov[:, 3:, 3:])
    )


def central_rms_per_axis(values: Array) -> float:
    """Root mean square per axis over the central three quarters of a record (time, axis), gaps left out."""
    square = judged_part(values) ** 2
    known = np.isfinite(square)
    return float(np.sqrt(square[known].mean())) if known.any() else float("nan")
