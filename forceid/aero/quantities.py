"""What the air does to a body: lift, drag, angles and coefficients of an estimate, with their uncertainty."""

from __future__ import annotations

import numpy as np

from forceid.aero.air import density_of, wind_at
from forceid.aero.axes import flow
from forceid.config import AeroSetting
from forceid.motion import exp
from forceid.records import Aero, Array, deviation
from forceid.rounding import CENTRAL_STEP

NAMES = (
    "speed", "alpha", "beta", "pressure", "lift", "drag", "side_force",
    "CL", "CD", "CY", "Cl", "Cm", "Cn", "advance_ratio", "spin_parameter",
)  # fmt: skip
COEFFICIENTS = slice(NAMES.index("CL"), NAMES.index("Cn") + 1)
VECTORS = ("force_wind", "moment_wind", "force_stability", "moment_stability", "force_body", "moment_body")
STATE = 15  # velocity, rotation, angular velocity, force, moment: three each
VELOCITY, ROTATION, RATE, FORCE, MOMENT = (slice(3 * k, 3 * k + 3) for k in range(5))


def quantities(setting: AeroSetting, air: Array, R: Array, omega: Array, F: Array, M: Array) -> Array:
    """All quantities (..., 15 + 18): NAMES, then VECTORS. air (..., 3) m/s: velocity against the air, world
    axes; R (..., 3, 3); omega (..., 3) rad/s; F (..., 3) N and M (..., 3) N m about the mass center, world.
    """
    seen = flow(setting, air, R, omega)
    chord, span = setting.lengths
    pressure = 0.5 * density_of(setting) * seen.speed**2
    qA = pressure * setting.area
    f_wind, f_stability, force = (
        (rows @ F[..., None])[..., 0] for rows in (seen.wind, seen.stability, seen.axes)
    )
    m_wind, m_stability, moment = (
        (rows @ M[..., None])[..., 0] for rows in (seen.wind, seen.stability, seen.axes)
    )
    lift, drag, side = -f_wind[..., 2], -f_wind[..., 0], f_wind[..., 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        roll, pitch, yaw = (moment[..., k] / qA / n for k, n in enumerate((span, chord, span)))
        rim = 0.5 * span * seen.spin / seen.speed
        found = [
            seen.speed, seen.alpha, seen.beta, pressure, lift, drag, side, lift / qA, drag / qA, side / qA,
            roll, pitch, yaw, np.pi / np.abs(rim), rim,
        ]  # fmt: skip
    vectors = [f_wind, m_wind, f_stability, m_stability, force, moment]
    return np.concatenate([np.stack(found, -1), *vectors], -1)


def jacobian(setting: AeroSetting, air: Array, R: Array, omega: Array, F: Array, M: Array) -> Array:
    """Slopes (time, quantity, 15) of `quantities` by velocity, rotation (left error, rad), rate, F and M."""

    def size(a: Array) -> float:
        return float(np.sqrt(np.nanmean(a * a))) or 1.0

    slopes = []
    scale = np.repeat([size(air), 1.0, size(omega), size(F), size(M)], 3) * CENTRAL_STEP
    for k, step in enumerate(scale):
        ends = []
        for sign in (1.0, -1.0):
            d = np.zeros(STATE)
            d[k] = sign * step
            turned = exp(d[ROTATION]) @ R
            args = air + d[VELOCITY], turned, omega + d[RATE], F + d[FORCE], M + d[MOMENT]
            ends.append(quantities(setting, *args))
        with np.errstate(invalid="ignore"):  # an advance ratio without spin
            slopes.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(slopes, -1)


def aero_of(
    setting: AeroSetting,
    motion: tuple[Array, Array, Array, Array],
    wrench: tuple[Array, Array],
    cov: Array,
    gravity: Array,
    wind: Array | None,
    counts: str,
) -> Aero:
    """What the air does along a flight. motion: center, velocity, rotation (time, 3, 3), angular velocity,
    world axes; wrench: force and moment about the mass center; cov (time, 15, 15) of velocity, rotation,
    angular velocity, force and moment; wind (time, 3): as measured; counts: what that covariance counts.

    Errors go through the slopes of every quantity; those of air and sizes are none.
    """
    center, velocity, R, omega = motion
    turned = np.asarray(np.isfinite(R).all((1, 2)))[:, None, None]
    R = np.where(turned, R, np.eye(3))  # of a body that shows no rotation, what needs none
    omega = np.where(np.isfinite(omega), omega, 0.0)
    at = setting, velocity - wind_at(setting, center, gravity, wind), R, omega, *wrench
    every, slopes = quantities(*at), jacobian(*at)
    known = np.where(turned[:, :, 0], 1.0, np.nan) * np.ones(every.shape[1])
    own = [NAMES.index(n) for n in ("speed", "pressure")]
    if setting.axes == "ball":
        own += [NAMES.index(n) for n in ("drag", "CD")]
    known[:, own] = 1.0
    every = every * known
    spread = slopes @ np.where(np.isfinite(cov), cov, 0.0) @ slopes.mT
    std = deviation(spread) * known
    n = len(NAMES)
    parts = {
        name + end: values[:, n + 3 * k : n + 3 * k + 3]
        for end, values in (("", every), ("_std", std))
        for k, name in enumerate(VECTORS)
    }
    return Aero(
        NAMES,
        every[:, :n],
        std[:, :n],
        **parts,
        coefficient_cov=spread[:, COEFFICIENTS, COEFFICIENTS],
        counts=counts,
    )
