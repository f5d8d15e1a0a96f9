"""Joint centers and ends of segments of a person from landmarks, frame by frame.

A joint between two markers is midway. Hips follow from the pelvis by the regression of Harrington et al.,
J. Biomechanics 40 (2007) 595; a shoulder is below its acromion by a part of the distance between both (Rab et
al., Gait and Posture 15 (2002) 119). A knee or an ankle with a lateral marker alone is half its breadth
inward, at right angles to the line to the joint above. What no marker shows lies ahead on a line, by lengths
of de Leva.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from forceid.files.formats.bodies.tables import SIDES
from forceid.records import Array

# mm: constants, and slopes by depth (backward) or width of the pelvis
HIP_BACK = (9.9, 0.24)
HIP_DOWN = (10.9, 0.30)
HIP_OUT = (7.3, 0.33)
BELOW_ACROMION = 0.17  # of the distance between both
# parts of the height of a person: lengths of de Leva 1996, table 4, mean of both sexes; breadths of adults
HEAD_LENGTH = 0.140  # from the seventh cervical vertebra to the vertex
FOOT_LENGTH = 0.140  # from the heel to the tip of the toes
HAND_LENGTH = 0.047  # from the wrist to the third knuckle
HALF_BREADTH = {"knee": 0.027, "ankle": 0.020}  # from a lateral marker to the center
ABOVE_SHOULDERS = 1.2  # lengths from the hips: the seventh cervical vertebra over the middle of the shoulders
# points on a line, or beyond it, where nothing else shows them: from, toward, and how far, in lengths of it;
# by those of de Leva, the loin 17 % of the trunk above the hips, the head in line with the trunk
LINES = {
    "omphalion": ("loin", "neck", 0.17),
    "xiphion": ("loin", "neck", 0.65),
    "ear": ("loin", "neck", 1.2),
    "vertex": ("mid_hip", "cervicale", 1.4),
}
NEAREST = {"knee": "hip", "ankle": "knee"}  # the joint above


def joint_centers(landmark: Mapping[str, Array], height: float) -> dict[str, Array]:
    """All points (time, 3) m that landmarks (time, 3) m show, by name; those that are given stay.

    height m. Points: {left,right}_{hip,knee,ankle,heel,toe_tip,metatarsal,shoulder,elbow,wrist,knuckle},
    mid_hip, mid_shoulder, cervicale, neck, loin; with markers on the head vertex and ear.
    """
    p = dict(landmark)

    def middle(name: str, *of: str) -> None:
        if name not in p and all(one in p for one in of):
            p[name] = np.mean([p[one] for one in of], axis=0)

    def beyond(name: str, start: str, toward: str, length: float, base: str) -> None:
        if name not in p and {start, toward, base} <= p.keys():
            p[name] = p[base] + length * unit(p[toward] - p[start])

    middle("back", "left_psis", "right_psis")
    middle("back", "sacrum")
    middle("front", "left_asis", "right_asis")
    middle("loin", "front", "back")
    if {"front", "back"} <= p.keys():
        p = hips(p) | p
    middle("mid_hip", "left_hip", "right_hip")
    middle("mid_acromion", "left_acromion", "right_acromion")
    for side in SIDES:
        for joint in ("knee", "ankle", "elbow"):
            middle(f"{side}_{joint}", f"{side}_{joint}_lateral", f"{side}_{joint}_medial")
        for joint, above in NEAREST.items():
            inward(p, side, joint, above, HALF_BREADTH[joint] * height)
        middle(f"{side}_elbow", f"{side}_elbow_lateral")
        if f"{side}_shoulder" not in p and {"mid_acromion", "mid_hip"} <= p.keys():
            apart = np.linalg.norm(p["left_acromion"] - p["right_acromion"], axis=-1, keepdims=True)
            down = unit(p["mid_hip"] - p["mid_acromion"])
            p[f"{side}_shoulder"] = p[f"{side}_acromion"] + BELOW_ACROMION * apart * down
        middle(f"{side}_metatarsal", f"{side}_toe")
        beyond(f"{side}_toe_tip", f"{side}_heel", f"{side}_toe", FOOT_LENGTH * height, f"{side}_heel")
        beyond(f"{side}_knuckle", f"{side}_elbow", f"{side}_wrist", HAND_LENGTH * height, f"{side}_wrist")
    middle("mid_shoulder", "left_shoulder", "right_shoulder")
    middle("cervicale", "c7")
    if "cervicale" not in p and {"mid_hip", "mid_shoulder"} <= p.keys():
        p["cervicale"] = p["mid_hip"] + ABOVE_SHOULDERS * (p["mid_shoulder"] - p["mid_hip"])
    middle("neck", "cervicale", "notch")
    middle("neck", "cervicale")
    middle("loin", "mid_hip")
    if "head" in p:
        beyond("vertex", "cervicale", "head", HEAD_LENGTH * height, "cervicale")
        middle("ear", "head")
    return p


def hips(p: Mapping[str, Array]) -> dict[str, Array]:
    """Both hips from front and back of the pelvis and its spines."""
    right, back = p["right_asis"] - p["left_asis"], p["back"] - p["front"]
    width, depth = (np.linalg.norm(v, axis=-1, keepdims=True) for v in (right, back))
    across = right / width
    behind = unit(back - (back * across).sum(-1, keepdims=True) * across)
    down = np.cross(behind, across)
    below = p["front"] + regressed(HIP_BACK, depth) * behind - regressed(HIP_DOWN, width) * down
    out = regressed(HIP_OUT, width) * across
    return {"left_hip": below - out, "right_hip": below + out}


def regressed(line: tuple[float, float], size: Array) -> Array:
    """A length in m of a line in mm."""
    return 1e-3 * line[0] + line[1] * size


def inward(p: dict[str, Array], side: str, joint: str, above: str, half: float) -> None:
    """Put a joint with a lateral marker alone inward of it, along the line of the hips."""
    name, marker, upper = f"{side}_{joint}", f"{side}_{joint}_lateral", f"{side}_{above}"
    if name in p or not {marker, upper, "left_hip", "right_hip"} <= p.keys():
        return
    across = unit(p["right_hip"] - p["left_hip"]) * (1.0 if side == "left" else -1.0)
    along = unit(p[upper] - p[marker])
    p[name] = p[marker] + half * unit(across - (across * along).sum(-1, keepdims=True) * along)


def unit(v: Array) -> Array:
    """Directions (..., 3) of vectors."""
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def on_line(name: str, shown: Collection[str]) -> dict[str, float]:
    """A point as a combination of points that are shown, itself where it is; empty where it is none.

    >>> on_line("ear", ["loin", "neck"])
    {'loin': -0.2, 'neck': 1.2}
    """
    if name in shown or name not in LINES:
        return {name: 1.0} if name in shown else {}
    start, toward, part = LINES[name]
    return {start: round(1 - part, 12), toward: part} if {start, toward} <= set(shown) else {}
