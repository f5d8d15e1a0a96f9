"""What the wrench is asked to say: about which point, and split into which loads."""

from __future__ import annotations

import numpy as np

from forceid.config import LoadSetting, Settings, Vector
from forceid.errors import ConfigError
from forceid.estimation.body.inertia import Inertia
from forceid.estimation.verdict.catalogue import note
from forceid.flight.smoother import FlightState
from forceid.kalman.building.process import block_diagonal
from forceid.principal import solve_loads, transport, transport_cov
from forceid.records import Array, Body, Finding, Loads, ModalForces
from forceid.rounding import SINGLE

SPLIT = 0.06  # of unit loads, what is left of one beside the others: below, they are alike


def check_points(settings: Settings, body: Body) -> None:
    """A ConfigError where the settings name a node that the body lacks, or a load without a direction."""
    named = {f"load {load.name}": load.point for load in settings.load}
    for where, point in ({"moment_about": settings.moment_about} | named).items():
        if isinstance(point, str) and point not in ("mass_center", *body.node):
            raise ConfigError(
                f"names the point '{point}', expected mass_center, three coordinates or a node",
                where,
                f"the nodes are {', '.join(body.node[:8])}" if body.node else "this body has no nodes",
            )
    for load in settings.load:
        if lost := [name for name in (*load.nodes, *load.pattern) if name not in body.node]:
            raise ConfigError(
                f"names '{lost[0]}', expected a node",
                f"load {load.name}",
                f"the nodes are {', '.join(body.node[:8])}" if body.node else "this body has no nodes",
            )
        if not any(any(force) for force in (load.direction or (), *load.pattern.values())):
            raise ConfigError("has no direction but 0 0 0", f"load {load.name}", "give it a direction")


def about_point(
    settings: Settings, body: Body, state: FlightState, shape: Array, wrench: Array
) -> tuple[Array, Array]:
    """The wrench (time, 6) and its covariance (time, 6, 6) about the point that the settings name."""
    if settings.moment_about == "mass_center":
        return wrench, state.wrench_cov
    arm = -lever(settings.moment_about, body, state, shape)
    cov = transport_cov(state.wrench_cov, arm)
    cov[:, :3, :3] = state.wrench_cov[:, :3, :3]  # the force is known where the moment is not
    return transport(wrench, arm), cov


def applied_loads(
    settings: Settings,
    body: Body,
    inertia: Inertia,
    state: FlightState,
    shape: Array,
    wrench: Array,
    modal: ModalForces | None = None,
) -> tuple[Loads | None, tuple[Finding, ...]]:
    """Least-squares loads of the pattern in the settings, None without one; and findings on those alike.

    Where all of them act on nodes, they answer to the forces on the modes of the body too, if these are
    known: [S^T; Phi^T] B p = [wrench; modal]. Source: principal equations 4c.
    """
    if not settings.load:
        return None, ()
    columns = [column(load, body, inertia.center, state, shape) for load in settings.load]
    gyration = inertia.gyration or 1.0  # a particle has none
    names = tuple(load.name for load in settings.load)
    G = np.stack(columns, -1)
    cov, forces = state.wrench_cov, [nodal_forces(load, body, state) for load in settings.load]
    if modal is not None and all(f is not None for f in forces):
        size = np.linalg.norm(modal.shape, axis=(1, 2))
        seen = np.einsum("kna,ltna->tkl", modal.shape, np.array(forces)) / size[:, None]
        wrench, G = np.concatenate([wrench, modal.force / size], 1), np.concatenate([G, seen], 1)
        cov = block_diagonal(cov, modal.cov / np.outer(size, size))
        if modal.with_wrench is not None:
            cov[:, :6, 6:] = modal.with_wrench / size
            cov[:, 6:, :6] = cov[:, :6, 6:].swapaxes(1, 2)
    same = parallel_loads(G, gyration, names)
    if inertia.point:  # no moment acts on it: a load is told by its force
        wrench, cov, G = wrench[:, :3], cov[:, :3, :3], G[:, :3]
    elif inertia.line is not None:  # along the line none acts: known there as well as across
        n = state.rotation @ inertia.line
        across = 0.5 * np.trace(cov[:, 3:, 3:], axis1=1, axis2=2)
        cov = cov.copy()
        cov[:, 3:, 3:] += across[:, None, None] * n[:, :, None] * n[:, None]
    return solve_loads(wrench, cov, G, gyration, names), same


