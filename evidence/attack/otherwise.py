"""The same flight seen otherwise: turned, moved, mirrored, backwards, in other units. Its loads must agree.

    python -m evidence.attack.otherwise [--records 12] [--seed 77095]

Prints, for each way to see a flight, by how many claimed deviations force and moment differ at most, and in
how many records the verdict does: of drawn records of bodies without stiffness, modes or wheels. Every record
is written as a file, read and estimated. Those with a line among their loads count apart: lines are sought
along axes of the laboratory.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.calibration.record import drawn_record
from evidence.strangers.attempt import Attempt, attempt
from evidence.written import asked, table
from forceid.records import Array, Body, Recording

TURN, OWN = (
    Rotation.from_euler("zyx", angles).as_matrix() for angles in ([0.7, -0.4, 1.1], [-1.3, 0.2, 0.5])
)
MIRROR, SAME, NOWHERE = np.diag([1.0, 1.0, -1.0]), np.eye(3), np.zeros(3)
AWAY, FAST, ORIGIN = (
    np.array([100.0, -50, 30]),
    np.array([3.0, -2, 1]),
    np.array([0.3, -0.2, 0.1]),
)  # m, m/s, m
FRAMES = (100, 600)


@dataclass(frozen=True)
class View:
    """A recording seen otherwise, and what takes a load (time, 3) seen so back: back(load, axial)."""

    name: str
    recording: Recording
    back: Callable[[Array, bool], Array]


def views(recording: Recording) -> Iterator[View]:
    """All ways to see a recording."""
    body, motion = recording.body, recording.motion
    x, t, g = motion.position, motion.time, motion.gravity
    assert x is not None

    def seen(name: str, back: Callable[[Array, bool], Array], own: Body = body, **motion_as: Array) -> View:
        return View(name, replace(recording, body=own, motion=replace(motion, **motion_as), truth={}), back)

    def same(load: Array, axial: bool) -> Array:
        return load

    yield seen("turned", lambda load, _: load @ TURN, position=x @ TURN.T, gravity=TURN @ g)
    yield seen("100 m away", same, position=x + AWAY)
    yield seen("from a moving place", same, position=x + FAST * (t - t[0])[:, None, None])
    yield seen("other axes of the body", same, moved(body, OWN))
    yield seen("another origin of the body", same, moved(body, shift=ORIGIN))
    mirrored = moved(body, MIRROR)
    yield seen(
        "mirrored",
        lambda load, axial: load @ MIRROR * (-1) ** axial,
        mirrored,
        position=x @ MIRROR,
        gravity=MIRROR @ g,
    )
    yield seen("backwards", lambda load, _: load[::-1], position=x[::-1].copy(), time=t[0] + t[-1] - t[::-1])
    yield seen("four times the mass", lambda load, _: load / 4, moved(body, mass=4.0))
    yield seen("half as fast", lambda load, _: 4 * load, time=t[0] + 2 * (t - t[0]), gravity=g / 4)
    larger = {"position": 2 * x, "gravity": 2 * g}
    noise = {name: 2 * std for name, std in motion.noise_std.items()}
    yield seen(
        "twice as large",
        lambda load, axial: load / (4 if axial else 2),
        moved(body, size=2.0),
        noise_std=noise,
        **larger,
    )


def moved(
    body: Body, turn: Array = SAME, shift: Array = NOWHERE, mass: float = 1.0, size: float = 1.0
) -> Body:
    """A body whose reference shape is turned, shifted, or of another size or mass."""
    changed: dict[str, Array | float] = {}
    for name in ("position", "mass_center"):
        if (place := getattr(body, name)) is not None:
            changed[name] = size * place @ turn.T + shift
    if body.inertia is not None:
        changed["inertia"] = size**2 * mass * turn @ body.inertia @ turn.T
    for name in ("mass", "total_mass"):
        if getattr(body, name) is not None:
            changed[name] = mass * getattr(body, name)
    return replace(body, **changed)


def simple(body: Body) -> bool:
    """Whether a body is told by markers and masses alone, or by its mass and inertia as a whole."""
    others = body.mass_matrix, body.stiffness, body.mode_shape, body.material, body.rotor_axis
    return body.position is not None and all(one is None for one in others)


def apart(one: Attempt, other: Attempt, back: Callable[[Array, bool], Array]) -> tuple[float, float]:
    """By how many claimed deviations force and moment of two estimates differ at most."""
    found = []
    for axial, name in enumerate(("force", "moment")):
        load, std = getattr(one.found, name), getattr(one.found, f"{name}_std")
        off = np.linalg.norm(back(getattr(other.found, name), bool(axial)) - load, axis=1) / np.linalg.norm(
            std, axis=1
        )
        found.append(float(np.nanmax(off)) if np.isfinite(off).any() else 0.0)
    return found[0], found[1]


def main() -> None:
    """See drawn records otherwise, and print how far the loads are apart."""
    args = asked("evidence.attack.otherwise", __doc__, page=False, records=12, seed=77095)
    rows: dict[str, list[tuple[float, float, bool, bool]]] = {}
    number, done = 0, 0
    while done < args.records:
        drawn = drawn_record(args.seed, number, FRAMES)
        number += 1
        if drawn.recording.motion.position is None or not simple(drawn.recording.body):
            continue
        one = attempt(drawn.recording)
        if one.found is None or one.verdict == "refused":
            continue
        lines = any("line" in name for name in one.found.tuned)
        for view in views(drawn.recording):
            other = attempt(view.recording)
            if other.found is None:
                rows.setdefault(view.name, []).append((np.inf, np.inf, True, lines))
                continue
            force, moment = apart(one, other, view.back)
            rows.setdefault(view.name, []).append((force, moment, other.verdict != one.verdict, lines))
        done += 1
        print(f"{done} of {args.records}: record {number - 1}", file=sys.stderr, flush=True)
    said = []
    for name, found in rows.items():
        plain = [one for one in found if not one[3]]
        worst = np.array([[force, moment] for force, moment, *_ in plain] or [[np.nan, np.nan]]).max(0)
        with_lines = np.array([max(one[:2]) for one in found if one[3]] or [np.nan]).max()
        other_verdict = sum(one[2] for one in found)
        said.append(
            {
                "seen": name, "force, claims": float(worst[0]), "moment, claims": float(worst[1]),
                "with lines, claims": float(with_lines), "another verdict": other_verdict,
            }
        )  # fmt: skip
    print(table(said))


if __name__ == "__main__":
    main()
