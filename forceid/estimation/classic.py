"""Difference, Savitzky-Golay and spline: rigid fit first, then two derivatives, window from the data."""

from __future__ import annotations

import numpy as np

from forceid.config import Settings
from forceid.estimation.deformation import Deformation, inertia_along
from forceid.estimation.flight_smoother import Solution
from forceid.estimation.kinematics import Kinematics, kinematics, shape_at
from forceid.kalman.engines import Engine
from forceid.kalman.flight import FlightState
from forceid.motion.derivative import derivatives
from forceid.motion.pose import fit_rotation
from forceid.motion.window import Choice, Window, choose_window, windows
from forceid.principal.mass import equimomental_points
from forceid.principal.operator import axial
from forceid.principal.wrench import momentum, resultant
from forceid.records import Array, Body, Motion


def estimate_classic(body: Body, motion: Motion, settings: Settings, engine: Engine) -> Solution:
    """Wrench and motion by differentiating positions; the method is settings.method.

    The mass center gives the force. For the moment the mass points go where pose and deformation put them,
    S^T M a at their current positions (principal equations 2.4). Each quantity has its own window.
    """
    kin = kinematics(body, motion, settings)
    time, candidates = kin.time, windows(settings.method, motion.time)  # type: ignore[arg-type]
    force = choose_force(kin, motion.gravity, candidates)
    amplitude, rate = np.nan_to_num(kin.amplitude), np.zeros_like(kin.amplitude)
    tuned = {"force_window_s": force.window.seconds} | {f"noise_std_{k}": v for k, v in kin.noise.items()}
    path = derivatives(time, kin.pose.center, force.window)
    cov = np.full((len(time), 6, 6), np.nan)
    cov[:, range(3), range(3)] = force.variance
    none = np.full((len(time), 3), np.nan)
    moment, H, omega, rotation = none, none, none, kin.pose.rotation
    if kin.attitude:
        mass, points = mass_points(kin)
        chosen = choose_moment(kin, mass, points, candidates)
        moment, tuned["moment_window_s"] = chosen.target, chosen.window.seconds
        cov[:, range(3, 6), range(3, 6)] = chosen.variance
        H, omega, rotation = spin(kin, mass, points, chosen.window)
        if amplitude.size:
            smooth = derivatives(time, kin.amplitude, chosen.window)
            amplitude, rate = np.nan_to_num(smooth.value), np.nan_to_num(smooth.first)
    cov = np.where(np.isnan(cov) & np.isfinite(cov[:, range(6), range(6)]).all(1)[:, None, None], 0.0, cov)
    state = FlightState(
        path.value, path.first, rotation, H, omega, force.target, moment, cov, kin.pose.cov,
        np.zeros((len(time), 0)), np.full(len(time), np.nan), np.nan,
    )  # fmt: skip
    deformation = Deformation(amplitude, rate, *inertia_along(kin, amplitude, rate))
    return Solution(kin, deformation, state, "numpy", tuned, {})


def choose_force(kin: Kinematics, gravity: Array, candidates: list[Window]) -> Choice:
    """Force on the mass center under the window that the force calls for."""
    var = np.diagonal(kin.pose.cov[:, :3, :3], axis1=1, axis2=2)

    def estimate(window: Window) -> tuple[Array, Array]:
        d = derivatives(kin.time, kin.pose.center, window)
        return kin.inertia.mass * (d.second - gravity), kin.inertia.mass**2 * var * d.gain[:, :, 2, 2]

    return choose_window(candidates, estimate)


def choose_moment(kin: Kinematics, mass: Array, points: Array, candidates: list[Window]) -> Choice:
    """Moment about the mass center under the window that the moment calls for."""
    T = len(kin.time)
    R, C = kin.pose.rotation, kin.pose.cov[:, 3:, 3:]
    J = R @ kin.inertia.tensor @ R.swapaxes(1, 2)
    var = np.einsum("tab,tbc,tac->ta", J, C, J)

    def estimate(window: Window) -> tuple[Array, Array]:
        d = derivatives(kin.time, points.reshape(T, -1), window)
        wrench = resultant(mass, d.value.reshape(points.shape), d.second.reshape(points.shape))
        return wrench[:, 3:], var * d.gain[:, :1, 2, 2]

    return choose_window(candidates, estimate)


def mass_points(kin: Kinematics) -> tuple[Array, Array]:
    """Masses, and world positions (time, point, 3) of what carries them: nodes, or an equimomental set."""
    if kin.inertia.nodal is None:
        mass, points = equimomental_points(kin.inertia.mass, kin.inertia.tensor)
        shape = np.broadcast_to(points, (len(kin.time), *points.shape))
    else:
        mass, shape = kin.inertia.nodal, shape_at(kin, kin.amplitude)
    return mass, kin.pose.center[:, None] + np.einsum("tab,tnb->tna", kin.pose.rotation, shape)


def spin(kin: Kinematics, mass: Array, points: Array, window: Window) -> tuple[Array, Array, Array]:
    """Angular momentum about the mass center, angular velocity (time, 3), and smoothed rotation."""
    T = len(kin.time)
    d = derivatives(kin.time, points.reshape(T, -1), window)
    x, v = d.value.reshape(points.shape), d.first.reshape(points.shape)
    center = derivatives(kin.time, kin.pose.center, window)
    H = momentum(mass, x, v, about=center.value)[:, 3:]
    frame = derivatives(kin.time, kin.pose.rotation.reshape(T, -1), window)
    R, dR = frame.value.reshape(T, 3, 3), frame.first.reshape(T, 3, 3)
    omega = 0.5 * axial(dR @ R.swapaxes(1, 2)) * -1.0
    seen = np.isfinite(R).all((1, 2))
    rotation = np.full_like(R, np.nan)
    rotation[seen] = fit_rotation(R[seen].swapaxes(1, 2), np.eye(3), np.ones(3))[1]
    return H, omega, rotation
