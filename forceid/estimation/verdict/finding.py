"""Accurate, degraded or refused, and why: every reason one sentence of physics with a next step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.estimation.body.gaps import longest_run, lost_frames
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.leakage import Leakage
from forceid.motion.free_turn import largest_turn
from forceid.motion.noise_axes import at_rest
from forceid.motion.window import noise_growth
from forceid.records import Motion, Verdict

GROWTH = 2.0  # of the noise seen, from every frame to every second one; white noise keeps its size
FEW = 60  # frames below which correlation of errors cannot be seen
STUCK, STUCK_PART = 5, 0.002  # samples, and part of them, at one edge that chance does not bring there
GRID = 2000  # frames looked at for it
SHORT = 50  # frames below which they cannot tell how a load varies
BRIDGED, SCATTERED = 5, 0.1  # frames lost in a row, and part of all frames, that the claim accounts for
FAST = 0.8 * np.pi  # rad a frame; at pi the sense of the turn is lost
NEARLY_RIGID = 0.15  # sine of its angle with rigid motion below which a shape passes for one
NEARLY_LINE = 10.0  # condition of the markers beyond which a turn is fixed by little


@dataclass(frozen=True)
class Finding:
    """One sentence, and whether it costs everything, or the verdict `ok`, or nothing."""

    text: str
    refuses: bool = False
    costs: bool = True


def judge(findings: list[Finding]) -> Verdict:
    """The verdict that findings add up to.

    >>> judge([Finding("the markers lie on a line")]).level
    'degraded'
    """
    costly = any(f.costs for f in findings)
    level = "refused" if any(f.refuses for f in findings) else "degraded" if costly else "ok"
    return Verdict(level, tuple(f.text for f in findings))  # type: ignore[arg-type]


def judge_recording(kin: Kinematics, motion: Motion | None = None) -> list[Finding]:
    """What the recording alone does not allow, before any force is computed.

    motion: where it may hold gyros and accelerometers beside what shows a pose.
    """
    if not np.isfinite(kin.pose.center).any():
        text = (
            "no frame shows the mass center, and so no force and no moment: the markers seen do not span it; "
            "mark every node with mass, or add markers off their line"
        )
        return [Finding(text, refuses=True)]
    found = [Finding(text, costs=False) for text in known_beforehand(kin)]
    found += [Finding(text) for text in unseen(kin, motion)]
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


def judge_rounding(motion: Motion, noise: dict[str, float]) -> list[Finding]:
    """Coordinates on a grid so coarse that its steps, and not the noise, are their error."""
    if motion.position is None or "position" not in noise:
        return []
    x = motion.position[:: max(1, len(motion.position) // GRID)]
    values = np.unique(x[np.isfinite(x)])
    step = float(np.diff(values).min(initial=np.inf)) if len(values) > 1 else 0.0
    if step / np.sqrt(12) < noise["position"] or len(values) > 0.5 * x.size:
        return []
    return [
        Finding(
            f"coordinates are rounded to steps of {1e3 * step:.2g} mm, more than their noise of "
            f"{1e3 * noise['position']:.2g} mm: errors follow the motion, and force and moment with them; "
            "export more digits"
        )
    ]


def judge_clipping(motion: Motion) -> list[Finding]:
    """Markers that stick to the edge of what the cameras see: one value, again and again, never passed."""
    if motion.position is None:
        return []
    x, rest = motion.position, at_rest(motion.position)
    for axis, name in enumerate("xyz"):
        values = x[..., axis]
        for edge in (np.nanmin(values), np.nanmax(values)):
            stuck = (values == edge) & ~rest[:, axis]
            if stuck.sum() > max(STUCK, STUCK_PART * np.isfinite(values).sum()):
                frames = int(stuck.any(1).sum())
                return [
                    Finding(
                        f"markers stick at {name} = {edge:.4g} m in {frames} of {len(x)} frames, the edge of "
                        "the volume or of a limit: they were not there, and pull the pose with them; write "
                        "NaN in these frames"
                    )
                ]
    return []


def reads_turn(motion: Motion) -> bool:
    """Whether a gyro of three axes reads."""
    return motion.angular_velocity is not None and bool(np.isfinite(motion.angular_velocity).all(2).any())


def known_beforehand(kin: Kinematics) -> list[str]:
    """Sentences on components of the moment that the mass distribution alone settles."""
    if kin.inertia.point:
        return ["all mass lies on a point: no moment acts about it, and the moment is zero by construction"]
    if kin.inertia.line is None or not kin.attitude or (kin.spin is not None and kin.spin.moment.any()):
        return []
    return [
        "all mass lies on a line: no moment acts along it, and that component is zero by construction; the "
        "two across follow from the direction of the line"
    ]


def unseen(kin: Kinematics, motion: Motion | None = None) -> list[str]:
    """Sentences on motions that the markers do not show."""
    found = []
    marked = int(kin.seen.sum())
    if kin.inertia.point:
        pass
    elif not kin.attitude and kin.inertia.on_line and marked:
        found.append(
            "the mass lies on a line whose direction no marker shows: the moment is not seen, force only; "
            "mark a second point of that line"
        )
    elif not kin.attitude and np.isfinite(kin.pose.rotation).any():
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
    thin = kin.inertia.point or kin.inertia.line is not None
    if thin and motion is not None and (reads_turn(motion) or motion.specific_force is not None):
        found.append(
            "gyros and accelerometers are left out: of a body whose mass lies near a line or on a point they "
            "do not go together with markers; take the markers out to see what the sensors say"
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