def parallel_loads(G: Array, length: float, name: tuple[str, ...]) -> tuple[Finding, ...]:
    """Loads that do all but the same to the body, so that small errors go far in their split.

    G (time, 6 + mode, load): wrench of a unit of each, and its forces on modes; length m: by which moments
    are divided. Those that do just the same are for the rank test.

    >>> lean = np.radians(1.0)
    >>> G = np.array([[1.0, np.cos(lean)], [0.0, np.sin(lean)], *np.zeros((4, 2))])[None]
    >>> parallel_loads(G, 0.1, ("bow", "stern"))[0].text[:53]
    'the loads bow, stern do nearly the same to the body: '
    """
    unit = np.ones(G.shape[1])
    unit[3:6] = length
    scaled = G[np.isfinite(G).all((1, 2))] / unit[:, None]
    size = np.linalg.norm(scaled, axis=1, keepdims=True)
    if not len(scaled) or not size.all() or len(name) > scaled.shape[1]:
        return ()
    _, s, V = np.linalg.svd(scaled / size, full_matrices=False)
    k = int(np.argsort(s[:, -1])[len(s) // 2])
    if not SINGLE < s[k, -1] < SPLIT:
        return ()
    pair = ", ".join(n for n, part in zip(name, np.abs(V[k, -1]), strict=True) if part > SPLIT)
    return (note("loads-alike", names=pair, times=1 / s[k, -1]),)


def column(load: LoadSetting, body: Body, origin: Array, state: FlightState, shape: Array) -> Array:
    """Wrench (time, 6) about the mass center of one newton, or newton meter, of a load.

    origin (3,): the mass center in the axes of the reference shape, in which body points are given.
    """
    if load.nodes or load.pattern:
        f = nodal_forces(load, body, state)
        assert f is not None
        turned = np.einsum("tab,tnb->ta", state.rotation, f)
        return np.concatenate([turned, np.einsum("tab,tb->ta", state.rotation, np.cross(shape, f).sum(1))], 1)
    direction = np.array(load.direction, float)
    direction = direction / np.linalg.norm(direction)
    turned = np.tile(direction, (len(state.center), 1))
    if load.axes == "body":
        turned = np.einsum("tab,b->ta", state.rotation, direction)
    none = np.zeros_like(turned)
    if load.kind == "moment":
        return np.concatenate([none, turned], 1)
    if isinstance(load.point, str):
        arm = lever(load.point, body, state, shape)
    elif load.axes == "body":
        arm = np.einsum("tab,b->ta", state.rotation, np.array(load.point) - origin)
    else:
        arm = np.array(load.point) - state.center
    return transport(np.concatenate([turned, none], 1), arm)


def nodal_forces(load: LoadSetting, body: Body, state: FlightState) -> Array | None:
    """Forces (time, node, 3) of a load of one on the nodes, body axes; None for one that acts on none."""
    at = load.nodes or ((load.point,) if isinstance(load.point, str) and load.point in body.node else ())
    forces: dict[str, Vector | Array] = dict(load.pattern)
    if load.kind == "force" and load.direction is not None:
        share = np.array(load.direction) / np.linalg.norm(np.array(load.direction)) / max(len(at), 1)
        forces = dict.fromkeys(at, share)
    if not forces:
        return None
    f = np.zeros((len(body.node), 3))
    for node, force in forces.items():
        f[body.node.index(node)] = force
    if load.axes == "body":
        return np.tile(f, (len(state.center), 1, 1))
    return np.asarray(np.einsum("tba,nb->tna", state.rotation, f))


def lever(point: str | Vector, body: Body, state: FlightState, shape: Array) -> Array:
    """From the mass center to a node, to itself, or to a point fixed in space (time, 3), world axes.

    Of a node it is known where the place of the body is not.
    """
    if not isinstance(point, str):
        return np.array(point) - state.center
    node = np.zeros_like(state.center) if point == "mass_center" else shape[:, body.node.index(point)]
    if not node.any():  # at the mass center, however the body turns
        return np.zeros_like(state.center)
    return np.asarray(np.einsum("tab,tb->ta", state.rotation, node))
