"""Bodies in parts and bodies that deform as scenes: a chain, a cable, a soft block. Each is drawn."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.strangers.bodies import Solid, flung, sites, unit_direction, words, world
from evidence.strangers.ground import GROUND_PLANE
from evidence.strangers.simulated import WATCHED_BODY, WEIGHT, Camera, Scene
from forceid.records import Array

SMALL = 2e-3  # m: radius of gyration of what a user takes for a mass point


def lumps(X: Array, mass: Array) -> str:
    """Mass points (node,) kg at places (node, 3) m as one body, with a marker on each."""
    body = Solid.of(X, mass, np.zeros(3))
    return replace(body, inertia=body.inertia + SMALL**2 * body.mass * np.eye(3)).inertial + sites(X)


def three_links(rng: np.random.Generator, camera: Camera) -> Scene:
    """A chain of three links of mass points, on a ball and a sprung hinge in some order, thrown.

    Half of them are pushed by a smooth force on the first link, and the user states that something may.
    """
    count, length = int(rng.integers(4, 6)), rng.uniform(0.15, 0.35, 3)
    links, masses = [], []
    for k in range(3):
        links.append(np.array([length[k], 0.1, 0.1]) * (rng.uniform(0, 1, (count, 3)) - [0, 0.5, 0.5]))
        masses.append(rng.uniform(0.02, 0.15, count))
    hinged, axis = int(rng.integers(2)), unit_direction(rng)
    spring, slow = rng.uniform(0, 1), rng.uniform(0, 0.005)
    kinds = ["ball", "ball"]
    kinds[hinged] = "hinge"
    of = {
        "ball": '<joint type="ball"/>',
        "hinge": f'<joint type="hinge" axis="{words(axis)}" stiffness="{spring}" damping="{slow}"/>',
    }
    inside = ""
    for k in (2, 1):
        inside = (
            f'<body pos="{length[k - 1]} 0 0">{of[kinds[k - 1]]}{lumps(links[k], masses[k])}{inside}</body>'
        )
    q, v = flung(rng, rng.uniform(1, 4), rng.uniform(-4, 4, 3))
    start = q, np.append(v, rng.uniform(-6, 6, 4))
    push = float(rng.random() < 0.5) * np.sum(masses) * WEIGHT * rng.uniform(0.1, 0.5) * unit_direction(rng)
    w = 2 * np.pi * rng.uniform(0.3, 2)

    def drive(data: Any) -> None:
        data.xfrc_applied[WATCHED_BODY, :3] = np.sin(w * data.time) * push

    names = [f"m{k}" for k in range(3 * count)]
    part: list[dict[str, Any]] = [
        {"name": p, "nodes": names[k * count : (k + 1) * count]} for k, p in enumerate("abc")
    ]
    part[0]["external"] = bool(push.any())
    stated: dict[str, dict[str, Any]] = {"ball": {}, "hinge": {"axis": tuple(axis), "driven": True}}
    ends = [(x, 0.0, 0.0) for x in np.cumsum(length).tolist()]
    joint = [
        {"name": f"joint {k}", "parts": tuple("abc"[k : k + 2]), "at": ends[k], "kind": kind} | stated[kind]
        for k, kind in enumerate(kinds)
    ]
    return Scene(
        world(lumps(links[0], masses[0]) + inside), start, drive, mass=np.concatenate(masses),
        joints=(WATCHED_BODY + 1, WATCHED_BODY + 2), settings={"part": part, "joint": joint},
    )  # fmt: skip


def cable(rng: np.random.Generator, camera: Camera) -> Scene:
    """A cable of 8 to 15 mass points on rods that bend against each other, damped; hung up or thrown."""
    count, length, mass = int(rng.integers(8, 16)), rng.uniform(0.5, 1.5), rng.uniform(0.1, 1.0)
    rod = length / count
    spring, hung = mass * WEIGHT * length * 10 ** rng.uniform(-1.5, 0), bool(rng.random() < 0.5)
    point = lumps(np.array([[rod, 0, 0]]), np.array([mass / count]))
    held = f'stiffness="{spring}" damping="{spring * rng.uniform(0.0005, 0.003)}"'
    bend = "".join(f'<joint type="hinge" axis="{axis}" {held}/>' for axis in ("0 1 0", "0 0 1"))
    inside = point
    for _ in range(count - 1):  # bent where nothing pulls: a straight one has no inertia about itself
        bent = words([0, *rng.uniform(-0.15, 0.2, 2)])
        inside = f'{point}<body pos="{rod} 0 0" euler="{bent}">{bend}{inside}</body>'
    turn = Rotation.from_euler("zy", [rng.uniform(0, 6), rng.uniform(0, 1.2)]).as_quat(scalar_first=True)
    spin, sway = rng.uniform(-3, 3, 3), rng.uniform(-1, 1, 2 * (count - 1))
    q, v = (turn, spin) if hung else flung(rng, rng.uniform(1, 4), spin)
    joint = '<joint type="ball"/>' if hung else "<freejoint/>"
    each = np.full(count, mass / count)
    return Scene(
        world(inside, joint), (q, np.append(v, sway)), mass=each, options='integrator="implicitfast"'
    )


def block(rng: np.random.Generator, dropped: bool) -> Scene:
    """A soft block of 8 or 12 mass points, of elastic solid between, whose softest mode is at 5 to 25 Hz."""
    grid = (int(rng.integers(2, 4)), 2, 2)
    spacing, mass = rng.uniform(0.05, 0.12, 3), rng.uniform(0.3, 2)
    nodes = int(np.prod(grid))
    soft = 2 * np.pi * rng.uniform(5, 25)
    young, slow = soft**2 * mass / float(spacing.mean()), 2 * rng.uniform(0.01, 0.05) / soft
    flex = (
        f'<flexcomp name="block" type="grid" dim="3" count="{words(grid)}" spacing="{words(spacing)}" '
        f'mass="{mass}" radius="0.002"><elasticity young="{young}" poisson="0.2" damping="{slow}"/>'
        f'<contact selfcollide="none" solref="{rng.uniform(0.004, 0.02)} {rng.uniform(0.2, 1)}" '
        f'friction="{rng.uniform(0.1, 0.7)}"/></flexcomp>'
    )
    spin, ring = rng.uniform(-6, 6, 3), rng.uniform(-1.5, 1.5, (3, 3))
    X = spacing * (np.array(list(product(*map(range, grid)))) - (np.array(grid) - 1) / 2)
    about = Rotation.random(random_state=rng).apply(X)
    speed = unit_direction(rng) * rng.uniform(0, 4) * [1, 1, 0 if dropped else 1]
    high = np.array([0.0, 0.0, np.linalg.norm(X[0]) + rng.uniform(0.05, 0.3)])
    drag = 0.0 if dropped else rng.uniform(0.02, 0.3) * mass / nodes

    start = (about + high - X).ravel(), (speed + np.cross(spin, about) + about @ ring).ravel()

    def drive(data: Any) -> None:
        v = data.qvel.reshape(-1, 3)
        data.xfrc_applied[WATCHED_BODY + 1 :, :3] = -drag * np.linalg.norm(v, axis=1)[:, None] * v

    inside, each = world(flex, "", GROUND_PLANE if dropped else ""), np.full(nodes, mass / nodes)
    return Scene(inside, start, drive, mass=each, at_vertices=True)


def soft_block(rng: np.random.Generator, camera: Camera) -> Scene:
    """A soft block in the air, with drag."""
    return block(rng, False)


def soft_block_dropped(rng: np.random.Generator, camera: Camera) -> Scene:
    """A soft block that falls on the floor."""
    return block(rng, True)
