"""Accurate, degraded or refused, and why: every reason one sentence of physics with a next step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from forceid.estimation.kinematics import Kinematics
from forceid.estimation.leakage import Leakage, marker_cov
from forceid.estimation.sensitivity import follows
from forceid.motion.free_turn import WIDE, largest_turn
from forceid.motion.pose import pose_gain
from forceid.motion.window import noise_growth
from forceid.principal.loads import undetermined
from forceid.principal.operator import summation_operator
from forceid.records import Array, Flags, Loads, Motion, Verdict

GROWTH = 2.0  # of the noise seen, from every frame to every second one; white noise keeps its size
FEW = 60  # frames below which correlation of errors cannot be seen
FAST = 0.8 * np.pi  # rad a frame; at pi the sense of the turn is lost
NIS_BAND = (0.6, 1.3)  # mean squared innovation over its covariance
COLOR = 0.2  # autocorrelation of whitened innovations, beyond three standard errors, that is called color
LINE = 15.0  # periodogram ordinate over the mean of its channel: by chance e^-15
MISSED = 3.0  # claimed standard deviations of the load that a line must hide to count
NEARLY_RIGID = 0.1  # sine of its angle with rigid motion below which a shape passes for one
NEARLY_LINE = 10.0  # condition of the markers beyond which a turn is fixed by little
RIGID_LIMIT = 1.3  # chi-square per degree of freedom of the residual shape
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
    if lost.any():
        span = longest_run(lost)
        found.append(
            f"{lost.sum()} of {len(lost)} frames show no pose, the longest run {span} frames: there the "
            "estimate is bridged or missing; expect detail only outside"
        )
    return found


def judge_tuning(kin: Kinematics, noise_at_limit: dict[str, bool]) -> list[Finding]:
    """Noise that nobody stated, and that the record cannot tell from motion: at its floor, or too short."""
    found = []
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
    misfit = float(np.nanmean(loads.chi_square))
    if loads.dof and misfit > chdtri(loads.dof, CHANCE):
        found.append(
            f"the loads leave a part of the wrench unexplained, chi-square {misfit / loads.dof:.1f} per "
            "degree of freedom: other loads act; add them"
        )
    return [Finding(text) for text in found]


def judge_innovations(time: Array, innovation: Array, nis: Array, reach: Array) -> list[Finding]:
    """Whether the innovations (time, channel) are white and as large as they were predicted to be.

    reach (channel,): load, over its claimed standard deviation, that moves a channel by one standard
    deviation of its measurement at 1 rad/s.
    """
    if innovation.shape[1] == 0 or not np.isfinite(nis).any():
        return []
    found = []
    level = float(np.nanmean(nis))
    if not NIS_BAND[0] < level < NIS_BAND[1]:
        meaning = "claimed errors are too small by about that; check noise_std and the model"
        if level < 1:
            meaning = "the tracks are smoother than the noise they are said to have; check noise_std"
        found.append(f"the innovations are {np.sqrt(level):.2f} times as large as predicted: {meaning}")
    color, channel = colored(innovation)
    if color:
        found.append(
            f"the innovations of {channel} are correlated ({color:+.2f} from one frame to the next): "
            "the errors of the markers are not white, or the load changes faster than the prior; "
            "claimed errors are too small"
        )
    line, channel = strongest_line(time, innovation, reach)
    if line:
        found.append(
            f"the innovations of {channel} hold a line at {line:.3g} Hz: a load there, often at the spin or "
            "twice the spin, is followed only in part; take its amplitude as a lower bound"
        )
    return [Finding(text) for text in found]


CHANNELS = ("center x", "center y", "center z", "rotation x", "rotation y", "rotation z")


def colored(innovation: Array) -> tuple[float, str]:
    """Largest lag-one autocorrelation of whitened innovations and its channel, if it is not chance."""
    worst, where = 0.0, ""
    for j, v in enumerate(innovation.T):
        pair = np.isfinite(v[1:]) & np.isfinite(v[:-1])
        if pair.sum() < 20:
            continue
        r = float(np.mean(v[1:][pair] * v[:-1][pair]) / np.mean(v[np.isfinite(v)] ** 2))
        if abs(r) > max(COLOR, 3 / np.sqrt(pair.sum())) and abs(r) > abs(worst):
            worst, where = r, CHANNELS[j]
    return worst, where


def strongest_line(time: Array, innovation: Array, reach: Array) -> tuple[float, str]:
    """Frequency Hz and channel of the line in the innovations that hides most load, zero where none does."""
    most, at, where = MISSED, 0.0, ""
    frequency = np.fft.rfftfreq(len(time), float(np.median(np.diff(time))))[1:-1]
    for j, v in enumerate(np.nan_to_num(innovation).T):
        power = np.abs(np.fft.rfft(v)[1:-1]) ** 2
        if len(power) < 8:
            continue
        k = int(power.argmax())
        hidden = 2 * np.sqrt(power[k]) / len(v) * (2 * np.pi * frequency[k]) ** 2 * reach[j]
        if power[k] > LINE * max(power.mean(), 1e-300) and hidden > most:
            most, at, where = hidden, float(frequency[k]), CHANNELS[j]
    return at, where


def lost_frames(kin: Kinematics, motion: Motion | None = None) -> Flags:
    """Samples (time,) that show no pose, and that nothing bridges.

    Beside gyros and accelerometers, what shows the pose may have a rate of its own: between two of its frames
    none is lost. Nor where both families of sensors read on.
    """
    time, seen = kin.time, np.asarray(np.isfinite(kin.pose.center).all(1))
    if motion is None or (motion.angular_velocity is None and motion.specific_force is None):
        return ~seen
    read = np.ones_like(seen)
    for family in (motion.angular_velocity, motion.specific_force):
        one = np.zeros_like(seen) if family is None else np.asarray(np.isfinite(family).any((1, 2)))
        read &= on_its_clock(time, one)
    return np.asarray(~(on_its_clock(time, seen) | read))


def on_its_clock(time: Array, seen: Flags) -> Flags:
    """Samples (time,) that are seen, or no farther from one seen than it usually is to the next.

    >>> on_its_clock(np.arange(9.0), np.array([1, 0, 1, 0, 1, 0, 0, 0, 1], bool)).astype(int)
    array([1, 1, 1, 1, 1, 0, 0, 0, 1])
    """
    at = time[seen]
    if len(at) < 2:
        return seen
    k = np.searchsorted(at, time, "right")
    before, after = np.append(-np.inf, at)[k], np.append(at, np.inf)[k]
    gap = np.where(
        np.isfinite(before) & np.isfinite(after), after - before, np.minimum(time - before, after - time)
    )
    return np.asarray(seen | (gap < WIDE * np.median(np.diff(at))))


def longest_run(flag: Flags) -> int:
    """Length of the longest run of true entries.

    >>> longest_run(np.array([0, 1, 1, 0, 1], bool))
    2
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flag.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))
