"""A person in rigid parts on two feet: what the ground gives a foot is told by the rule."""

import numpy as np
import pytest

from evidence.drawn.records.person import MASS, TABLE, Skin
from evidence.drawn.records.walker import walker
from forceid.config import load_settings
from forceid.errors import ConfigError
from forceid.estimation.joints.parts import parts_of
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

STILL = Skin(shared=0.0, own=0.0, white=2e-4)
INNER = slice(30, -30)
LEGS = [f"{side} {name}" for side in ("left", "right") for name in ("thigh", "shank", "foot")]


def in_parts(recording, **foot):
    """Markers as nodes, every segment a part of the table, and joints where markers are."""
    body, motion, names = recording.body, recording.motion, list(TABLE)
    shape, owner = body.marker_shape, (body.marker_segment / 2).astype(int)
    first = {name: int(np.argmax(owner == k)) for k, name in enumerate(names)}
    hips = {"left thigh": first["pelvis"] + 4, "right thigh": first["pelvis"] + 5}
    arms = {"left arm": first["trunk"] + 4, "right arm": first["trunk"] + 5}
    near = {name: (hips | arms).get(name, first[on] if on else -1) for name, (on, *_) in TABLE.items()}
    parts, joints = [], []
    for k, (name, (on, _, part, center, gyration)) in enumerate(TABLE.items()):
        begin = shape[near[name]] if on else shape[[hips["left thigh"], hips["right thigh"]]].mean(0)
        rod = shape[first[name]] - begin
        mass, radius = part * MASS, gyration * np.linalg.norm(rod)
        along = rod / np.linalg.norm(rod)
        J = mass * radius**2 * (np.eye(3) - 0.99 * np.outer(along, along))  # hardly any about its line
        parts.append({
            "name": name, "nodes": np.flatnonzero(owner == k).tolist(), "mass": mass, "inertia": J.tolist(),
            "center": (begin + center * rod).tolist(), "rigid": True,
        })  # fmt: skip
        if on:
            joints.append({
                "name": f"{on} to {name}", "parts": (on, name), "at": begin.tolist(), "kind": "ball",
                "driven": True,
            })  # fmt: skip
    whole = Body(body.marker, shape, mass=np.full(len(shape), MASS / len(shape)))
    markers = Recording(whole, Motion(motion.time, motion.marker_position, gravity=motion.gravity))
    settings = load_settings(part=parts, joint=joints, model="rigid", internal_momentum=(0, 0, 0), **foot)
    return markers, settings


def feet(markers):
    return [{"name": f"{s}_foot", "nodes": [n for n in markers.body.node if n.startswith(f"{s} foot")]}
            for s in ("left", "right")]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("task", ["walk", "squat"])
def test_joint_loads_of_a_person_in_parts_err_by_what_they_claim(task):
    recording = walker(7, task, 3.0, STILL)
    markers, settings = in_parts(recording)
    settings = settings.model_copy(update={"foot": load_settings(foot=feet(markers)).foot})
    found = estimate_recording(markers, settings).interface
    assert found.determined.all()
    for name in LEGS:
        k = next(k for k, joint in enumerate(found.name) if joint.endswith(f"to {name}"))
        j = next(j for j, joint in enumerate(recording.body.joint) if joint.endswith(f"to {name}"))
        error = (found.force[:, k] - recording.truth["joint_force"][:, j])[INNER]
        claim = found.force_std[INNER, k]
        assert np.sqrt((error**2).mean()) < 1.5 * np.sqrt((claim**2).mean()), name


def test_a_foot_of_parts_is_of_one_that_has_no_load_to_be_found():
    recording = walker(7, "squat", 1.0, STILL)
    markers, settings = in_parts(recording)
    told = load_settings(foot=feet(markers)).foot
    loaded = [p.model_copy(update={"external": p.name == "left foot"}) for p in settings.part]
    shared = [told[0].model_copy(update={"nodes": ("left foot 0", "left shank 0")}), told[1]]
    for update in ({"part": tuple(loaded), "foot": told}, {"foot": tuple(shared)}):
        with pytest.raises(ConfigError, match="its nodes are not of one part"):
            parts_of(markers, settings.model_copy(update=update))
