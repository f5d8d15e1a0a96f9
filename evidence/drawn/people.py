"""Persons whose markers stay on segments: force and moment beside the best low-pass, claims, and time.

    python -m evidence.drawn.people -o FOLDER [--seeds 8]

Drawn by `evidence.drawn.records.person`, estimated with model = "segments", whose claims have the errors that
joint gaps show. The Butterworth filter has the cut that is best on the truth, by axis, and is told beside the
6 Hz one. By kind of motion: the geometric mean over persons and axes; error over claim: rms over rms.
Then what passes the joints of persons who stand on two feet, beside the textbook's inverse dynamics.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from evidence.drawn.records.person import JOINT_OFF, Skin, person
from evidence.drawn.records.scored import low_passed
from evidence.drawn.records.walker import FEET, hung_on, walker
from evidence.judged import LOADS, scores, silently_wrong
from evidence.written import asked, each, paged, table
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Array, KnownLoads, Recording

TASKS = "walk", "run", "squat", "jump"
EDGE_FRAMES = 20  # frames at either end that are not judged
ABOUT = """\
Persons of 12 segments and 52 markers, 5 s at 100 Hz, on whose bones skin and mass tables err; {seeds} a kind
of motion, tracks raw or low-passed at 12 or 6 Hz; `model = "segments"`. Of the force, then of the moment:
the error over that of the best Butterworth filter, its cut chosen on the truth by axis, and over that of one
of 6 Hz. These are geometric means over persons and axes. Then error over claim of all pooled, and the most of
it. {silent} are [silently wrong](calibration.md), and the slowest takes {cpu:.2f} s of CPU a second.

{rows}

## Joints

