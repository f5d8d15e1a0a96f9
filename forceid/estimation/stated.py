"""A recording as its settings state it or as its motion shows it, and the stiffness told of its body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.errors import DataError
from forceid.estimation.body.inertia import without_node_rotations
from forceid.estimation.body.material import with_material
from forceid.estimation.body.rotors import with_rotors
from forceid.estimation.verdict.catalogue import note
from forceid.principal import objectivity
from forceid.records import Array, Body, Finding, Recording


def with_stated(recording: Recording, settings: Settings) -> Recording:
    """The recording under the gravity, and of a body with what turns inside and the material, that the
    settings state. Matrices of the body are those of the places of its nodes.
    """
    body, motion = without_node_rotations(recording.body), recording.motion
    if settings.gravity is not None:
        motion = replace(motion, gravity=np.array(settings.gravity))
    if settings.internal_momentum is not None:
        body = replace(body, internal_momentum=np.array(settings.internal_momentum))
    if settings.mass_rate is not None:
        body = replace(body, mass_rate=settings.mass_rate)
    body, motion = with_rotors(body, motion, settings.rotor)
    return replace(recording, body=with_material(body, settings), motion=motion)


def as_shown(
    recording: Recording, settings: Settings, center: Array, off: Array
) -> tuple[Recording, Settings]:
    """A recording and settings with the mass center where the motion shows it, off from `center`, as told.

    It is as uncertain then as the motion leaves it, whatever was stated.
    """
    body = replace(recording.body, mass_center=center - off, center_off=float(np.linalg.norm(off)))
    known = settings.body_std.model_copy(update={"mass_center": 0.0})
    return replace(recording, body=body), settings.model_copy(update={"body_std": known})


def judge_shown(body: Body) -> list[Finding]:
    """Whether the mass center of a body is taken where its motion shows it."""
    if body.center_off is None or body.mass_center is None:
        return []
    x, y, z = body.mass_center
    return [note("center-shown", amount=1e3 * body.center_off, x=x, y=y, z=z)]


def check_stiffness(body: Body) -> None:
    """A DataError where the stiffness of a body leaves a mechanism or holds a rigid motion."""
    if body.stiffness is None or body.position is None:
        return
    if not body.stiffness.any():
        raise DataError("is all zero", "/body/stiffness", "leave it out: a force needs no stiffness")
    if reasons := objectivity(body.stiffness, body.position).reasons:
        raise DataError(reasons[0].removeprefix("the stiffness "), "/body/stiffness")


def without_mechanism(recording: Recording, settings: Settings) -> Recording:
    """A recording without a stiffness under which parts move freely against each other: it is theirs."""
    body = recording.body
    if not settings.part or body.stiffness is None or body.position is None or not body.stiffness.any():
        return recording
    if not objectivity(body.stiffness, body.position).reasons:
        return recording
    return replace(recording, body=replace(body, stiffness=None))
