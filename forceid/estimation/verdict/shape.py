"""What the markers say of the shape: a reference they leave, and what no shape of the model explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import null_space
from scipy.special import chdtri

from forceid.estimation.body.deformation_residual import beyond_rigid
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.finding import Finding
from forceid.records import Body, Motion

ELSEWHERE = 0.05  # of the size of a body, by which a mean shape may leave its reference
AGREE, SURE = 0.85, 5.0  # chi-square of a shape quieter than stated, and standard deviations below one
AIRY = 1e-5  # kg/m3 in a cube of the length of the body; the long wires of a satellite come near
LIMIT = 1.3  # chi-square per degree of freedom of what a model leaves


def judge_reference(body: Body, kin: Kinematics) -> list[Finding]:
    """Markers that are, all the time, far from where the reference shape has them."""
    if body.position is None or not kin.attitude or not kin.seen.any():
        return []
    X = body.position - kin.inertia.center
    off = np.linalg.norm(kin.shape - X, axis=1) * kin.seen
    size = float(np.sqrt((X[kin.seen] ** 2).sum(1).mean()))
    k = int(off.argmax())
    if off[k] < ELSEWHERE * size:
        return []
    return [
        Finding(
            f"the mean shape leaves the reference shape by {1e3 * off[k]:.2g} mm at {body.node[k]}, on a "
            f"body of {1e3 * size:.2g} mm: labels or /body/position are wrong, and with them mass center and "
            "inertia, or the body bends that far; check both"
        )
    ]


def judge_size(kin: Kinematics) -> list[Finding]:
    """A body lighter than any of its length: positions in other units than they say."""
    if not kin.seen.any():
        return []
    length, mass = float(np.ptp(kin.shape[kin.seen], axis=0).max()), kin.inertia.mass
    if not mass < AIRY * length**3:
        return []
    return [
        Finding(
            f"a body of {mass:.3g} kg that is {length:.3g} m long is lighter than any: positions are in "
            "other units than they say, or the mass is wrong; set the attribute units of the positions and "
            "of /body/position"
        )
    ]


def judge_shape(kin: Kinematics, motion: Motion, body: Body, left: float | None = None) -> list[Finding]:
    """What the model leaves of the shape, of markers and of mass that carries none.

    left: chi-square of what the rigid level leaves over that of the best one, where levels were compared:
    all mass then goes with one of them, unless the body is known as a whole and does not stretch as one.
    """
    dof = kin.pose.dof > 0
    if not kin.attitude or not dof.any():
        return []
    if kin.inertia.nodal is None and not (kin.model == "affine" and kin.inertia.affine is not None):
        return judge_whole(kin, motion, left)
    if left is not None:
        return []
    hidden = int(((kin.inertia.weight > 0) & ~kin.seen).sum())
    if kin.model == "affine" and hidden and (body.mode_shape is not None or body.stiffness is not None):
        return [
            Finding(
                f"{hidden} nodes carry mass but no marker, and an affine strain moves them otherwise than "
                "the modes of the file do: force and moment are limited by the model; use --model modal"
            )
        ]
    if len(kin.shapes):
        ratio, size = beyond_shapes(kin, motion)
    else:
        ratio = float(np.nansum(kin.pose.chi_square[dof]) / kin.pose.dof[dof].sum())
        size = float(np.sqrt(np.nanmean(kin.pose.residual[:, kin.seen] ** 2)))
    if ratio < LIMIT:
        return []
    return [
        Finding(
            f"the markers leave the {kin.model} shape by {1e3 * size:.2g} mm rms, chi-square {ratio:.1f} per "
            "degree of freedom: force and moment are limited by the model; use --model auto"
        )
    ]


def judge_whole(kin: Kinematics, motion: Motion, left: float | None) -> list[Finding]:
    """What markers of a body known as a whole do beside the rigid motion: what its mass does is open."""
    ratio, size = beyond_shapes(replace(kin, shapes=kin.shapes[:0]), motion)
    ratio = max(ratio, left or 0.0)
    if ratio < LIMIT:
        return []
    return [
        Finding(
            f"the markers leave the rigid shape by {1e3 * size:.2g} mm rms, chi-square {ratio:.1f} per "
            "degree of freedom, and total mass and inertia do not say where the mass goes: force and moment "
            "are those of a body that keeps its shape, and limited by that; give /body/mass with markers on "
            "it, or mode shapes"
        )
    ]


def judge_common(kin: Kinematics) -> list[Finding]:
    """Markers that agree with each other better than their mass center is found to be known.

    Errors that all markers share move the center and leave the shape alone; only of a rigid body does the
    shape show what is left beside them.
    """
    if len(kin.shapes) or not kin.attitude or not kin.stated.get("position", False):
        return []
    dof = kin.pose.dof > 0
    count = float(kin.pose.dof[dof].sum())
    if not count:
        return []
    ratio = float(np.nansum(kin.pose.chi_square[dof])) / count
    if ratio > min(AGREE, 1 - SURE * np.sqrt(2 / count)):
        return []
    noise = 1e3 * kin.noise["position"]
    return [
        Finding(
            f"the markers agree with each other to {noise * np.sqrt(ratio):.2g} mm, better than the "
            f"{noise:.2g} mm by which their mass center errs: noise_std is too large, or they share slow "
            "errors, which pass for force; look at the calibration of the cameras"
        )
    ]


def beyond_shapes(kin: Kinematics, motion: Motion) -> tuple[float, float]:
    """Chi-square per degree of freedom of what rigid motion and shapes leave of the markers, and its rms m.

    Of the median frame, which a few wild ones do not move.
    """
    assert motion.position is not None
    seen = beyond_rigid(motion.time, motion.position, kin)
    left = null_space(seen.of(kin.shapes), rcond=1e-6)  # (freedom, direction) that no shape moves
    z = (seen.y @ left)[np.isfinite(seen.y).all(1)]
    if not z.size:
        return 0.0, 0.0
    rows = np.repeat(seen.kept, 3)
    beside = np.zeros((rows.size, rows.size)) if kin.beside is None else kin.beside
    along = seen.basis @ left
    cov = seen.var * np.eye(left.shape[1]) + along.T @ beside[np.ix_(rows, rows)] @ along
    chi_square = np.einsum("ti,ti->t", z, np.linalg.solve(cov, z.T).T)
    ratio = float(np.median(chi_square) / chdtri(left.shape[1], 0.5))
    return ratio, float(np.sqrt((z**2).sum(1).mean() / seen.kept.sum() / 3))
