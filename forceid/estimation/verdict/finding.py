"""Accurate, degraded or refused, and why: every reason one sentence of physics with a next step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.leakage import Leakage
from forceid.estimation.verdict.measured_pose import judge_measured_pose
from forceid.estimation.verdict.sampling import judge_times
from forceid.estimation.verdict.tracks import lost_frames
from forceid.estimation.verdict.turns import told_by_moment
from forceid.flight.instruments import INSTRUMENTS
from forceid.kalman.tuning.robust import runs
from forceid.motion import largest_turn, noise_growth
from forceid.records import Finding, Level, Motion, Verdict, all_finite

GROWTH = 2.0  # of the noise seen, from every frame to every second one; white noise keeps its size
FEW = 20  # frames below which nothing is told apart: no level of deformation, no band of a spectrum
SHORT = 50  # frames below which they cannot tell how a load varies, nor whether errors are correlated
BRIDGED, SCATTERED = 5, 0.1  # frames lost in a row, and part of all frames, that the claim accounts for
FAST = 0.8 * np.pi  # rad a frame; at pi the sense of the turn is lost
NEARLY_RIGID = 0.15  # sine of its angle with rigid motion below which a shape passes for one


LEVELS: tuple[Level, ...] = ("ok", "degraded", "refused")


def judge(findings: Sequence[Finding]) -> Verdict:
    """The verdict that findings add up to: that of the worst."""
    worst = max((LEVELS.index(f.level) for f in findings), default=0)
    return Verdict(LEVELS[worst], tuple(findings))


def refusing(findings: Sequence[Finding]) -> bool:
    """Whether a finding leaves no estimate."""
    return any(f.level == "refused" for f in findings)


def judge_recording(kin: Kinematics, motion: Motion | None = None) -> list[Finding]:
    """What the recording alone does not allow; motion: where sensors may read beside what shows a pose."""
    if not np.isfinite(kin.pose.center).any():
        return [note("no-mass-center")]
    found = [*known_beforehand(kin), *unobserved_motions(kin, motion), *judge_times(kin)]
    if motion is not None:
        found += judge_measured_pose(kin, motion)
    turn = largest_turn(kin.time, kin.pose.rotation)
    if turn > FAST and not (motion is not None and reads_turn(kin, motion)):
        step = float(np.median(np.diff(kin.time[np.isfinite(kin.pose.rotation).all((1, 2))])))
        taken, other = turn / (2 * np.pi * step), (2 * np.pi - turn) / (2 * np.pi * step)
        level: Level = "ok" if told_by_moment(kin) else "degraded"
        found.append(
            note("fast-turn", level, degrees=np.degrees(turn), rev_per_s=taken, other_rev_per_s=other)
        )
    return found


def judge_rounding(kin: Kinematics) -> list[Finding]:
    """Coordinates on a grid so coarse that its steps, and not the noise, are their error."""
    if kin.markers is None:
        return []
    step, noise = kin.markers.grid, kin.noise["position"]
    if step / np.sqrt(12) < noise:
        return []
    return [note("rounded-coordinates", step_mm=1e3 * step, noise_mm=1e3 * noise)]


def reads_turn(kin: Kinematics, motion: Motion) -> bool:
    """Whether a gyro of three axes reads, or between frames what reads how the body stands."""
    between = ~np.isfinite(kin.pose.rotation).all((1, 2))
    rate, nothing = motion.angular_velocity, np.zeros(0)
    standing = [motion.readings.get(one.name, nothing) for one in INSTRUMENTS if not one.tells]
    return (rate is not None and bool(all_finite(rate).any())) or any(
        len(read) > 0 and bool(np.isfinite(read[between]).any()) for read in standing
    )


def known_beforehand(kin: Kinematics) -> list[Finding]:
    """Components of the moment that the mass distribution alone settles."""
    if kin.inertia.point:
        return [note("mass-on-point")]
    if kin.inertia.line is None or not kin.attitude or (kin.spin is not None and kin.spin.moment.any()):
        return []
    return [note("mass-on-line")]


def unobserved_motions(kin: Kinematics, motion: Motion | None = None) -> list[Finding]:
    """Motions that the markers do not show."""
    found = []
    marked = int(kin.seen.sum())
    if kin.inertia.point:
        pass
    elif not kin.attitude and kin.inertia.on_line and marked:
        found.append(note("line-direction-unseen"))
    elif not kin.attitude and np.isfinite(kin.pose.rotation).any():
        found.append(note("no-inertia"))
    elif not kin.attitude and marked == 0:
        found.append(note("no-orientation"))
    elif not kin.attitude and marked == 1:
        found.append(note("one-marker"))
    elif not kin.attitude:
        found.append(note("markers-on-line", count=marked))
    thin = kin.inertia.point or kin.inertia.line is not None
    if thin and motion is not None and any(one.name in motion.readings for one in INSTRUMENTS):
        found.append(note("sensors-left-out"))
    hidden = int(kin.unfollowed.sum())
    if marked and hidden and len(kin.shapes):
        found.append(note("unmarked-mass", count=hidden))
    lost = lost_frames(kin, motion)
    span = max((length for _, length in runs(lost)), default=0)
    if span > BRIDGED or lost.mean() > SCATTERED:
        found.append(note("frames-lost", lost=lost.sum(), frames=len(lost), longest=span))
    return found


def judge_tuning(kin: Kinematics, noise_at_limit: dict[str, bool]) -> list[Finding]:
    """Noise that nobody stated, and that the record cannot tell from motion: at its floor, or too short."""
    found = []
    if len(kin.time) < SHORT:
        found.append(note("few-frames", frames=len(kin.time)))
    for name, limit in noise_at_limit.items():
        if kin.stated[name]:
            continue
        if limit:
            found.append(note("noise-at-floor", variable=name, noise=kin.noise[name]))
        elif (growth := noise_growth(kin.time, kin.pose.center)) > GROWTH:
            found.append(note("noise-unresolved", variable=name, growth=growth))
        elif len(kin.time) < SHORT:
            found.append(note("noise-color-unseen", variable=name, frames=len(kin.time)))
    return found


def judge_leakage(found: Leakage | None) -> list[Finding]:
    """Shapes that look like rigid motion from where the markers are."""
    if found is None:
        return []
    said = []
    for k in np.flatnonzero(found.sine < NEARLY_RIGID):
        part = found.to_rigid[k]
        said.append(note("shape-looks-rigid", shape=found.name[k], sine=found.sine[k], percent=part))
    return said
