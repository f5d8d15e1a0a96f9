"""Drawn bodies whose mass lies on a point, a line or a plane, seen by one to six markers, with their truth.

The physics is apart from that of forceid: nodes move on closed forms, and force and moment follow from their
momenta, summed node by node, by differences whose error is that of rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.records import Array, Body, Flags, Motion, Recording

TimeFunction = Callable[[Array], Array]

STEP = 4e-3  # s of the differences: the fastest motion turns by 0.1 rad in it, and the error is its 8th power
WEIGHTS = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280]) / STEP
PLACES = ("masses", "span", "around", "line")  # of markers: on masses, among them, off them, on a line
SPAN = 1e-6  # of its size by which a set of points may leave a line or plane and still lies on it
ENOUGH = 12  # frames that show a component, from which it has to be told


@dataclass(frozen=True)
class DrawnBody:
    """A recording, what it is, and which components its geometry determines."""

    recording: Recording
    kind: str
    force: bool
    moment: bool


def time_derivative(of: TimeFunction, time: Array) -> Array:
    """Time derivative of a function of time, differences of order 8."""
    return sum(w * (of(time + k * STEP) - of(time - k * STEP)) for k, w in enumerate(WEIGHTS, 1))  # type: ignore[return-value]


def rank(points: Array) -> int:
    """Dimension of the span of points (node, 3): 0 for a point, 1 for a line, 2 for a plane, 3."""
    off = points - points.mean(0)
    size = np.linalg.svd(off, compute_uv=False)
    return int((size > SPAN * max(size[0], 1e-3)).sum())


def is_affine_combination(points: Array, point: Array) -> bool:
    """Whether a point is an affine combination of points (node, 3)."""
    off = points[1:] - points[0]
    left = point - points[0]
    if len(off):
        left = left - off.T @ np.linalg.lstsq(off.T, left, rcond=SPAN)[0]
    return bool(np.linalg.norm(left) < 1e-4 * (1e-3 + np.abs(points).max()))


def draw_masses(rng: np.random.Generator, kind: str) -> tuple[Array, Array]:
    """Masses (node,) kg and their places (node, 3) m."""
    size, n = rng.uniform(0.2, 1.5), {"point": int(rng.integers(1, 3)), "line": int(rng.integers(2, 12))}
    count = n.get(kind, int(rng.integers(3, 9)))
    axes = {"point": 0, "line": 1, "plane": 2, "solid": 3}[kind]
    X = np.zeros((count, 3))
    X[:, :axes] = size * rng.uniform(-1, 1, (count, axes))
    return rng.uniform(0.05, 2.0, count), X


def draw_mass_matrix(rng: np.random.Generator, mass: Array) -> Array:
    """A mass matrix (dof, dof) that couples nodes: positive, of any rank, of the same total."""
    n = len(mass)
    factor = rng.uniform(0, 1, (int(rng.integers(1, n + 1)), n))
    M = factor.T @ factor
    return np.kron(M * mass.sum() / M.sum(), np.eye(3))


def random_motion(rng: np.random.Generator, thrown: bool) -> tuple[TimeFunction, TimeFunction]:
    """Path of the center (time, 3) without its fall, and rotation (time, 3, 3), as functions of time."""
    place, speed, wide = rng.normal(0, 1, 3), rng.normal(0, 2, 3), rng.normal(0, 0.2, 3)
    w, p = rng.uniform(2, 15, (2, 3)), rng.uniform(0, 2 * np.pi, (2, 3))
    turn, swing = rng.normal(0, 3, 3), rng.normal(0, 0.4, 3)
    start = Rotation.random(random_state=int(rng.integers(1 << 30)))

    def center(time: Array) -> Array:
        t = time[:, None]
        return np.asarray(place + speed * t + (0.0 if thrown else wide) * np.sin(w[0] * t + p[0]))

    def rotation(time: Array) -> Array:
        t = time[:, None]
        angle = turn * t * [1, 0, 0] if thrown else turn * t * [1, 0.3, 1] + swing * np.sin(w[1] * t + p[1])
        return np.asarray((start * Rotation.from_euler("zxz", angle)).as_matrix())

    return center, rotation


def draw_body(seed: int) -> DrawnBody:
    """The recording of a seed."""
    rng = np.random.default_rng(seed)
    kind = str(rng.choice(["point", "line", "line", "line", "plane", "plane", "solid"]))
    mass, X = draw_masses(rng, kind)
    size = max(float(np.ptp(X, axis=0).max()), 0.2)
    told = str(rng.choice(["mass", "mass", "matrix", "whole", "whole"]))
    markers, on = int(rng.integers(1, 7)), str(rng.choice(PLACES, p=[3 / 8, 2 / 8, 2 / 8, 1 / 8]))
    if told == "whole" and on == "masses":
        on = "span"
    marked, extra = np.zeros(len(mass), bool), np.zeros((0, 3))
    if on == "masses":
        markers = min(markers, len(mass))
        marked[rng.permutation(len(mass))[: markers if rng.random() < 0.5 else len(mass)]] = True
    elif on == "span":
        extra = X[rng.integers(len(mass), size=markers)] + rng.normal(0, 0.5, (markers, 1)) * (X[-1] - X[0])
    elif on == "line":
        through = X[0] if rng.random() < 0.5 else rng.normal(0, size, 3)
        extra = through + rng.normal(0, size, (markers, 1)) * rng.normal(0, 1, 3)
    else:
        extra = rng.normal(0, size, (markers, 3))
    nodes = np.vstack([X, extra])
    M = draw_mass_matrix(rng, mass) if told == "matrix" else np.kron(np.diag(mass), np.eye(3))
    each = np.asarray(M[::3, ::3])  # (mass, mass): the same along all axes
    total, center = each.sum(), each.sum(0) @ X / each.sum()
    thrown = bool(rng.random() < 0.3)
    path, turned = random_motion(rng, thrown)
    gravity = np.array([0.0, 0.0, -9.81])
    bends = kind == "line" and len(mass) > 3 and told != "whole" and rng.random() < 0.3 and not thrown
    flat = np.zeros(len(nodes))
    if bends:  # a sag that moves neither the center nor, to first order, the line
        u, along = (X**2).sum(1), X[:, 0] - center[0]
        fit = np.stack([np.ones_like(along), along], 1)
        flat[: len(X)] = u - fit @ np.linalg.solve(fit.T @ each @ fit, fit.T @ each @ u)
        flat *= 0.02 * size / max(np.abs(flat).max(), 1e-9)
    sway = 2 * np.pi * rng.uniform(1, 4)

    def at(time: Array) -> Array:
        """Places (time, node, 3)."""
        body = (nodes - center)[None] + np.sin(sway * time)[:, None, None] * flat[:, None] * [0, 0, 1.0]
        c = path(time) + 0.5 * time[:, None] ** 2 * gravity
        return np.asarray(c[:, None] + np.einsum("tab,tnb->tna", turned(time), body))

    def momentum(time: Array) -> tuple[Array, Array]:
        """Linear (time, 3) and angular momentum about the mass center (time, 3), summed over the nodes."""
        x, v = at(time)[:, : len(X)], time_derivative(at, time)[:, : len(X)]
        p = np.einsum("nm,tma->tna", each, v)
        c = np.einsum("nm,tma->ta", each, x) / total
        return p.sum(1), np.cross(x - c[:, None], p).sum(1)

    few = rng.random() < 0.1
    frames = int(rng.integers(2, 20)) if few else int(rng.integers(60, 250))
    time = np.arange(frames) / rng.uniform(50, 300)
    force = time_derivative(lambda t: momentum(t)[0], time) - total * gravity
    moment = time_derivative(lambda t: momentum(t)[1], time)
    noise = 10 ** rng.uniform(-4.3, -2.8)
    clean = at(time)
    x = clean + rng.normal(0, noise, clean.shape)
    seen = np.concatenate([marked, np.ones(len(extra), bool)])
    lost = rng.random(x.shape[:2]) < (0.02 if rng.random() < 0.3 else 0.0)
    x = np.where((seen & ~lost)[..., None], x, np.nan)
    frame = Rotation.random(random_state=seed)  # in which the body is described, with another origin
    reference, shift = frame.apply(nodes), rng.normal(0, 1, 3)
    about = X - center
    Q = np.einsum("nm,na,mb->ab", each, about, about)
    J = np.trace(Q) * np.eye(3) - Q
    nothing = np.zeros(len(extra))
    bare = told == "whole" and rng.random() < 0.1  # the inertia is not told
    if told == "whole":
        tensor = frame.as_matrix() @ J @ frame.as_matrix().T
        body = Body(
            position=(reference + shift)[len(X) :], total_mass=float(total),
            mass_center=frame.apply(center) + shift, inertia=None if bare else 0.5 * (tensor + tensor.T),
        )  # fmt: skip
        x, seen_nodes = x[:, len(X) :], extra
    elif told == "matrix":
        wide = np.zeros((3 * len(nodes), 3 * len(nodes)))
        wide[: 3 * len(X), : 3 * len(X)] = M
        body, seen_nodes = Body(position=reference + shift, mass_matrix=wide), nodes[seen]
    else:
        body, seen_nodes = Body(position=reference + shift, mass=np.r_[mass, nothing]), nodes[seen]
    assert body.position is not None
    body = with_node_names(body, len(body.position))
    stated = {"position": float(noise)} if rng.random() < 0.7 else {}
    motion = Motion(time, x, gravity=gravity, noise_std=stated)
    recording = Recording(body, motion, {"force": force, "moment": moment}, f"drawn body {seed}")
    least = 1e-10 * max(float(np.trace(J)), total * size**2)
    axes = int((np.linalg.eigvalsh(J) > least).sum())
    enough = whole_frames(np.isfinite(x).all(2)) >= ENOUGH and not bare
    dim = rank(seen_nodes)
    told_by = told + (", bends" if bends else "") + (", no inertia" if bare else "")
    kind = f"{kind}, {told_by}, {len(seen_nodes)} markers on {on}, {frames} frames"
    force_shows = dim >= 2 or is_affine_combination(seen_nodes, center)
    return DrawnBody(
        recording, kind, enough and force_shows, enough and shows_moment(seen_nodes, dim, axes, about)
    )


def shows_moment(marked: Array, dim: int, axes: int, about: Array) -> bool:
    """Whether markers show the turn that a moment makes: of mass on a line, the direction of that line."""
    if axes == 0 or dim >= 2:
        return True
    if axes == 3 or dim == 0:
        return False
    lines = np.vstack([marked - marked.mean(0), about - about.mean(0)])
    return rank(np.vstack([lines, -lines])) == 1


def whole_frames(seen: Flags) -> int:
    """Frames that show every marker ever seen."""
    return int(seen[:, seen.any(0)].all(1).sum())


def with_node_names(body: Body, nodes: int) -> Body:
    """The body with names for its nodes."""
    return replace(body, node=tuple(f"node_{k}" for k in range(nodes)))
