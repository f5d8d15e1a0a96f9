"""What a free flight tells of the body itself: constants of its material, with covariance and a verdict.

Source: pseudo-rigid bodies, sections 1 and 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import f as fisher

from forceid.config import Settings
from forceid.errors import DataError
from forceid.estimation.affine.free_flight import CONSTANTS, LAWS, UNKNOWN
from forceid.estimation.affine.identification import GROSS, FittedFlight, Frames, fit_flight, frames_of
from forceid.estimation.body.cleaning import cleaned
from forceid.estimation.body.deforming.free_swings import FreeSwing, free_swing
from forceid.estimation.body.deforming.modes import fit_amplitudes
from forceid.estimation.body.markers import markers_of
from forceid.estimation.body.material import law_name
from forceid.estimation.body.tracks.noise_axes import as_stated
from forceid.estimation.stated import with_stated
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import FEW, judge
from forceid.principal import summation_operator
from forceid.records import Array, Finding, Recording, Verdict
from forceid.rounding import solvable
from forceid.significance import DENIED, PATIENCE, QUANTILE, TENTH

STARTS = 4  # rough constants that a law is fitted from, where no law fits yet
ABSENT = 1e12  # numbers that tell a noise which is stated


@dataclass(frozen=True)
class Identified:
    """Constants of a material: lam, mu (J of the whole body, or Pa with its volume) and damping (J s, Pa s).

    value (3,), cov (3, 3), in that order; misfit: chi-square of the flight per degree of freedom; noise_std m
    of a coordinate. NaN where the flight tells none.
    """

    law: str
    value: Array
    cov: Array
    unit: str
    misfit: float
    noise_std: float
    verdict: Verdict
    volume: float | None = None

    @property
    def interval(self) -> Array:
        """Ends (3, 2) of the 95 % intervals."""
        half = QUANTILE * np.sqrt(np.diag(self.cov))
        return np.stack([self.value - half, self.value + half], 1)

    def as_dict(self) -> dict[str, Any]:
        """For --json: each constant by name, and the material as /body/material and [material] take it."""
        rows = zip(CONSTANTS, self.value, np.sqrt(np.diag(self.cov)), self.interval, strict=True)
        units = (self.unit, self.unit, f"{self.unit} s")
        constants = {
            name: {"value": value, "std": std, "low": ends[0], "high": ends[1], "unit": unit}
            for (name, value, std, ends), unit in zip(rows, units, strict=True)
        }
        return {
            "law": self.law, "constants": constants, "order": list(CONSTANTS), "covariance": self.cov,
            "misfit": self.misfit, "noise_std": self.noise_std, "material": self.material(),
        }  # fmt: skip

    def material(self) -> dict[str, str | float] | None:
        """Name and constants of the law itself, None where the flight tells none."""
        if not np.isfinite(self.value).all():
            return None
        lam, mu, damping = map(float, self.value)
        own = {"lam": lam, "mu": mu} if self.law == "st_venant_kirchhoff" else {"a": mu / 2, "c": lam / 4}
        more = {} if self.volume is None else {"volume": self.volume}
        return {"name": self.law, **own, "damping": max(damping, 0.0), **more}


@solvable()
def identify_recording(recording: Recording, settings: Settings) -> Identified:
    """Constants of the material from a flight under weight alone.

    Of the law that the file or the settings name, else of the likeliest. Raises DataError for a recording
    that shows no affine motion, and for a law that has no two constants of Lame.
    """
    recording = with_stated(recording, settings)
    material = recording.body.material
    laws, volume = list(LAWS), None
    if material is not None:
        laws = [law_name(material)]
        volume = float(material["volume"]) if "volume" in material else None  # type: ignore[arg-type]
        if laws[0] not in LAWS:
            what = f"is {laws[0]}, expected one of {', '.join(LAWS)}"
            raise DataError(what, "/body/material", "name one of these, or leave it out")
    motion, _ = cleaned(recording.body, recording.motion)
    stated = settings.noise_std.get("position", motion.noise_std.get("position"))
    frames = frames_of(recording.body, motion, stated)
    fits: list[FittedFlight] = []
    limit = float(fisher.isf(DENIED, 9 * len(frames.time) - UNKNOWN, frames.dof or ABSENT))
    # a body whose strain stays the same swings in no way that its samples could show
    still = frames.strains < float(fisher.isf(DENIED, 6 * (len(frames.time) - 1), frames.dof or ABSENT))
    for law in laws if not still else ():
        fitted = any(fit.misfit < GROSS for fit in fits)
        if (fit := fit_flight(frames, law, 1 if fitted else STARTS)) is not None:
            fits = sorted([*fits, fit], key=lambda fit: fit.misfit)
    law, misfit, scale = laws[0], np.nan, 1.0 / (volume or 1.0)
    value, cov = np.full(3, np.nan), np.full((3, 3), np.nan)
    verdict = judge([note("no-free-flight")])
    if fits:
        law, misfit = fits[0].law, fits[0].misfit
        wide = fits[0].cov * max(misfit, 1.0)  # what the flight leaves beyond the noise widens the claim
        verdict = judge(findings_of(frames, fits, wide, limit))
        if verdict.level != "refused":
            value, cov = scale * fits[0].p[18:], scale**2 * wide
    return Identified(law, value, cov, "Pa" if volume else "J", misfit, frames.sigma, verdict, volume)


@dataclass(frozen=True)
class IdentifiedModes:
    """Frequency (Hz) and damping ratio of the modes of a body, in its order, None where one is not seen to
    swing; noise_std m of a coordinate.
    """

    swings: tuple[FreeSwing | None, ...]
    noise_std: float
    verdict: Verdict

    def as_dict(self) -> dict[str, Any]:
        """For --json: each number by name, with its interval; the covariance of frequency and damping."""
        constants: dict[str, Any] = {}
        for k, swing in enumerate(self.swings, 1):
            numbers = (np.nan, np.nan) if swing is None else (swing.frequency, swing.damping)
            std = np.full(2, np.nan) if swing is None else np.sqrt(np.diag(swing.cov))
            for name, unit, value, one in zip(
                ("frequency", "damping"), ("Hz", ""), numbers, std, strict=True
            ):
                ends = {"low": value - QUANTILE * one, "high": value + QUANTILE * one}
                constants[f"{name}_{k}"] = {"value": value, "std": one, **ends, "unit": unit}
        cov = [None if swing is None else swing.cov for swing in self.swings]
        misfit = [None if swing is None else swing.misfit for swing in self.swings]
        return {"constants": constants, "covariance": cov, "misfit": misfit, "noise_std": self.noise_std}


@solvable()
def identify_modes(recording: Recording, settings: Settings) -> IdentifiedModes:
    """Frequency and damping of the modes that a body brings, by shapes or a stiffness, from a free flight.

    Each swings by itself, about the shape that its spin holds. Raises DataError where no marker shows them.
    """
    recording = with_stated(recording, settings)
    motion, _ = cleaned(recording.body, recording.motion)
    if motion.position is None:
        raise DataError("holds no markers", "/motion/position", "modes show in markers only")
    markers = markers_of(
        recording.body, motion, as_stated(motion.noise_std | settings.noise_std, motion), True
    )
    if markers.modes is None or not markers.oriented:
        raise DataError(
            "shows no rotation and modes", "/motion/position", "mark three points off a line, and more"
        )
    sigma, shapes = markers.noise_std, markers.modes.shape
    q, var = fit_amplitudes(markers.residual, shapes, summation_operator(markers.shape), markers.white)
    found: list[Finding] = []
    swings: list[FreeSwing | None] = []
    for k in range(len(shapes)):
        seen = np.isfinite(q[:, k])
        swing = free_swing(markers.time, q[:, k], var[:, k]) if seen.sum() > FEW else None
        if swing is None or swing.gain < 2 * (PATIENCE + np.log(seen.sum())):
            swing = None
            found.append(note("mode-still", mode=k + 1))
        elif swing.misfit > float(fisher.isf(DENIED, seen.sum() - 5, ABSENT)):
            found.append(note("mode-misfit", mode=k + 1, misfit=swing.misfit))
        swings.append(swing)
    if not any(swings):
        found.append(note("no-free-flight"))
    return IdentifiedModes(tuple(swings), sigma, judge(found))


def findings_of(frames: Frames, fits: list[FittedFlight], cov: Array, limit: float) -> list[Finding]:
    """What is wrong with the likeliest of some flights, or to be known.

    cov: claimed of its constants; limit: chi-square per degree of freedom that chance explains.
    """
    best, found = fits[0], []
    misfit = best.misfit
    if not frames.dof:
        found.append(note("flight-noise-stated", noise_mm=1e3 * frames.sigma))
    if misfit > limit:
        found.append(note("flight-misfit", "refused" if misfit > GROSS else None, misfit=misfit, limit=limit))
    if frames.falls > float(fisher.isf(DENIED, 3 * len(frames.time), frames.dof or ABSENT)):
        found.append(note("center-pushed", misfit=frames.falls))
    lam, mu, _ = best.p[18:]
    half = QUANTILE * np.sqrt(np.diag(cov))
    bulk = np.array([1.0, 2 / 3, 0.0])
    if mu < half[1] or lam + 2 / 3 * mu < QUANTILE * np.sqrt(bulk @ cov @ bulk):
        found.append(note("constants-open", lam=lam, lam_half=half[0], mu=mu, mu_half=half[1]))
    elif max(half[:2]) > TENTH * mu:
        found.append(note("constants-wide", lam=lam, lam_half=half[0], mu=mu, mu_half=half[1]))
    for rival in fits[1:]:
        gain = 0.5 * (rival.misfit / max(misfit, 1.0) - 1.0) * best.dof
        apart = np.abs(rival.p[18:20] - best.p[18:20])
        if gain < PATIENCE and (apart > half[:2]).any():
            found.append(note("law-open", law=best.law, rival=rival.law, gain=gain, apart=float(apart.max())))
    return found
