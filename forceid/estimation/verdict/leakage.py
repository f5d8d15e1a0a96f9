"""Leakage: how much deformation a fit takes for rigid motion, and how much rigid motion for deformation.

Markers see a shape phi and the rigid-body modes R only through the rows that they occupy. Where phi_s lies
nearly in the span of R_s, the two trade off: the sine of their angle says how nearly, and the cross block of
the estimator says what of it the fit at hand lets through. Source: principal equations 2.5, 4e, 5.6.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from forceid.estimation.body.deforming.modes import split_rigid
from forceid.estimation.body.deforming.strains import strain_axes, strain_shapes
from forceid.estimation.body.kinematics import Kinematics
from forceid.motion import ReadingCov, pose_gain, pose_rank, seen_together
from forceid.principal import summation_operator
from forceid.records import Array, Body, Flags
from forceid.rounding import ROUNDED, SINGLE, SOLVED
from forceid.significance import TENTH

LOOKED = 64  # frames, nodes, sets of markers or points of a curve that are looked at where many are alike


@dataclass(frozen=True)
class Leakage:
    """How well markers tell rigid motion from deformation, and what the fit passes from one to the other.

    condition: of the rigid-body modes on the markers, lengths in units of the body; rotation_sigma (3,): deg
    per mm of marker noise, about the reference axes, of equal markers. name (shape,): of the shapes looked
    at; sine (shape,): of the angle of each with the rigid motions, on the markers; joint_condition: of
    [R_s Phi_s], columns of length one. In percent of the displacement, rms over the nodes:
    to_rigid (shape,): of a shape that the fit takes for rigid motion, and to_rigid_worst (shape,) in the
    worst frame; to_rigid_alone (shape,): the same of a rigid fit that knows no shape; to_shape: of the
    rigid motion that is taken most for deformation.
    """

    condition: float
    rotation_sigma: Array
    name: tuple[str, ...] = ()
    sine: Array = field(default_factory=lambda: np.zeros(0))
    joint_condition: float = np.nan
    to_rigid: Array = field(default_factory=lambda: np.zeros(0))
    to_rigid_worst: Array = field(default_factory=lambda: np.zeros(0))
    to_rigid_alone: Array = field(default_factory=lambda: np.zeros(0))
    to_shape: float = np.nan

    def numbers(self) -> dict[str, float]:
        """The worst over the shapes, by name: what a result carries."""
        found = {"condition": self.condition, "rotation_sigma_deg_per_mm": largest_known(self.rotation_sigma)}
        if self.name:
            found |= {
                "sine": float(np.nan_to_num(self.sine, nan=0.0).min()),
                "joint_condition": self.joint_condition,
                "shape_to_rigid_percent": largest_known(self.to_rigid),
                "shape_to_rigid_worst_percent": largest_known(self.to_rigid_worst),
                "shape_to_rigid_alone_percent": largest_known(self.to_rigid_alone),
                "rigid_to_shape_percent": self.to_shape,
            }
        return found


def largest_known(values: Array) -> float:
    """Largest of the values known, NaN where none is."""
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else np.nan


def leakage(body: Body, kin: Kinematics) -> Leakage | None:
    """Leakage of the fit of a recording, None where no marker is seen.

    The shapes are the modes of the body where it has any, else those of the model, else the affine strains,
    which a rigid model leaves out: what it would take for rigid motion if the body stretched.
    """
    if not kin.seen.any():
        return None
    where = kin.shape[kin.seen]
    condition, sigma = rigid_condition(where), rotation_sigma(where)
    if not kin.attitude or kin.inertia.line is not None:
        return Leakage(condition, sigma)
    weight = kin.inertia.weight if kin.inertia.weight.any() else np.ones(len(kin.shape))
    name, shapes = shapes_of(body, kin)
    if not len(shapes):  # markers that all stand in one place have none
        return Leakage(condition, sigma)
    weight = weight * (kin.seen | shapes.any(axis=(0, 2)))  # elsewhere nothing is known of the shape
    if not weight.any():
        weight = kin.seen.astype(float)
    S, flat = summation_operator(kin.shape), shapes.reshape(len(shapes), kin.shape.size).T
    rows = np.repeat(kin.seen, 3)
    moved = [cross_blocks(S, flat, kin, pattern, weight) for pattern in patterns(kin)]
    whole = moved[0]
    every = np.array([to_rigid for to_rigid, _ in moved])
    alone = np.linalg.pinv(S[rows]) @ flat[rows]
    return Leakage(
        condition, sigma, name, sine(S[rows], flat[rows]), joint_condition(S[rows], flat[rows]),
        whole[0], np.where(np.isnan(every).all(0), np.nan, np.nan_to_num(every).max(0)),
        100 * size(S @ alone, weight) / size(flat, weight), largest_known(np.array([b for _, b in moved])),
    )  # fmt: skip


def shapes_of(body: Body, kin: Kinematics) -> tuple[tuple[str, ...], Array]:
    """Names and patterns (shape, node, 3), in the gauge of the masses seen, of what could leak."""
    weight = gauge(kin)
    if body.mode_shape is not None:
        nodal = kin.inertia.nodal
        shapes = split_rigid(body.mode_shape, kin.shape, weight if nodal is None else nodal)[1]
        hertz = body.mode_frequency
        at = [""] * len(shapes) if hertz is None else [f" ({f:.3g} Hz)" for f in hertz]
        name = tuple(f"mode {k}{f}" for k, f in enumerate(at, 1))
    elif len(kin.shapes):
        word = "strain" if kin.model == "affine" else "shape"
        name, shapes = tuple(f"{word} {k}" for k in range(1, len(kin.shapes) + 1)), kin.shapes
    else:
        on_seen = np.zeros_like(kin.shape)
        marked = kin.shape[kin.seen]
        strains = strain_shapes(marked, strain_axes(marked)[0])
        if not len(strains):
            return (), np.zeros((0, *on_seen.shape))
        shapes = np.zeros((len(strains), *on_seen.shape))
        shapes[:, kin.seen] = strains
        shapes = split_rigid(shapes, kin.shape, weight)[1] * kin.seen[:, None]
        name = tuple(f"strain {k}" for k in range(1, len(shapes) + 1))
    kept = np.sqrt((shapes**2).sum((1, 2))) > SOLVED
    return tuple(n for n, k in zip(name, kept, strict=True) if k), shapes[kept]


def gauge(kin: Kinematics) -> Array:
    """Weight (node,) of the mean motion: the masses that are seen, or the markers where these do not do."""
    massive = kin.seen & (kin.inertia.weight > 0)
    if massive.any() and pose_rank(summation_operator(kin.shape[massive])) == 6:
        return np.asarray(kin.inertia.weight * kin.seen)
    return kin.seen.astype(float)


def patterns(kin: Kinematics) -> list[Flags]:
    """Sets of markers (node,) that frames show, all that are ever seen first, then the commonest."""
    sets, which = seen_together(kin.pose.residual)
    order = np.argsort(-np.bincount(which), kind="stable")[:LOOKED]
    return [kin.seen, *(p for p in sets[order] if p.any() and (p != kin.seen).any())]


def marker_cov(kin: Kinematics) -> ReadingCov:
    """Covariance that the poses are fitted under: white noise, and deformation of its size."""
    sigma2 = next(iter(kin.noise.values())) ** 2
    cov = ReadingCov(np.full(kin.shape.size, sigma2), np.zeros((kin.shape.size, 0)))
    if not len(kin.shapes):
        return cov
    known = np.isfinite(kin.amplitude)
    count = np.maximum(known.sum(0), 1)
    q, noise = np.where(known, kin.amplitude, 0.0), np.where(known, kin.amplitude_var, 0.0)
    var = np.maximum(((q**2).sum(0) - noise.sum(0)) / count, TENTH**2 * sigma2)
    return cov.beside(kin.shapes.reshape(len(kin.shapes), -1).T * np.sqrt(var))


def cross_blocks(S: Array, flat: Array, kin: Kinematics, seen: Flags, weight: Array) -> tuple[Array, float]:
    """The cross blocks of the fit from some markers, in percent: shapes to rigid (shape,), rigid to shapes.

    S (dof, 6): rigid-body modes; flat (dof, shape): the shapes; NaN where the markers fix no pose.
    """
    gain = pose_gain(S, seen, marker_cov(kin))
    if gain is None:
        return np.full(flat.shape[1], np.nan), np.nan
    rows = np.repeat(seen, 3)
    to_rigid = 100 * size(S @ (gain[0] @ flat[rows]), weight) / size(flat, weight)
    if not len(kin.shapes):
        return to_rigid, 0.0
    model = kin.shapes.reshape(len(kin.shapes), -1).T
    both = np.concatenate([S, model], 1)[rows]
    if np.linalg.matrix_rank(both, rtol=SINGLE) < both.shape[1]:
        return to_rigid, np.nan
    left = S[rows] - S[rows] @ (gain[0] @ S[rows])  # of a rigid motion, once the pose is taken out
    taken = model @ (np.linalg.pinv(both)[6:] @ left)
    unit = np.sqrt(np.repeat(weight, 3))[:, None]
    _, s, Vt = np.linalg.svd(unit * S, full_matrices=False)
    percent = float(100 * np.linalg.norm(unit * taken @ Vt.T / s, 2))
    return to_rigid, percent if percent > SOLVED else 0.0


def size(u: Array, weight: Array) -> Array:
    """Displacement (column,) of patterns u (dof, column), rms over the nodes by weight (node,)."""
    square = (np.repeat(weight, 3)[:, None] * u**2).sum(0)
    return np.asarray(np.sqrt(square / weight.sum()))


def sine(rigid: Array, shapes: Array) -> Array:
    """Sine (shape,) of the angle between each of the shapes (channel, shape) and the span of the rigid ones.

    Zero: on these channels the shape is a rigid motion; one: the rigid fit does not feel it.
    """
    U, s, _ = np.linalg.svd(rigid / np.linalg.norm(rigid, axis=0).clip(1e-300), full_matrices=False)
    U = U[:, s > SOLVED * s[0]]
    left = shapes - U @ (U.T @ shapes)
    whole = np.linalg.norm(shapes, axis=0)
    return np.asarray(np.linalg.norm(left, axis=0) / np.where(whole > 0, whole, 1.0))


def joint_condition(rigid: Array, shapes: Array) -> float:
    """Condition number of [R_s Phi_s] with its columns scaled to length one; infinite where rank is lost."""
    both = np.concatenate([rigid, shapes], 1)
    length = np.linalg.norm(both, axis=0)
    if both.shape[0] < both.shape[1] or not length.all():
        return np.inf
    s = np.linalg.svd(both / length, compute_uv=False)
    return float(s[0] / s[-1]) if s[-1] > ROUNDED * s[0] else np.inf


def rigid_condition(position: Array) -> float:
    """Condition number of the rigid-body modes of markers (marker, 3).

    Turns are about their middle, lengths over their rms distance from it. Infinite on a
    line. Beyond about ten a turn is fixed by little. Source: principal equations 4e, 5.6.
    """
    lever = position - position.mean(0)
    length = np.sqrt((lever**2).sum(1).mean())
    if not length > 0:
        return np.inf
    s = np.linalg.svd(summation_operator(lever / length), compute_uv=False)
    return float(s[0] / s[-1]) if len(s) == 6 and s[-1] > SOLVED * s[0] else np.inf


def rotation_sigma(position: Array) -> Array:
    """Standard deviation (3,) of a fitted turn about each axis, deg per mm of noise of markers (marker, 3).

    All are weighted alike. Infinite about an axis that the markers do not fix. Source: principal equations
    5.6.
    """
    lever = position - position.mean(0)
    inertia = (lever**2).sum() * np.eye(3) - lever.T @ lever
    spread, axes = np.linalg.eigh(inertia)
    known = spread > ROUNDED * max(spread[-1], 1e-300)
    var = np.where(known, 1 / np.where(known, spread, 1.0), np.inf)
    found = np.array([sum(v * a**2 for v, a in zip(var, row, strict=True) if abs(a) > 1e-7) for row in axes])
    return np.asarray(np.degrees(np.sqrt(found)) * 1e-3)
