"""What the markers say of the shape: a reference they leave, and what no shape of the model explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import null_space
from scipy.special import chdtri

from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.deformation_residual import beyond_rigid
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.innovations import NIS_BAND
from forceid.motion import ReadingCov
from forceid.records import Array, Body, Finding
from forceid.rounding import SINGLE
from forceid.significance import WILD

ELSEWHERE = 0.05  # of the size of a body, by which a mean shape may leave its reference
STRETCHES = 8  # of a record, whose means tell their scatter to a quarter
AGREE = 0.85  # chi-square per degree of freedom of a shape quieter than stated
AIRY = 1e-5  # kg/m3 in a cube of the length of the body; the long wires of a satellite come near


def judge_reference(body: Body, kin: Kinematics) -> list[Finding]:
    """Markers that are, all the time, far from where the reference shape has them.

    An affine body may be stretched all the time: then from where an affine map of that shape has them, which
    is about the center that a rigid body would have there.
    """
    if body.position is None or not kin.attitude or not kin.seen.any():
        return []
    X = body.position - kin.inertia.center
    field = np.column_stack([X, np.ones(len(X))])
    there = field @ np.linalg.lstsq(field[kin.seen], kin.shape[kin.seen])[0] if kin.model == "affine" else X
    off = np.linalg.norm(kin.shape - there, axis=1) * kin.seen
    size = float(np.sqrt((X[kin.seen] ** 2).sum(1).mean()))
    k = int(off.argmax())
    if off[k] < max(ELSEWHERE * size, WILD * unsure(kin)[k]):
        return []
    return [note("reference-differs", off_mm=1e3 * off[k], marker=body.node[k], size_mm=1e3 * size)]


def unsure(kin: Kinematics) -> Array:
    """Standard deviation (node,) m of the place of a marker in the mean shape, as stretches of it differ."""
    y = kin.pose.residual
    whole = y[np.isfinite(y[:, kin.seen]).all((1, 2))]
    if len(whole) < STRETCHES:
        return np.zeros(y.shape[1])
    means = np.stack([part.mean(0) for part in np.array_split(np.nan_to_num(whole), STRETCHES)])
    return np.asarray(np.sqrt(means.var(0, ddof=1).sum(1) / STRETCHES))


def judge_size(kin: Kinematics) -> list[Finding]:
    """A body lighter than any of its length: positions or inertia in other units than they say."""
    if not kin.seen.any():
        return []
    mass, moments = kin.inertia.mass, np.trace(kin.inertia.tensor)
    gyration = float(np.sqrt(moments / (2 * mass))) if moments > 0 else 0.0
    length = max(float(np.ptp(kin.shape[kin.seen], axis=0).max()), gyration)
    if not mass < AIRY * length**3:
        return []
    return [note("too-light", mass_kg=mass, length_m=length)]


def judge_shape(kin: Kinematics, body: Body, left: float | None = None) -> list[Finding]:
    """What the model leaves of the shape, of markers and of mass that carries none.

    left: chi-square of what the rigid level leaves over that of the best one, where levels were compared:
    all mass then goes with one of them, unless the body is known as a whole and does not stretch as one.
    """
    dof = kin.pose.dof > 0
    if not kin.attitude or not dof.any():
        return []
    if kin.inertia.nodal is None and not (kin.model == "affine" and kin.inertia.affine is not None):
        ratio, size = beyond_shapes(replace(kin, shapes=kin.shapes[:0]))
        ratio = max(ratio, left or 0.0)  # what the mass of a body known as a whole does beside is open
        if ratio < NIS_BAND[1]:
            return []
        return [note("rigid-shape-left", off_mm=1e3 * size, chi_square=ratio)]
    if left is not None:
        return []
    hidden = int(((kin.inertia.weight > 0) & ~kin.seen).sum())
    if kin.model == "affine" and hidden and (body.mode_shape is not None or body.stiffness is not None):
        return [note("unmarked-mass-in-modes", count=hidden)]
    ratio, size = beyond_shapes(kin)
    if ratio < NIS_BAND[1]:
        return []
    return [note("shape-left", model=kin.model, off_mm=1e3 * size, chi_square=ratio)]


def judge_common(kin: Kinematics) -> list[Finding]:
    """Markers that agree with each other better than their mass center is found to be known.

    Errors that all markers share move the center and leave the shape alone; only of a rigid body does the
    shape show what is left beside them.
    """
    counted = kin.shared is not None  # the errors that all markers share are part of the claim then
    if counted or len(kin.shapes) or not kin.attitude or not kin.stated.get("position", False):
        return []
    dof = kin.pose.dof > 0
    count = float(kin.pose.dof[dof].sum())
    if not count:
        return []
    ratio = float(np.nansum(kin.pose.chi_square[dof])) / count
    # the noise is that of the center where this showed another one: known by its readings alone
    unsure = np.sqrt(2 / count + 2 / (3 * dof.sum()))
    if ratio > min(AGREE, 1 - WILD * unsure):
        return []
    noise = 1e3 * kin.noise["position"]
    return [note("errors-shared", agree_mm=noise * np.sqrt(ratio), noise_mm=noise)]


def beyond_shapes(kin: Kinematics) -> tuple[float, float]:
    """Chi-square per degree of freedom of what rigid motion and shapes leave of the markers, and its rms m.

    Of the median frame, which a few wild ones do not move.
    """
    assert kin.markers is not None
    seen = beyond_rigid(kin.time, kin.markers.measured, kin)
    left = null_space(seen.of(kin.shapes), rcond=SINGLE)  # (freedom, direction) that no shape moves
    z = (seen.y @ left)[np.isfinite(seen.y).all(1)]
    if not z.size:
        return 0.0, 0.0
    rows = np.repeat(seen.kept, 3)
    beside = np.zeros((rows.size, 0)) if kin.beside is None else kin.beside
    along = (seen.basis @ left).T @ beside[rows]
    unit = ReadingCov(np.full(len(along), seen.var), along).whitened(z)
    chi_square = np.einsum("ti,ti->t", unit, unit)
    ratio = float(np.median(chi_square) / chdtri(left.shape[1], 0.5))
    return ratio, float(np.sqrt((z**2).sum(1).mean() / seen.kept.sum() / 3))


def judge_modes(kin: Kinematics) -> list[Finding]:
    """What to say where modes are given without what holds them."""
    modes = None if kin.markers is None or kin.model != "modal" else kin.markers.modes
    return [note("no-modal-force")] if modes is not None and modes.compliance is None else []


def judge_answers(kin: Kinematics, deformation: Deformation) -> list[Finding]:
    """Modes that swing otherwise than their stiffness says: which one by most, and at what frequency."""
    prior, elastic = deformation.answered, kin.elastic
    if prior is None or prior.spring is None or prior.brake is None or elastic is None:
        return []
    w = prior.vibration.frequency
    k = int((np.abs(prior.spring) / w**2 * deformation.amplitude.std(0)).argmax())
    hertz = [float(f) / (2 * np.pi) for f in (w[k], elastic.frequency[k])]
    ratio = float(prior.brake[k] / (2 * w[k]))
    return [note("load-answers-mode", mode=k + 1, found_hz=hertz[0], told_hz=hertz[1], damping=ratio)]
