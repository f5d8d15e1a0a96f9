"""Accurate, degraded or refused, and why: every reason one sentence of physics with a next step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from forceid.estimation.kinematics import Kinematics
from forceid.estimation.leakage import Leakage, marker_cov
from forceid.estimation.lost_frames import longest_run, lost_frames
from forceid.estimation.sensitivity import follows
from forceid.motion.free_turn import largest_turn
from forceid.motion.pose import pose_gain
from forceid.motion.window import noise_growth
from forceid.principal.loads import undetermined
from forceid.principal.operator import summation_operator
from forceid.records import Array, Body, Loads, Motion, Verdict

GROWTH = 2.0  # of the noise seen, from every frame to every second one; white noise keeps its size
FEW = 60  # frames below which correlation of errors cannot be seen
SHORT = 50  # frames below which they cannot tell how a load varies
BRIDGED, SCATTERED = 5, 0.1  # frames lost in a row, and part of all frames, that the claim accounts for
ELSEWHERE = 0.05  # of the size of a body, by which a mean shape may leave its reference
FAST = 0.8 * np.pi  # rad a frame; at pi the sense of the turn is lost
NEARLY_RIGID = 0.1  # sine of its angle with rigid motion below which a shape passes for one
NEARLY_LINE = 10.0  # condition of the markers beyond which a turn is fixed by little
RIGID_LIMIT = 1.3  # chi-square per degree of freedom of the residual shape
SPLIT = 0.06  # size of the errors of what loads do together, over that of each: below, they are alike
COARSE, KICK = 0.5, 0.05  # rad a frame; part of its angular momentum that a moment may add to a spin in each
CHANCE = 1e-4  # of a misfit this large where the loads asked for are the ones that act


@dataclass(frozen=True)
class Finding:
    """One sentence, and whether it costs the verdict `ok` or everything."""

    text: str
    refuses: bool = False


def judge(findings: list[Finding]) -> Verdict:
    """The verdict that findings add up to.

    >>> judge([Finding("the markers lie on a line")]).level
    'degraded'
    """
    level = "refused" if any(f.refuses for f in findings) else "degraded" if findings else "ok"
    return Verdict(level, tuple(f.text for f in findings))  # type: ignore[arg-type]


def judge_recording(kin: Kinematics, motion: Motion | None = None) -> list[Finding]:
    """What the recording alone does not allow, before any force is computed.

    motion: where it may hold gyros and accelerometers beside what shows a pose.
    """
    if not np.isfinite(kin.pose.center).any():
        text = "no frame shows the mass center: the markers seen do not span it; mark every node with mass"
        return [Finding(text, refuses=True)]
    found = [Finding(text) for text in unseen(kin, motion)]
    turn = largest_turn(kin.time, kin.pose.rotation)
    if turn > FAST and not (motion is not None and reads_turn(motion)):
        step = float(np.median(np.diff(kin.time[np.isfinite(kin.pose.rotation).all((1, 2))])))
        taken, other = turn / (2 * np.pi * step), (2 * np.pi - turn) / (2 * np.pi * step)
        text = (
            f"the body turns {np.degrees(turn):.0f} degrees between frames, near or past the half turn at "
            f"which the sense and number of turns are lost: what is read as {taken:.3g} rev/s may be "
            f"{other:.3g} rev/s the other way; record faster or add a gyro"
        )
        found.append(Finding(text))
    return found


def reads_turn(motion: Motion) -> bool:
    """Whether a gyro of three axes reads."""
    return motion.angular_velocity is not None and bool(np.isfinite(motion.angular_velocity).all(2).any())


def unseen(kin: Kinematics, motion: Motion | None = None) -> list[str]:
    """Sentences on motions that the markers do not show."""
    found = []
    marked = int(kin.seen.sum())
    if not kin.attitude and np.isfinite(kin.pose.rotation).any():
        found.append("the inertia tensor is not given: force only; add /body/inertia for the moment")
    elif not kin.attitude and marked == 0:
        found.append("no orientation was measured: force only; add /motion/orientation for the moment")
    elif not kin.attitude and marked == 1:
        found.append("one marker is a particle: rotation and moment are not seen; add two markers off a line")
    elif not kin.attitude:
        found.append(
            f"the {marked} markers lie on a line, and a turn about it is not seen: force only; "
            "add a marker off the line"
        )
    hidden = int(kin.unfollowed.sum())
    if marked and hidden and len(kin.shapes):
        found.append(
            f"{hidden} nodes carry mass but no marker, and the body deforms: their share of force and moment "
            "is that of the undeformed shape; mark them, or give mode shapes"
        )
    lost = lost_frames(kin, motion)
    if (span := longest_run(lost)) > BRIDGED or lost.mean() > SCATTERED:
        found.append(
            f"{lost.sum()} of {len(lost)} frames show no pose, the longest run {span} frames: there the "
            "estimate is bridged or missing; expect detail only outside"
        )
    return found


def judge_tuning(kin: Kinematics, noise_at_limit: dict[str, bool]) -> list[Finding]:
    """Noise that nobody stated, and that the record cannot tell from motion: at its floor, or too short."""
    found = []
    if len(kin.time) < SHORT:
        found.append(
            f"{len(kin.time)} frames are too few to tell how force and moment vary: claimed errors may be "
            "too small by a factor of two; record longer"
        )
    for name, limit in noise_at_limit.items():
        if kin.stated[name]:
            continue
        if limit:
            found.append(
                f"the likelihood drove the noise of {name} to its floor ({kin.noise[name]:.1e}): the record "
                "was smoothed before, or its errors are not white, and the claimed errors are too small; "
                f"state noise_std.{name}"
            )
        elif (growth := noise_growth(kin.time, kin.pose.center)) > GROWTH:
            found.append(
                f"the noise of {name} was not stated, and the record does not resolve it: it looks "
                f"{growth:.1f} times larger in every second frame; claimed errors are too small; "
                f"state noise_std.{name}, or record faster"
            )
        elif len(kin.time) < FEW:
            found.append(
                f"{len(kin.time)} frames are too few to tell whether the errors of {name} are white, as the "
                f"claimed errors assume; state noise_std.{name}, or record longer"
            )
    return [Finding(text) for text in found]


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


def judge_shape(kin: Kinematics) -> list[Finding]:
    """A residual shape that the model chosen leaves unexplained."""
    dof = kin.pose.dof > 0
    if not kin.attitude or not dof.any():
        return []
    ratio = float(np.nansum(kin.pose.chi_square[dof]) / kin.pose.dof[dof].sum())
    if len(kin.shapes) or ratio < RIGID_LIMIT:
        return []
    size = np.sqrt(np.nanmean(kin.pose.residual[:, kin.seen] ** 2)) * 1e3
    return [
        Finding(
            f"the markers leave the rigid shape by {size:.2g} mm rms, chi-square {ratio:.1f} per degree of "
            "freedom: the moment is limited by the model; use --model auto"
        )
    ]


def judge_leakage(found: Leakage | None) -> list[Finding]:
    """Markers that barely fix a turn, and shapes that look like rigid motion from where the markers are."""
    if found is None:
        return []
    texts = []
    if NEARLY_LINE < found.condition < np.inf:
        texts.append(
            f"the markers lie almost on a line, condition {found.condition:.0f}: 1 mm of noise turns the "
            f"body by {found.rotation_sigma.max():.2g} degrees; add a marker off the line"
        )
    for k in np.flatnonzero(found.sine < NEARLY_RIGID):
        texts.append(
            f"{found.name[k]} moves the markers almost as a rigid motion does, sine of the angle "
            f"{found.sine[k]:.2g}: {found.to_rigid[k]:.2g} % of it is taken for rigid motion, and force and "
            "moment trade with it; spread the markers, or add strain gauges"
        )
    return [Finding(text) for text in texts]


def judge_overlap(
    kin: Kinematics, amplitude: Array, tuned: dict[str, float], force_std: Array
) -> list[Finding]:
    """Shapes that vibrate inside the band of the force, and leak into it by more than is claimed.

    amplitude (time, shape) m, smoothed; force_std (time, 3) N. What a shape moves the fitted center by, times
    the mass and the square of its frequency, is a force that does not act.
    """
    band = follows(kin, tuned, "force")
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
        Finding(
            f"shape {k + 1} of the deformation vibrates at {at[k] / (2 * np.pi):.3g} Hz, inside the band of "
            f"the force, followed up to {band:.2g} Hz, and leaks into the mean motion: up to "
            f"{false[k]:.2g} N may be vibration and not load; mark the nodes that carry the mass, or give "
            "mode shapes"
        )
        for k in range(len(kin.shapes))
        if at[k] < 2 * np.pi * band and false[k] > claimed
    ]


def judge_loads(loads: Loads | None) -> list[Finding]:
    """Loads that the motion cannot tell apart, and a wrench that the pattern of loads does not explain."""
    if loads is None or not np.isfinite(loads.load).any():
        return []
    found = []
    if hidden := undetermined(loads):
        found.append(
            f"the loads {', '.join(hidden)} are determined in combination only, and their split is the one "
            "of least norm; read null_space and estimable, or ask for fewer loads"
        )
    else:
        found += alike(loads)
    misfit = float(np.nanmean(loads.chi_square))
    if loads.dof and misfit > chdtri(loads.dof, CHANCE):
        found.append(
            f"the loads leave a part of the wrench unexplained, chi-square {misfit / loads.dof:.1f} per "
            "degree of freedom: other loads act; add them"
        )
    return [Finding(text) for text in found]


def alike(loads: Loads) -> list[str]:
    """Loads whose errors are all but opposite, since they do all but the same to the body."""
    var = np.diagonal(loads.load_cov, axis1=1, axis2=2)
    known = np.isfinite(loads.load_cov).all((1, 2)) & (var > 0).all(1)
    if not known.any():
        return []
    size = np.sqrt(var[known])
    least, axes = np.linalg.eigh((loads.load_cov[known] / (size[:, :, None] * size[:, None])).mean(0))
    if least[0] > SPLIT**2:
        return []
    pair = [loads.name[k] for k in np.argsort(-np.abs(axes[:, 0])) if abs(axes[k, 0]) > SPLIT]
    return [
        f"the loads {', '.join(pair)} do nearly the same to the body: their split is known "
        f"{1 / np.sqrt(least[0]):.0f} times worse than what they do together; ask for fewer loads"
    ]


def judge_momentum(kin: Kinematics, H: Array, moment: Array) -> list[Finding]:
    """Turns that a moment as large as no other would have to make: what an aliased spin reads as."""
    turn, step = largest_turn(kin.time, kin.pose.rotation), float(np.median(np.diff(kin.time)))
    size, kick = (np.linalg.norm(v, axis=1) for v in (H, moment * step))
    known = np.isfinite(size) & np.isfinite(kick)
    if turn < COARSE or not known.any() or np.median(kick[known]) < KICK * np.median(size[known]):
        return []
    return [
        Finding(
            f"the body turns up to {np.degrees(turn):.0f} degrees a frame, and the moment found changes its "
            f"angular momentum by {np.median(kick[known]) / np.median(size[known]):.0%} in each: as turns "
            "past half a revolution do that are taken for shorter ones; record faster or add a gyro"
        )
    ]
