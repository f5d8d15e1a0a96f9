"""A recording as its settings state it or as its motion shows it, and the stiffness told of its body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.errors import DataError
from forceid.estimation.body.inertia import Inertia, second_moment, without_node_rotations
from forceid.estimation.body.material import with_material
from forceid.estimation.body.rotors import with_rotors
from forceid.estimation.verdict.body_errors import SYMMETRIC
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


def further_places(
    off: Mapping[str, Array | None], moved: Mapping[str, tuple[float, ...]], told: Inertia, now: Inertia
) -> tuple[dict[str, Array], dict[str, tuple[float, ...]]]:
    """Where mass center and inertia, by name, are taken next; and by how much each was moved so far.

    off: by what the motion shows each beside where it is now, None for nothing. Each move is less than half
    of the one before. If the second is not, it was no body told wrong that showed, and it stays as told.
    """
    places, moves = dict[str, Array](), dict(moved)
    for name, by in off.items():
        before = moved.get(name, ())
        if by is None:
            continue
        move = float(np.linalg.norm(by))
        if not before or move < before[-1] / 2:
            places[name], moves[name] = getattr(now, name) - by, (*before, move)
        elif len(before) == 1:
            places[name], moves[name] = getattr(told, name), (*before, 0.0)
    return places, moves


def with_body_shown(
    body: Body, told: Inertia, center: Array | None = None, tensor: Array | None = None
) -> Body:
    """A body with its mass center, or its inertia, where its motion shows it, not as it was told.

    As uncertain then as the motion leaves it, whatever was stated; but of the size of an inertia, which no
    motion shows, what was stated holds on. The inertia is the nearest that a body may have.
    """
    if center is not None:
        off = float(np.linalg.norm(center - told.center))
        body = replace(body, mass_center=center, center_off=off)
    if tensor is not None:
        size, axes = np.linalg.eigh(second_moment(tensor))
        E = axes * np.maximum(size, 0.0) @ axes.T
        off = float(np.linalg.norm(tensor - told.tensor) / np.linalg.norm(told.tensor))
        body = replace(body, inertia=np.trace(E) * np.eye(3) - E, inertia_off=off)
    return body


def judge_shown(body: Body) -> list[Finding]:
    """Whether mass center and inertia of a body are taken where its motion shows them."""
    said = []
    if body.center_off and body.mass_center is not None:
        x, y, z = body.mass_center
        said.append(note("center-shown", amount=1e3 * body.center_off, x=x, y=y, z=z))
    if body.inertia_off and body.inertia is not None:
        xx, yy, zz, yz, xz, xy = (float(body.inertia[at]) for at in SYMMETRIC)
        off = 100 * body.inertia_off
        said.append(note("inertia-shown", amount=off, xx=xx, yy=yy, zz=zz, xy=xy, xz=xz, yz=yz))
    return said


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
