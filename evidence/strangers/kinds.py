"""The kinds of scene, and what comes of a record: drawn, moved, written as a file, estimated, judged."""

from __future__ import annotations

import numpy as np

from evidence.judged import LOADS, scores
from evidence.strangers import deforming, ground, rigid
from evidence.strangers.attempt import attempt
from evidence.strangers.outcome import StrangerOutcome
from evidence.strangers.simulated import Camera, Scene, recorded
from forceid.records import Recording, Verdict

KINDS = {
    "box in air": rigid.box_in_air, "javelin": rigid.javelin, "quadrotor": rigid.quadrotor,
    "pendulum": rigid.pendulum, "bouncing box": ground.bouncing_box, "bouncing ball": ground.bouncing_ball,
    "rolling": ground.rolling, "chain": deforming.three_links, "cable": deforming.cable,
    "shaker": rigid.shaker, "top": ground.top, "satellite": rigid.satellite,
    "soft block": deforming.soft_block, "soft block dropped": deforming.soft_block_dropped,
}  # fmt: skip


def drawn(kind: str, seed: int) -> tuple[Scene, Camera, Recording]:
    """The record of a kind and a seed, its scene and camera. FloatingPointError: the simulator lost it."""
    rng = np.random.default_rng([seed, *kind.encode()])
    camera = Camera.drawn(rng)
    scene = KINDS[kind](rng, camera)
    return scene, camera, recorded(scene, camera, rng)


def run(job: tuple[str, int]) -> list[StrangerOutcome]:
    """What came of the record of a kind and a seed; of a chain also what came of its joints."""
    kind, seed = job
    try:
        scene, camera, recording = drawn(kind, seed)
    except FloatingPointError as error:
        return [StrangerOutcome(kind, seed, "not simulated", (str(error),))]
    facts = (
        f"{camera.rate:.0f} Hz, {camera.samples} samples, {len(recording.body.node)} markers, "
        f"{1e3 * camera.noise:.2f} mm {'stated' if camera.stated else 'not stated'}"
        f"{', gaps' if camera.lost else ''}"
    )
    tried = attempt(recording, **scene.settings)
    found, took = tried.found, tried.seconds
    if found is None:
        return [StrangerOutcome(kind, seed, tried.verdict, tried.codes, facts=facts, seconds=took)]
    truth = tried.recording.truth

    def judged(name: str, said: Verdict, off: dict[str, tuple[float, ...]]) -> StrangerOutcome:
        return StrangerOutcome(name, seed, said.level, said.codes, facts=facts, seconds=took, **off)

    rows = [judged(kind, found.verdict, scores(found, [truth[n] for n in LOADS]))]
    if found.interface is not None:
        joints, whole = [truth[f"joint_{n}"] for n in LOADS], np.full(6, np.inf)  # no band is claimed there
        off = scores(found.interface, joints, whole, camera.rate)
        rows.append(judged(f"{kind}: joints", found.interface.verdict, off))
    return rows
