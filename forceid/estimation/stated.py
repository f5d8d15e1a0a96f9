"""A recording as its settings state it, and the stiffness that a body may be told with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.errors import DataError
from forceid.estimation.body.inertia import without_node_rotations
from forceid.estimation.body.material import with_material
from forceid.estimation.body.rotors import with_rotors
from forceid.principal import objectivity
from forceid.records import Body, Recording


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
