"""Every way of ours: methods, levels of the model, engines, numbers of modes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from evidence.subject import Answer, Contestant
from evidence.subjects.flights.cases import Case
from forceid.config import load_settings
from forceid.estimation.long.windows import estimate_of_any_length
from forceid.kalman.engines import engine
from forceid.records import Array, Estimate
from forceid.sections import to_toml

DEFAULT = "smoother"
MODES = (1, 2, 3, 5)
NO_MODES = ", 0 modes"


def ours() -> list[Contestant]:
    """Contestants of forceid; the default settings come first."""
    found = [
        under_settings(DEFAULT, "method", "forceid with default settings"),
        under_settings("filter", "method", "live: no later samples", method="filter"),
        under_settings("savgol", "method", "Savitzky-Golay, window from the data", method="savgol"),
        under_settings("spline", "method", "smoothing spline, smoothness from the data", method="spline"),
        under_settings("difference", "method", "differences, lag from the data", method="difference"),
        under_settings("rigid", "level", "smoother, rigid body", model="rigid"),
        under_settings("affine", "level", "smoother, rigid body and uniform strain", model="affine"),
        under_settings("modal", "level", "smoother, modes chosen from the data", model="modal"),
        under_settings("numpy engine", "engine", "smoother without a compiler", engine="numpy", slow=True),
        under_settings(
            "filterpy engine", "engine", "on the passes of filterpy", engine="filterpy", slow=True
        ),
    ]
    return found + [
        under_settings(
            f"{k} mode{'s' * (k > 1)}", "modes", f"smoother, {k} modes kept", True, model="modal", modes=k
        )
        for k in MODES
    ]


def under_settings(name: str, kind: Any, about: str, slow: bool = False, **settings: Any) -> Contestant:
    """An estimate under some settings."""
    merged = load_settings(**settings)

    def prepare(case: Case) -> Callable[[], Answer]:
        return lambda: answer_of_estimate(estimate_of_any_length(case.blind, merged))

    key = to_toml(merged) + engine(merged.engine).name
    return Contestant(name, prepare, kind, about, key=key, slow=slow)


def answer_of_estimate(estimate: Estimate) -> Answer:
    """What an estimate answers."""
    std = np.sqrt(np.diagonal(estimate.wrench_cov, axis1=1, axis2=2))
    chosen = estimate.model
    if estimate.mode_amplitude is not None:
        chosen += f", {estimate.mode_amplitude.shape[1]} modes"
    windows = {name.split("_")[0]: value for name, value in estimate.tuned.items() if "window" in name}
    chosen = ", ".join([chosen, *(f"{load} {1e3 * value:.3g} ms" for load, value in windows.items())])
    verdict = estimate.verdict
    return Answer(
        (estimate.force, estimate.moment), halves(std), verdict.level, verdict.reasons, chosen=chosen
    )


def halves(wrench: Array) -> tuple[Array, Array]:
    """Force and moment of wrenches (time, 6), or of their deviations."""
    return wrench[:, :3], wrench[:, 3:]


def worth_while(contestant: Contestant, answers: Mapping[str, Sequence[Mapping[str, Any]]]) -> bool:
    """Whether a contestant says anything new: numbers of modes do not where the modal level chose none."""
    chosen = [a["chosen"] for a in answers.get("modal", ())[:1]]
    return contestant.kind != "modes" or not any(words.endswith(NO_MODES) for words in chosen)
