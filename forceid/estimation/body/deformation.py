"""Deformation smoothed in time, and what it does to the inertia: J and h of the current shape."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.linalg import block_diag

from forceid.estimation.body.kinematics import Kinematics
from forceid.flight.elastic import LOAD_ORDERS, ElasticPrior, seen_modes, tune_elastic
from forceid.flight.smoother import FlightState
from forceid.flight.tuning import ORDERS
from forceid.flight.vibration import ModeState, Vibration, tune_vibrations, vibrating
from forceid.kalman.engines import Engine
from forceid.motion import Products, exp, inertia_products
from forceid.records import Array
from forceid.timing import stage


@dataclass(frozen=True)
class Deformation:
    """How a body deforms along a record.

    amplitude, rate (time, mode) m, m/s, of shapes that show; inertia (time, 3, 3) and h (time, 3) of the
    shape, body axes; path (time, state) and amplitude_var (time, mode): chains of the amplitudes under their
    prior, behind them the weights by which hidden mass follows where a flight told these, None where they
    were not smoothed; load_cov (time, mode, mode): of the loads of elastic modes; answered: the prior of
    these, with the loads that answer them; with_wrench (time, 6, mode): covariance of force and moment with
    those loads, None where they were not smoothed together.
    motion_cov (time, 3 mode, 3 mode): of amplitude, rate and acceleration of each affine mode, with the
    moment moment_motion (time, 3, 3 mode) where they were smoothed together; None elsewhere.
    """

    amplitude: Array
    rate: Array
    inertia: Array
    h: Array
    prior: Vibration | None = None
    path: Array | None = None
    amplitude_var: Array | None = None
    load_cov: Array | None = None
    answered: ElasticPrior | None = None
    with_wrench: Array | None = None
    motion_cov: Array | None = None
    moment_motion: Array | None = None

    def grown(self, wrench: Array | None, motion: Array | None) -> Deformation:
        """The same with claimed errors of a wrench turned by a matrix ([time,] 6, 6), of its motion by
        factors (mode, 3), each as it is for None.
        """
        cov, cross, loads = self.motion_cov, self.moment_motion, self.with_wrench
        if wrench is not None:
            cross = None if cross is None else wrench[..., 3:, 3:] @ cross
            loads = None if loads is None else wrench @ loads
        if motion is not None and cov is not None:
            factor = motion.ravel()
            cov, cross = cov * np.outer(factor, factor), None if cross is None else cross * factor
        return replace(self, motion_cov=cov, moment_motion=cross, with_wrench=loads)

    @property
    def acceleration(self) -> Array:
        """Accelerations (time, mode) m/s2 of the amplitudes; zero where they were not smoothed."""
        if self.prior is None or self.path is None:
            return np.zeros_like(self.rate)
        modes, each = len(self.prior.std), self.prior.states
        chains = self.path[:, : modes * each].reshape(len(self.path), modes, each)
        return np.asarray(np.einsum("kb,tkb->tk", self.prior.motion[:, 2], chains[..., : len(ModeState)]))


def smooth_deformation(kin: Kinematics, engine: Engine, causal: bool = False) -> Deformation:
    """The amplitudes under their tuned prior, and the inertia that they make.

    Oscillators under loads that wander: a vibration or a slow change of shape alike. Gaps are bridged.
    Elastic modes of known frequency are smoothed together, from all that frames say of them; shapes of which
    nobody knows how they swing each by itself.
    """
    modes = kin.amplitude.shape[1]
    if kin.elastic is not None and kin.frames is not None and modes:
        tuned = tune_elastic(kin.time, kin.frames.observed, kin.frames.rows, kin.elastic, engine)
        if tuned is not None:
            return together(kin, tuned, engine, causal)
    if not modes or not np.isfinite(kin.amplitude).any():
        return deforming(
            kin, None, np.zeros((len(kin.time), modes * len(ModeState))), np.zeros((len(kin.time), modes))
        )
    noise_var = np.nan_to_num(kin.amplitude_var, nan=1.0)
    # beside a flight every order costs its passes a state for each mode
    orders = ORDERS if kin.apart else LOAD_ORDERS
    prior = tune_vibrations(kin.time, kin.amplitude, noise_var, engine, orders)
    path = np.zeros((len(kin.time), len(prior.std) * prior.states))
    var = np.tile(prior.std**2, (len(kin.time), 1))
    models = vibrating(prior, noise_var, np.diff(kin.time))
    moving = np.zeros((len(kin.time), modes, 3, modes, 3)) if kin.model == "affine" else None
    for j, at in enumerate(range(0, modes * prior.states, prior.states)):
        found = (engine.filter if causal else engine.smooth)(models.one(j), kin.amplitude[:, j])
        path[:, at : at + prior.states], var[:, j] = found.x, found.P[:, 0, 0]
        if moving is not None:
            own = found.P[:, : len(ModeState), : len(ModeState)]
            moving[:, j, :, j] = prior.motion[j] @ own @ prior.motion[j].T
    smooth = deforming(kin, prior, path, var)
    return smooth if moving is None else replace(smooth, motion_cov=moving.reshape(len(var), 3 * modes, -1))


def deforming(
    kin: Kinematics, prior: Vibration | None, path: Array, var: Array, load_cov: Array | None = None
) -> Deformation:
    """The deformation of chains along a path."""
    each = len(ModeState) if prior is None else prior.states
    own = kin.amplitude.shape[1] * each
    amplitude, rate = path[:, :own:each], path[:, 1:own:each]
    q, q_rate = amplitude, rate
    if kin.hidden is not None and prior is not None and path.shape[1] > own:
        led = partial(kin.hidden.followers(prior).led, path[:, own:])
        q, q_rate = (np.concatenate([one, led(one)], 1) for one in (q, q_rate))
    J, h = inertia_along(kin, q, q_rate)
    return Deformation(amplitude, rate, J, h, prior, path, var, load_cov)


def together(kin: Kinematics, tuned: ElasticPrior, engine: Engine, causal: bool) -> Deformation:
    """Amplitudes of modes smoothed together, from what every frame says of them beside its pose."""
    assert kin.frames is not None
    prior = tuned.vibration
    model, each = seen_modes(kin.time, kin.frames.rows, prior), prior.states
    found = (engine.filter if causal else engine.smooth)(model, kin.frames.observed)
    load = slice(ModeState.LOAD, None, each)
    var = np.diagonal(found.P, axis1=1, axis2=2)[:, ::each]
    smooth = deforming(kin, prior, found.x, var, found.P[:, load, load])
    return replace(smooth, answered=tuned)


@stage("deformation")
def undeformed(kin: Kinematics, engine: Engine, causal: bool = False) -> tuple[Kinematics, Deformation]:
    """Kinematics whose poses are those of the frames with the smoothed deformation taken out, and that.

    The covariance of a pose is that of the markers, and of what is not known of the deformation.
    """
    deformation, frames = smooth_deformation(kin, engine, causal), kin.frames
    if frames is None or deformation.prior is None or deformation.amplitude_var is None:
        return kin, deformation
    shown = deformation.amplitude.shape[1]
    off = np.einsum("tik,tk->ti", frames.leak[..., :shown], deformation.amplitude)
    center, rotation = frames.center - off[:, :3], np.full_like(frames.rotation, np.nan)
    seen = np.isfinite(center).all(1)
    rotation[seen] = exp(-off[seen, 3:]) @ frames.rotation[seen]
    # errors of a mode that vibrates follow each other for a period: as noise of one frame they count as often
    turn = deformation.prior.frequency * np.median(np.diff(kin.time))
    often = np.clip(2 * np.pi / turn, 1.0, len(kin.time))
    var = often * deformation.amplitude_var
    if kin.hidden is not None:
        follow = kin.hidden.followers(deformation.prior)
        led = follow.std**2 * (often * deformation.prior.std**2)[follow.leaders].sum()
        var = np.pad(var, ((0, 0), (0, follow.count)), constant_values=led)
    spread = frames.leak * np.sqrt(var)[:, None]
    cov = frames.cov + spread @ spread.swapaxes(1, 2)
    return replace(kin, pose=replace(kin.pose, center=center, rotation=rotation, cov=cov)), deformation


def as_smoothed(kin: Kinematics, deformation: Deformation, state: FlightState) -> Deformation:
    """The deformation that a flight ended with, smoothed together with it."""
    if state.modes is None:
        return deformation
    assert deformation.amplitude_var is not None
    found = deforming(kin, deformation.prior, state.modes, deformation.amplitude_var)
    if state.modal_cov is None:
        return found
    cross, cov, load = state.modal_cov[:, :6], state.modal_cov[:, 6:], slice(ModeState.LOAD, None, 3)
    found = replace(
        found, answered=deformation.answered, load_cov=cov[:, load, load], with_wrench=cross[..., load]
    )
    if kin.model != "affine":
        return found
    assert deformation.prior is not None
    own = block_diag(*deformation.prior.motion)
    return replace(found, motion_cov=own @ cov @ own.T, moment_motion=cross[:, 3:] @ own.T)


def products_of(kin: Kinematics) -> Products:
    """What amplitudes do to the inertia of a body: where that is known as a whole, affine ones alone do."""
    if kin.hidden is not None:
        return kin.hidden.products(kin.shapes)
    nodal = kin.inertia.nodal
    if nodal is None and kin.model == "affine":
        nodal = kin.inertia.affine
    if nodal is None or kin.inertia.line is not None:
        return fixed(kin.inertia.tensor, len(kin.shapes))
    return inertia_products(nodal, kin.shape, kin.shapes)


def inertia_along(kin: Kinematics, amplitude: Array, rate: Array) -> tuple[Array, Array]:
    """Inertia (time, 3, 3) and h (time, 3), momentum of the deformation and of what turns inside."""
    products = products_of(kin)
    still = (
        (0, 0),
        (0, len(products.inertia) - 1 - amplitude.shape[1]),
    )  # where only markers tell how it bends
    J, h = products.of(np.pad(amplitude, still), np.pad(rate, still))
    h = h + kin.inside
    return J, h if kin.spin is None else h + kin.spin.momentum


def load_on_unit_mass(kin: Kinematics, modes: Vibration) -> float:
    """How strong the loads on shapes of unit modal mass are, in N per root of a kg: their geometric mean."""
    # a shape of unit norm that nobody knows more of moves the mass of a node
    unit = np.sqrt(kin.seen.sum() / kin.inertia.mass) if kin.elastic is None else kin.elastic.size
    return float(np.exp(np.mean(np.log(modes.load[: len(kin.shapes)] / unit))))


def fixed(inertia: Array, modes: int) -> Products:
    """Products of a body whose inertia (3, 3) is known as a whole: no amplitude changes it."""
    J = np.zeros((modes + 1, modes + 1, 3, 3))
    J[0, 0] = inertia
    return Products(J, np.zeros((modes + 1, modes, 3)))