Persons who walk on two feet or squat on them, {seeds} each; `joint_loads = true`. Rms of the moment about a
joint (N m, all axes), rms of its error, and error over claim. Without plates a rule shares the ground between
two feet that stand. The textbook's inverse dynamics take the plates, and tracks through a Butterworth filter
of 6 Hz. Joints are 15 mm off (each axis), as `body_std.joint` says."""
KINDS_OF_JOINT = {"thigh": "hip", "shank": "knee", "foot": "ankle"}
STOOD = [{"name": f"{s}_foot", "nodes": [f"{s} foot near", f"{s} foot far"]} for s in ("left", "right")]


def off(values: Array) -> Array:
    """Rms (axis,) without the ends."""
    return np.asarray(np.sqrt((values[EDGE_FRAMES:-EDGE_FRAMES] ** 2).mean(0)))


def kind_rows(kind: tuple[str, float], seeds: int) -> list[dict[str, Any]]:
    """Force and moment of one kind of motion."""
    task, cut = kind
    found: dict[str, list[Array]] = {"force": [], "moment": []}
    spent, ok, silent = 0.0, 0, []
    for seed in range(seeds):
        recording, began = person(seed, task, skin=Skin(cut=cut)), process_time()
        estimate = estimate_recording(recording, load_settings(model="segments"))
        spent = max(spent, (process_time() - began) / float(np.ptp(recording.motion.time)))
        of = scores(estimate, [recording.truth[load] for load in LOADS])
        ok += estimate.verdict.level == "ok"
        silent.append(silently_wrong(estimate.verdict.level, of["over"], of["beside"]))
        rivals = [low_passed(recording, hertz) for hertz in np.arange(1.5, 25.0, 0.5)]
        six = low_passed(recording, 6.0)
        for load, rows in found.items():
            truth, std = recording.truth[load], getattr(estimate, f"{load}_std")
            best = np.min([off(rival[load] - truth) for rival in rivals], axis=0)
            rows.append(
                np.array([off(getattr(estimate, load) - truth), best, off(six[load] - truth), off(std)])
            )
    said = {"ok": f"{ok}/{seeds}", "silent": sum(silent), "cpu": spent}
    numbers = [f"{key}{end}" for end in ("", " ") for key in ("best cut", "6 Hz", "claim", "most")]
    both = np.concatenate([of_load(np.array(rows)) for rows in found.values()])
    first = {"motion": task, "tracks": f"{cut:g} Hz" if cut else "raw"}
    return [first | dict(zip(numbers, both.tolist(), strict=True)) | said]


def of_load(rows: Array) -> Array:
    """Numbers of the table on one load; rows (seed, kind of error, axis)."""
    error, best, six, claim = np.moveaxis(rows, 1, 0)
    over = [float(np.exp(np.log(error / rival).mean())) for rival in (best, six)]
    return np.array([*over, np.sqrt((error**2 / (claim**2).mean(0)).mean()), (error / claim).max()])


def on_plates(recording: Recording) -> Recording:
    """The recording with what the ground gives each foot, as plates measure it: where it presses, and how."""
    wrench, center = recording.truth["foot_wrench"], recording.truth["center"]
    F, push = wrench[..., :3], np.where(wrench[..., 2] > 1.0, wrench[..., 2], np.inf)[..., None]
    about = wrench[..., 3:] + np.cross(center[:, None], F)  # about the origin, on the ground
    none = np.zeros_like(push)
    point = np.concatenate([-about[..., 1:2] / push, about[..., :1] / push, none], 2)
    names = tuple(foot["name"] for foot in STOOD)
    loads = KnownLoads(recording.motion.time, names, F, about - np.cross(point, F), point=point)
    return replace(recording, known_loads=loads)


def textbook(recording: Recording, point: Array) -> Array:
    """Moments (time, joint, 3) about points (time, joint, 3) m, from filtered tracks and the plates."""
    body, motion, wrench = recording.body, recording.motion, recording.truth["foot_wrench"]
    assert body.mass is not None
    assert motion.position is not None
    rate = (len(motion.time) - 1) / float(np.ptp(motion.time))
    x = sosfiltfilt(butter(2, 6.0, fs=rate, output="sos"), motion.position, axis=0)
    pull = body.mass[:, None] * (CubicSpline(motion.time, x)(motion.time, 2) - motion.gravity)
    center = np.einsum("n,tna->ta", body.mass / body.mass.sum(), motion.position)
    found = []
    for j, joint in enumerate(body.joint):
        behind = hung_on(joint.split(" to ")[1])
        own = [k for k, node in enumerate(body.node) if node.rsplit(" ", 1)[0] in behind]
        M = np.cross(x[:, own] - point[:, j, None], pull[:, own]).sum(1)
        for k, foot in enumerate(FEET):
            if foot in behind:
                M = M - wrench[:, k, 3:] - np.cross(center - point[:, j], wrench[:, k, :3])
        found.append(M)
    return np.stack(found, 1)


def joint_rows(kind: tuple[str, float], seeds: int) -> list[dict[str, Any]]:
    """What passes the joints of one kind of motion, by kind of joint."""
    task, cut = kind
    found: dict[str, list[Array]] = {name: [] for name in KINDS_OF_JOINT}
    settings = load_settings(model="segments", joint_loads=True, foot=STOOD, body_std={"joint": JOINT_OFF})
    for seed in range(seeds):
        recording = walker(seed, task, skin=Skin(cut=cut))
        both = [estimate_recording(one, settings).interface for one in (recording, on_plates(recording))]
        truth = recording.truth
        assert both[0] is not None
        assert both[1] is not None
        by_book = textbook(recording, both[0].point) - truth["joint_moment"]
        for j, joint in enumerate(recording.body.joint):
            numbers = [rms(truth["joint_moment"][:, j]), rms(by_book[:, j])]
            for one in both:
                assert one is not None
                numbers += [rms(a[:, j]) for a in (one.moment - truth["joint_moment"], one.moment_std)]
            if (kind_of := joint.split()[-1]) in found:
                found[kind_of].append(np.array(numbers))
    rows = []
    for name, each_joint in found.items():
        true, book, *ours = np.sqrt(np.mean(np.square(each_joint), axis=0))
        alone, plated = ours[:2], ours[2:]
        rows.append({
            "motion": task, "joint": KINDS_OF_JOINT[name], "moment": true, "error": alone[0],
            "claim": alone[0] / alone[1], "on plates": plated[0], "claim ": plated[0] / plated[1],
            "textbook": book,
        })  # fmt: skip
    return rows


def rms(values: Array) -> float:
    """Rms of all axes together, without the ends."""
    return float(np.sqrt((values[EDGE_FRAMES:-EDGE_FRAMES] ** 2).mean()))


def main() -> None:
    """Draw, estimate, and write the table."""
    given = asked("evidence.drawn.people", __doc__, seeds=8)
    kinds = [(task, cut) for task in TASKS for cut in (0.0, 12.0, 6.0)]
    rows = [row for rows in each(partial(kind_rows, seeds=given.seeds), kinds, 1) for row in rows]
    on_feet = partial(joint_rows, seeds=given.seeds)
    joints = [row for rows in each(on_feet, [("walk", 0.0), ("squat", 0.0)], 1) for row in rows]
    silent, cpu = sum(row.pop("silent") for row in rows), max(row.pop("cpu") for row in rows)
    about = ABOUT.format(seeds=given.seeds, rows=table(rows), silent=silent, cpu=cpu)
    paged(given.output, "people", "People in segments", f"`{given.command}`", about, table(joints))


if __name__ == "__main__":
    main()
