"""Deformation smoothed in time, and what it does to the inertia: J and h of the current shape."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.flight.smoother import FlightState
from forceid.flight.vibration import STATES, Vibration, tune_vibrations, vibrating
from forceid.kalman.engines import Engine
from forceid.motion import Products, exp, inertia_products
from forceid.records import Array


@dataclass(frozen=True)
class Deformation:
    """amplitude, rate (time, mode) m, m/s; inertia (time, 3, 3) and h (time, 3) of the shape, body axes.

    path (time, state) and amplitude_var (time, mode): chains of the amplitudes under their prior, each
    smoothed by itself, None where they were not.
    """

    amplitude: Array
    rate: Array
    inertia: Array
    h: Array
    prior: Vibration | None = None
    path: Array | None = None
    amplitude_var: Array | None = None


def smooth_deformation(kin: Kinematics, engine: Engine, causal: bool = False) -> Deformation:
    """Each amplitude under its own tuned prior, and the inertia that the amplitudes make.

    An oscillator under a load that wanders: a vibration or a slow change of shape alike. Gaps are bridged.
    """
    modes = kin.amplitude.shape[1]
    path = np.zeros((len(kin.time), modes * STATES))
    var, prior = np.zeros((len(kin.time), modes)), None
    if modes and np.isfinite(kin.amplitude).any():
        noise_var = np.nan_to_num(kin.amplitude_var, nan=1.0)
        prior = tune_vibrations(kin.time, kin.amplitude, noise_var, engine)
        models = vibrating(prior, noise_var, np.diff(kin.time))
        for j in range(modes):
            found = (engine.filter if causal else engine.smooth)(models.one(j), kin.amplitude[:, j])
            path[:, j * STATES : (j + 1) * STATES], var[:, j] = found.x, found.P[:, 0, 0]
    amplitude, rate = path[:, ::STATES], path[:, 1::STATES]
    return Deformation(amplitude, rate, *inertia_along(kin, amplitude, rate), prior, path, var)


def undeformed(kin: Kinematics, engine: Engine, causal: bool = False) -> tuple[Kinematics, Deformation]:
    """Kinematics whose poses are those of the frames with the smoothed deformation taken out, and that.

    The covariance of a pose is that of the markers, and of what is not known of the deformation.
    """
    deformation, frames = smooth_deformation(kin, engine, causal), kin.frames
    if frames is None or deformation.prior is None or deformation.amplitude_var is None:
        return kin, deformation
    off = np.einsum("tik,tk->ti", frames.leak, deformation.amplitude)
    center, rotation = frames.center - off[:, :3], np.full_like(frames.rotation, np.nan)
    seen = np.isfinite(center).all(1)
    rotation[seen] = exp(-off[seen, 3:]) @ frames.rotation[seen]
    # errors of a mode that vibrates follow each other for a period: as noise of one frame they count as often
    turn = deformation.prior.frequency * np.median(np.diff(kin.time))
    often = np.clip(2 * np.pi / turn, 1.0, len(kin.time))
    spread = frames.leak * (often * deformation.amplitude_var)[:, None]
    cov = frames.cov + spread @ frames.leak.swapaxes(1, 2)
    return replace(kin, pose=replace(kin.pose, center=center, rotation=rotation, cov=cov)), deformation


def as_smoothed(kin: Kinematics, deformation: Deformation, state: FlightState) -> Deformation:
    """The deformation that a flight ended with, smoothed together with it."""
    if state.modes is None:
        return deformation
    amplitude, rate = state.modes[:, ::STATES], state.modes[:, 1::STATES]
    inertia, h = inertia_along(kin, amplitude, rate)
    return replace(deformation, amplitude=amplitude, rate=rate, inertia=inertia, h=h, path=state.modes)


def products_of(kin: Kinematics) -> Products:
    """What amplitudes do to the inertia of a body: where that is known as a whole, affine ones alone do."""
    nodal = kin.inertia.nodal
    if nodal is None and kin.model == "affine":
        nodal = kin.inertia.affine
    if nodal is None or kin.inertia.line is not None:
        return fixed(kin.inertia.tensor, len(kin.shapes))
    return inertia_products(nodal, kin.shape, kin.shapes)


def inertia_along(kin: Kinematics, amplitude: Array, rate: Array) -> tuple[Array, Array]:
    """Inertia (time, 3, 3) and h (time, 3), momentum of the deformation and of what turns inside."""
    J, h = products_of(kin).of(amplitude, rate)
    h = h + kin.inside
    return J, h if kin.spin is None else h + kin.spin.momentum


def fixed(inertia: Array, modes: int) -> Products:
    """Products of a body whose inertia (3, 3) is known as a whole: no amplitude changes it."""
    J = np.zeros((modes + 1, modes + 1, 3, 3))
    J[0, 0] = inertia
    return Products(J, np.zeros((modes + 1, modes, 3)))
