"""What loads say of themselves: vibration that passes for one, loads alike."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import chdtri

from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.leakage import marker_cov
from forceid.flight.priors.protocol import LoadPrior
from forceid.motion import pose_gain
from forceid.principal import summation_operator, undetermined
from forceid.records import Array, Finding, Loads
from forceid.significance import DENIED

HASTE = 3000.0  # m/s2 that half of a record exceeds: meters where millimeters are meant fall at 9810


def judge_overlap(
    kin: Kinematics, amplitude: Array, priors: Mapping[str, LoadPrior], force_std: Array
) -> list[Finding]:
    """Shapes that vibrate inside the band of the force, and leak into it by more than is claimed.

    amplitude (time, shape) m, smoothed; force_std (time, 3) N. What a shape moves the fitted center by, times
    the mass and the square of its frequency, is a force that does not act.
    """
    band = force_band(kin, priors["force"]) if "force" in priors else 0.0
    if not len(kin.shapes) or not kin.attitude or not band > 0:
        return []
    gain = pose_gain(summation_operator(kin.shape), kin.seen, marker_cov(kin))
    if gain is None:
        return []
    flat = kin.shapes.reshape(len(kin.shapes), -1)[:, np.repeat(kin.seen, 3)]
    leak = np.linalg.norm(gain[0][:3] @ flat.T, axis=0)
    q = amplitude - amplitude.mean(0)
    power = np.abs(np.fft.rfft(q, axis=0)[1:]) ** 2
    w = 2 * np.pi * np.fft.rfftfreq(len(q), float(np.median(np.diff(kin.time))))[1:]
    at = w[(power * w[:, None] ** 2).argmax(0)]  # where it moves fastest
    false = kin.inertia.mass * at**2 * leak * q.std(0)
    claimed = float(np.sqrt(np.nanmean(force_std**2)))
    return [
        note("vibration-in-band", shape=k + 1, frequency_hz=at[k] / (2 * np.pi), band_hz=band, force=false[k])
        for k in range(len(kin.shapes))
        if at[k] < 2 * np.pi * band and false[k] > claimed
    ]


def force_band(kin: Kinematics, prior: LoadPrior) -> float:
    """Frequency Hz up to which a smoother with its prior follows half of the force."""
    step = float(np.median(np.diff(kin.time)))
    noise = float(kin.inertia.mass**2 * np.nanmean(np.diagonal(kin.pose.cov, axis1=1, axis2=2)[:, :3]))
    f = np.linspace(0.0, 0.5 / step, 4096)
    w = 2 * np.pi * f
    return float(f[prior.spectrum(w).mean(1) >= noise * step * w**4].max(initial=0.0))


def judge_haste(kin: Kinematics, force: Array) -> list[Finding]:
    """Accelerations that a body bears for moments at most: positions or times in other units."""
    size = np.linalg.norm(force, axis=1) / kin.inertia.mass
    typical = float(np.median(size[np.isfinite(size)])) if np.isfinite(size).any() else 0.0
    if not typical > HASTE:
        return []
    return [note("many-weights", times=typical / 9.81)]


def judge_roughness(priors: Mapping[str, LoadPrior]) -> list[Finding]:
    """Loads that kink: under blows, or where what the model does not follow passes for load."""
    return [note("load-kinks", load=load) for load, prior in priors.items() if prior.kernel.kinks]


def judge_loads(loads: Loads | None) -> list[Finding]:
    """Loads that the motion cannot tell apart, and a wrench that the pattern of loads does not explain."""
    if loads is None or not np.isfinite(loads.load).any():
        return []
    found = []
    if hidden := undetermined(loads):
        found.append(note("loads-in-combination", names=", ".join(hidden)))
    misfit = float(np.nanmean(loads.chi_square))
    if loads.dof and misfit > chdtri(loads.dof, DENIED):
        found.append(note("loads-unexplained", chi_square=misfit / loads.dof))
    return found
