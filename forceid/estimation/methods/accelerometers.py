"""Recordings of accelerometers alone: force and moment in the axes of the body, sample by sample.

Their field of specific force gives m f and J alpha + w x (J w + h), the resultants of all forces but weight,
by least squares: no prior of the loads, and no attitude, which gravity would need. A body that hardly turns
leaves W at zero; where the record says otherwise, w follows from its rate and from W itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.deforming.modes import split_rigid
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.thin_mass import as_sphere
from forceid.estimation.instruments.acceleration_field import (
    FORCE,
    MODES,
    PULL,
    TURN,
    fit_field,
    level_shown,
)
from forceid.estimation.instruments.accelerometer_array import READ, Field
from forceid.estimation.instruments.gyro_free import (
    Turning,
    integral,
    pull,
    pull_slope,
    sense_shown,
    symmetric,
    turning_of,
)
from forceid.estimation.instruments.mode_loads import loads_on_modes
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.innovations import COLOR, NIS_BAND
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.motion import Pose
from forceid.principal import cross_matrix
from forceid.records import Array, Body, Finding, Flags, ModalForces, Motion
from forceid.rounding import SINGLE
from forceid.significance import SIGMAS
from forceid.timing import stage

UNHELD = 0.5  # of gravity: less is read on the mean of no body that is held up, whatever way it is turned
COMPONENTS = ("force x", "force y", "force z", "moment x", "moment y", "moment z")


def judge_field(field: Field | None, gravity: Array) -> list[Finding]:
    """What accelerometers alone do not allow; gravity (3,) m/s2, of which the size counts."""
    if field is None:
        return [note("no-gyro")]
    read = int(np.isfinite(field.y).any(0).reshape(-1, 3).any(1).sum())
    told: Flags = np.asarray(field.told.any(0))
    if not told.any():
        return [note("array-too-small", count=read)]
    found = [note("body-axes")]
    if not told.all():
        names = ", ".join(name for name, ok in zip(COMPONENTS, told, strict=True) if not ok)
        found.append(note("array-open", names=names, count=read))
    mean = float(np.linalg.norm(np.nanmean(field.still.number[:, FORCE], 0)))
    if not field.turns and told[:3].all() and mean < UNHELD * np.linalg.norm(gravity):
        found.append(note("no-weight-read", mean=mean, gravity=float(np.linalg.norm(gravity))))
    if not field.still.dof.any():
        return [*found, note("array-unchecked", count=read)]
    if field.stated and (times := misfit(field)) > np.sqrt(NIS_BAND[1]):
        found.append(note("array-misfit", times=times))
    shown = level_shown(field.fit)
    rounded = shown is None or (not field.stated and shown.white < field.level.white * (1 - SINGLE))
    if not rounded and (correlation := color(field.fit.residual)):
        found.append(note("array-colored", correlation=correlation))
    return found


def misfit(field: Field) -> float:
    """Residuals beside offsets over the noise that is stated, rms."""
    shown = level_shown(field.fit)
    return 0.0 if shown is None else shown.white / field.level.white


def color(residual: Array) -> float:
    """Largest autocorrelation of residuals (time, channel), one or two samples apart, if it is not chance."""
    e = np.nan_to_num(residual - np.nansum(residual, 0) / np.maximum(np.isfinite(residual).sum(0), 1))
    power = float((e**2).sum())
    if len(e) < 20 or not power > 0:
        return 0.0
    found = max((float((e[k:] * e[:-k]).sum()) / power for k in (1, 2)), key=abs)
    return found if abs(found) > max(COLOR, SIGMAS / np.sqrt(len(e))) else 0.0


@stage("flight")
def estimate_field(body: Body, motion: Motion, field: Field, engine: Engine) -> Solution:
    """Wrench of a recording of accelerometers, in body axes, about the mass center."""
    time, tensor = motion.time, field.inertia.tensor
    turned = turned_in(time, field, engine) if field.turns and field.followed else None
    if turned is not None:
        turning, field = turned
        found = along(field, turning)
        findings = () if sense_shown(turning) else (note("turn-sense-open"),)
    else:
        found = at_once(time, field)
        findings = (note("turn-not-followed"),) if field.turns else ()
    modal = modal_of(time, body, field, found, engine)
    if modal is not None:
        findings = (*findings, note("modal-force-varying"))
    T = len(time)
    kin = kinematics_of(field, body, time)
    J, h = np.tile(kin.inertia.tensor, (T, 1, 1)), field.inside
    lost, empty = np.full((T, 3), np.nan), np.zeros((T, 0))
    nis = np.where(field.fit.dof > 0, field.fit.misfit / np.maximum(field.fit.dof, 1), np.nan)
    state = FlightState(
        lost, lost, np.tile(np.eye(3), (T, 1, 1)), found.omega @ tensor + h, found.omega,
        found.wrench[:, :3], found.wrench[:, 3:], found.cov, np.full((T, 6, 6), np.nan), empty,
        nis / field.level.var, np.nan,
    )  # fmt: skip
    level = {"": field.level.white, "_bias": field.level.offset}
    tuned = {f"noise_std_{READ}{name}": float(std) for name, std in level.items()}
    still = Deformation(empty, empty, J, h)
    return Solution(kin, still, state, engine.name, tuned, {}, findings, modal=modal)


@dataclass(frozen=True)
class Found:
    """Wrench (time, 6) with covariance, NaN where not told, and omega (time, 3) rad/s, body axes.

    swing (time, mode): accelerations of modes, swing_cov (time, mode, mode): of their noise.
    """

    wrench: Array
    cov: Array
    omega: Array
    swing: Array
    swing_cov: Array


def at_once(time: Array, field: Field) -> Found:
    """What samples tell each by itself; w of a body in place, as far as it comes back, else NaN."""
    rows, fit = field.to_wrench(field.turns), field.fit
    modes = slice(PULL.stop, None) if field.turns else MODES
    told, cov = field.told_at_once if field.turns else field.told, (rows @ fit.cov @ rows.T)[fit.which]
    omega = np.full((len(time), 3), np.nan)
    if not field.turns:
        since = time - time.mean()
        omega = integral(time, fit.number[:, TURN])
        drift = since @ omega / max(float(since @ since), np.finfo(float).tiny)
        omega = omega - omega.mean(0) - np.outer(since, drift)
    swing_cov = field.level.white**2 * fit.cov[:, modes, modes][fit.which]
    wrench, cov = where_told(told, fit.number @ rows.T, field.level.var * cov)
    return Found(wrench, cov, omega, fit.number[:, modes], swing_cov)


def along(field: Field, turning: Turning) -> Found:
    """What a body does that turns so."""
    y, columns, omega, alpha = field.y, field.sites.columns(True), turning.omega, turning.alpha
    mass, J, T, by = field.inertia.mass, field.inertia.tensor, len(field.y), np.r_[TURN, PULL]
    read = np.concatenate([alpha, pull(omega)], 1) @ columns[:, by].T
    free = fit_field(y - read, np.delete(columns, by, 1), np.delete(field.sites.sizes(True), by))
    slope = np.zeros((T, 9, 6))
    slope[:, :3, 3:], slope[:, 3:, :3] = np.eye(3), pull_slope(omega)
    moved = -(free.back @ columns[:, by])[free.which] @ slope
    H = omega @ J + field.inside
    carried = np.concatenate([mass * moved[:, :3], np.zeros((T, 3, 6))], 1)
    carried[:, 3:, :3], carried[:, 3:, 3:] = cross_matrix(omega) @ J - cross_matrix(H), J
    own = free.cov[free.which]
    cov = carried @ turning.cov @ carried.mT
    cov[:, :3, :3] += mass**2 * field.level.var * own[:, :3, :3]
    wrench = np.concatenate([mass * free.number[:, :3], alpha @ J + field.torque + np.cross(omega, H)], 1)
    swing = moved[:, 3:]
    swing_cov = field.level.white**2 * own[:, 3:, 3:] + swing @ turning.cov @ swing.mT
    return Found(*where_told(field.told, wrench, cov), omega, free.number[:, 3:], swing_cov)


def where_told(told: Flags, wrench: Array, cov: Array) -> tuple[Array, Array]:
    """A wrench (time, 6) and its covariance (time, 6, 6), NaN for components that are not told."""
    both = told[:, :, None] & told[:, None]
    return np.where(told, wrench, np.nan), np.where(both, cov, np.nan)


def turned_in(time: Array, field: Field, engine: Engine) -> tuple[Turning, Field] | None:
    """How the body turns, and the field with the noise that this leaves, where nothing else shows it.

    None where no turn was found that explains the readings.
    """
    columns, level = field.sites.columns(True), field.level
    shown = level_shown(field.turned)  # what no turn explains is no sign of a wrong one
    limit = NIS_BAND[1] * max(1.0, 0.0 if shown is None else (shown.white / level.white) ** 2)
    turning = turning_of(time, field.y, columns, level.white, level.offset, limit, engine)
    if turning is None or field.stated or field.turned.dof.any():
        return None if turning is None else (turning, field)
    level = replace(level, white=level.white * np.sqrt(turning.misfit))
    field = replace(field, level=level)
    turning = turning_of(time, field.y, columns, level.white, level.offset, limit, engine)
    return None if turning is None else (turning, field)


def modal_of(time: Array, body: Body, field: Field, found: Found, engine: Engine) -> ModalForces | None:
    """Forces on the modes, about their means; None where nothing tells mass and stiffness.

    With what the pull of w moves them by; what their rates do to it is left out.
    """
    count, nodal = len(field.sites.shape), field.inertia.nodal
    if not count or body.mode_frequency is None or nodal is None or body.position is None:
        return None
    assert body.mode_shape is not None
    X, frequency = body.position - field.inertia.center, 2 * np.pi * body.mode_frequency[:count]
    flat = split_rigid(body.mode_shape[:count], X, nodal)[1].reshape(count, -1)
    weighed = flat * np.repeat(nodal, 3) if nodal.ndim == 1 else flat @ nodal
    mass, size = np.einsum("ki,ki->k", flat, weighed), np.linalg.norm(flat, axis=1)
    if not ((mass > 0) & (frequency > 0)).all():
        return None
    told = field.still.told(np.eye(field.still.number.shape[1])[MODES])
    a = np.where(told, found.swing, np.nan)
    damping = None if body.mode_damping is None else body.mode_damping[:count]
    load, cov = loads_on_modes(time, a, found.swing_cov, frequency, damping, engine)
    force = mass * load
    if field.turns and np.isfinite(found.omega).all():
        along_X = np.einsum("kna,nb->kab", weighed.reshape(count, -1, 3), X)
        by_pull = np.einsum("tab,kab->tk", symmetric(pull(found.omega)), along_X)
        force += by_pull - by_pull.mean(0)
    shape = (flat / size[:, None]).reshape(count, -1, 3)
    return ModalForces(shape, force / size, np.outer(mass / size, mass / size) * cov)


def kinematics_of(field: Field, body: Body, time: Array) -> Kinematics:
    """Kinematics of a recording that shows no pose: mass, shape and the noise of its accelerometers."""
    T, nodes, inertia = len(time), len(body.node), field.inertia
    empty, lost = np.zeros((T, 0)), np.full((T, 3), np.nan)
    pose = Pose(
        lost, np.full((T, 3, 3), np.nan), np.tile(np.eye(6), (T, 1, 1)), np.full((T, nodes, 3), np.nan),
        np.full(T, np.nan), np.zeros(T),
    )  # fmt: skip
    X = np.zeros((nodes, 3)) if body.position is None else body.position - inertia.center
    inertia = as_sphere(inertia, X)
    return Kinematics(
        time, inertia, X, np.zeros(nodes, bool), pose, np.zeros((0, nodes, 3)), empty, empty, "rigid",
        {READ: field.level.white * np.eye(3)}, {READ: field.stated}, True,
    )  # fmt: skip
