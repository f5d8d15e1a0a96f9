"""Bodies in parts under the loads of principal equations 5.3, the values printed there, plain references."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from forceid.partition.grids import Parts, assemble_elements, bar, box_grid, gathered, solid_parts
from forceid.partition.system import PartitionedSystem

PRECONDITIONERS = ("none", "lumped", "dirichlet")
SQUARE = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])  # m
EDGES, DIAGONALS = ((0, 1), (0, 2), (1, 3), (2, 3)), ((0, 3), (1, 2))


@dataclass(frozen=True)
class Case:
    """A body: its parts, loads (node, axis) N on the assembled nodes, and which of these are fixed."""

    parts: Parts
    load: np.ndarray
    fixed: np.ndarray

    @property
    def system(self):
        return self.parts.system(self.fixed)

    @property
    def force(self):
        """The load on what is free (size,)."""
        return self.load[~self.fixed].ravel()


def plane_stress(parts, r, young=1000.0):
    P = solid_parts(parts, r, young)
    x, load = P.place, np.zeros_like(P.place)
    right, top = np.isclose(x[:, 0], parts[0]), np.isclose(x[:, 1], parts[1])
    load[right] += np.array([0.3, -1.0]) / right.sum()
    load[top, 1] += 0.1 * x[top, 0] / (parts[0] * r)
    return Case(P, load, np.isclose(x[:, 0], 0))


def truss_parts(parts, r, axial_stiffness=5e4, line_density=1.0):
    """Planar trusses of r x r unit cells with four edges and both diagonals, all of one axial stiffness N."""
    nodes, elements = box_grid(parts, r)
    nodes = [x * r for x in nodes]  # cells of one meter
    pairs = sorted(
        {
            tuple(sorted((e[a], e[b])))
            for e in elements.tolist()
            for a, b in ((0, 1), (0, 2), (1, 3), (2, 3), (0, 3), (1, 2))
        }
    )
    bars = np.array(pairs)
    each = [
        bar(nodes[0][p], axial_stiffness, line_density * float(np.linalg.norm(np.diff(nodes[0][p], axis=0))))
        for p in bars
    ]
    K, M = (assemble_elements(bars, np.array(m), 2, len(nodes[0])) for m in zip(*each, strict=True))
    return gathered([K] * len(nodes), [M] * len(nodes), nodes)


def truss(parts, r):
    P = truss_parts(parts, r)
    load = np.zeros_like(P.place)
    load[np.isclose(P.place[:, 0], parts[0] * r), 1] = -10
    return Case(P, load, np.isclose(P.place[:, 0], 0))


def solid(parts, r):
    P = solid_parts(parts, r)
    load, tip = np.zeros_like(P.place), np.isclose(P.place[:, 0], parts[0])
    load[tip] = np.array([0, 0.4, -1.0]) / tip.sum()
    return Case(P, load, np.isclose(P.place[:, 0], 0))


@dataclass(frozen=True)
class Printed:
    """Sizes n_lambda, n_alpha, n_f; norms of lambda, of its start vector and of u_f; energy; steps of CG."""

    sizes: tuple[int, int, int]
    lam: float
    start: float
    u_f: float
    energy: float
    steps: tuple[int, int, int]


MADE = {
    "plane_stress_4": lambda: plane_stress((2, 2), 4),
    "plane_stress_16": lambda: plane_stress((4, 4), 4),
    "truss_4": lambda: truss((2, 2), 3),
    "solid_2": lambda: solid((2, 1, 1), 2),
    "solid_8": lambda: solid((2, 2, 2), 2),
}
PRINTED = {
    "plane_stress_4": Printed((68, 6, 32), 1.06693341, 0.900348175, 0.129956558, 0.0302581922, (22, 15, 12)),
    "plane_stress_16": Printed(
        (396, 36, 180), 1.26212075, 1.15945985, 0.301351764, 0.0267786002, (38, 22, 16)
    ),
    "truss_4": Printed((52, 6, 24), 82.7221283, 73.0480455, 0.00885741751, 0.170807696, (13, 9, 7)),
    "solid_2": Printed((54, 6, 27), 1.44324905, 1.34329611, 0.0391347975, 0.0182470011, (5, 5, 5)),
    "solid_8": Printed((396, 24, 156), 0.665262192, 0.514606444, 0.014973531, 0.00188296888, (41, 14, 13)),
}
# condition without, with lumped, and with Dirichlet preconditioner, and steps; of grids of r elements an edge
GROWTH = {
    ((2, 2), 2): ((16.1, 5.44, 4.26), (15, 10, 8)),
    ((2, 2), 8): ((60.7, 29.4, 9.9), (31, 21, 13)),
    ((2, 2), 4): ((33.1, 13.1, 6.85), (22, 15, 12)),
    ((3, 3), 4): ((42.6, 16.0, 7.83), (34, 20, 14)),
    ((4, 4), 4): ((45.9, 17.2, 8.08), (38, 22, 16)),
    # as measured
    ((2, 2), 16): ((112.4, 61.6, 13.2), (42, 28, 14)),
    ((6, 6), 4): ((48.0, 17.9, 8.13), (44, 26, 17)),
    ((8, 8), 4): ((48.7, 18.2, 8.15), (47, 27, 19)),
}


@cache
def solved(name):
    """A printed case: the system, the load, and its direct solution."""
    case = MADE[name]()
    return case.system, case.force, case.system.solve(case.force)


def free_plate():
    """2 x 2 plates that nothing supports, and the load on them."""
    case = plane_stress((2, 2), 3)
    return case.parts.system(), case.load.ravel()


def assembled(system, force):
    """Displacements (size,) by the assembled stiffness, without any partition."""
    L = system.topology.L
    return spsolve(sp.csc_array(L.T @ sp.block_diag(system.stiffness) @ L), force)


def largest(a, b):
    """The largest difference, of the largest entry of the second."""
    return np.abs(a - b).max() / np.abs(b).max()


def imbalance(system, force, lam):
    """The largest resultant on a partition, and on an interface node, of the load's length."""
    f = system.loads(force)
    node = system.topology.L_f.T @ lam
    part = np.append(system.resultant(f - system.topology.B @ lam), 0.0)
    return max(np.abs(part).max(), np.abs(node).max()) / np.linalg.norm(f)


def bars(pairs, places=SQUARE, axial_stiffness=1.0):
    """Stiffness of bars between nodes (node, 2) m."""
    each = np.array([bar(places[list(pair)], axial_stiffness)[0] for pair in pairs])
    return assemble_elements(np.array(pairs), each, 2, len(places))


def turned(angle, places=SQUARE):
    c, s = np.cos(angle), np.sin(angle)
    return places @ np.array([[c, s], [-s, c]])


def springs(stiffness):
    """A chain of springs, each a partition, the first one fixed at its far end."""
    n = len(stiffness)
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    K = [np.array([[stiffness[0]]]), *(k * pair for k in stiffness[1:])]
    L = [np.eye(n)[:1], *(np.eye(n)[s - 1 : s + 1] for s in range(1, n))]
    R = [np.zeros((1, 0)), *[np.ones((2, 1))] * (n - 1)]
    return PartitionedSystem(K, None, L, R)
