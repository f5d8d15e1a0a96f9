"""A record estimated beside its truth: errors, claims and coverage by component, and how they pool."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from time import process_time
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from evidence.judged import UNKNOWN, Judged, judged_part, scores
from forceid.config import load_settings
from forceid.errors import EstimationError
from forceid.estimation.run import estimate_recording
from forceid.records import Array, Body, Estimate, Recording
from forceid.significance import QUANTILE

FORCE, MOMENT = slice(3), slice(3, 6)
NONE = np.full(6, np.nan)


@dataclass(frozen=True)
class RecordScore(Judged):
    """Means over the judged part of a record, by component of force and moment (6,), NaN where none is known.

    square: of the error squared; claimed: of the variance; inside: of what lies in the 95 % interval. over,
    beside, plain: of an estimate, by the judge, force and moment.
    """

    square: Array = field(default_factory=lambda: NONE)
    claimed: Array = field(default_factory=lambda: NONE)
    inside: Array = field(default_factory=lambda: NONE)
    verdict: str = ""
    reasons: tuple[str, ...] = ()
    model: str = ""
    tuned: Mapping[str, float] = field(default_factory=dict)
    nis: float = np.nan
    seconds: float = 0.0
    over: tuple[float, ...] = UNKNOWN
    beside: tuple[float, ...] = UNKNOWN
    plain: tuple[float, ...] = UNKNOWN

    def error(self, of: slice) -> float:
        """Rms error of the components."""
        return float(np.sqrt(self.square[of].mean()))

    def over_claim(self, of: slice) -> float:
        """Rms error over rms claim of the components, at all frequencies."""
        return float(np.sqrt(self.square[of].mean() / self.claimed[of].mean()))


def scored(found: Any, force: Array, moment: Array, **more: Any) -> RecordScore:
    """What was found of force and moment (time, 3), with `wrench_cov`, beside the truth."""
    error = judged_part(np.concatenate([found.force - force, found.moment - moment], 1))
    var = judged_part(np.diagonal(found.wrench_cov, axis1=1, axis2=2))
    inside = np.where(np.isfinite(error), error**2 <= QUANTILE**2 * var, np.nan)
    if isinstance(found, Estimate):
        ratios = scores(found, (force, moment))
        more |= {name: ratios[name] for name in ("over", "beside", "plain")}
    return RecordScore((error**2).mean(0), var.mean(0), inside.mean(0), **more)


def estimated_score(recording: Recording, turn: Array | None = None, **settings: Any) -> RecordScore:
    """A recording with its truth, estimated and scored; turn (3, 3): of the truth into its axes."""
    began = process_time()
    try:
        found = estimate_recording(recording, load_settings(**settings))
    except EstimationError as e:
        return RecordScore(verdict="refused", reasons=(str(e),), seconds=process_time() - began)
    spent, none = process_time() - began, np.full((len(found.time), 3), np.nan)
    turn = np.eye(3) if turn is None else turn
    truth = [recording.truth.get(name, none) @ turn for name in ("force", "moment")]
    said = found.verdict
    return scored(
        found, *truth, verdict=said.level, reasons=said.reasons, model=found.model, seconds=spent,
        tuned=found.tuned,
        nis=float(np.nanmean(found.nis)) if np.isfinite(found.nis).any() else np.nan,
    )  # fmt: skip


def stacked(scores: Iterable[RecordScore], name: str) -> Array:
    """One number by component of every score (score, 6)."""
    return np.array([getattr(score, name) for score in scores])


def error_over_claim(scores: Iterable[RecordScore], of: slice) -> float:
    """Rms over records and axes of the error over what is claimed."""
    each = list(scores)
    ratio = stacked(each, "square")[:, of] / stacked(each, "claimed")[:, of]
    return float(np.sqrt(np.nanmean(ratio))) if np.isfinite(ratio).any() else np.nan


def pooled(scores: Iterable[RecordScore], of: slice) -> tuple[float, float, float]:
    """Rms error, that over the rms claim, and the share in the 95 % intervals, over all records."""
    square, claimed, inside = (np.nanmean(stacked(scores, n)[:, of]) for n in ("square", "claimed", "inside"))
    return float(np.sqrt(square)), float(np.sqrt(square / claimed)), float(inside)


def told_whole(names: tuple[str, ...], position: Array, X: Array, mass: Array) -> Body:
    """A body of masses (node,) at X (node, 3) about their center, told by total mass and inertia alone."""
    E = np.einsum("n,na,nb->ab", mass, X, X)
    inertia = np.trace(E) * np.eye(3) - E
    return Body(names, position, total_mass=mass.sum(), mass_center=np.zeros(3), inertia=inertia)


def low_passed(recording: Recording, cut: float) -> dict[str, Array]:
    """Force and moment of mass points by a zero-phase Butterworth filter of cut Hz and second differences.

    Samples are even; gaps are filled by straight lines.
    """
    motion, m, x = recording.motion, recording.body.mass, np.array(recording.motion.position)
    for track in x.reshape(len(x), -1).T:
        seen = np.isfinite(track)
        track[~seen] = np.interp(motion.time[~seen], motion.time[seen], track[seen])
    step = float(np.ptp(motion.time)) / (len(x) - 1)
    x = sosfiltfilt(butter(2, cut / 0.802, fs=1 / step, output="sos"), x, axis=0)
    bent = np.zeros_like(x)
    bent[1:-1] = (x[2:] - 2 * x[1:-1] + x[:-2]) / step**2
    felt = bent - motion.gravity
    arm = x - np.einsum("n,tna->ta", m / m.sum(), x)[:, None]
    return {
        "force": np.einsum("n,tna->ta", m, felt),
        "moment": np.einsum("n,tna->ta", m, np.cross(arm, felt)),
    }
