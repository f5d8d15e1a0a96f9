"""Failures of load and body: impacts, lines, wrong mass and shape, vibration, shapes that look rigid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evidence.stress.failure import failure
from evidence.subjects.flights.bodies import INERTIA, MASS, PLACE, Setup, in_mass_gauge, mass_gauge_shapes
from evidence.subjects.flights.failures.record import Faulty, measured, unseen
from forceid.records import Array
from forceid.scenes.springs import connect, spring_stiffness

SHORT = 160  # frames of a body that bends
NODES_MARKED = 5  # of its nodes, where some carry none


@failure("load", "Impact", "s", (0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 5e-4))
def impact(level: float, rng: np.random.Generator) -> Faulty:
    """A pulse shorter than the prior remembers, or than a frame."""
    return measured(Setup(impulse=0.1, pulse_width=level), rng)


@failure("load", "Load at twice the spin", "N", (0, 0.003, 0.01, 0.03, 0.1, 0.3, 1, 3))
def spin_load(level: float, rng: np.random.Generator) -> Faulty:
    """A prior that falls with frequency takes an oscillation for noise."""
    return measured(Setup(spin=6.0, line=level), rng)


@failure("body", "Mass wrong", "share", (0, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1))
def mass(level: float, rng: np.random.Generator) -> Faulty:
    """Force is mass times acceleration: no motion reveals the mass."""
    return replace(measured(Setup(), rng).with_body(mass=MASS * (1 + level)), misstated=("mass", 100 * level))


@failure("body", "Inertia wrong", "share", (0, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.5, 1))
def inertia(level: float, rng: np.random.Generator) -> Faulty:
    """A body that turns freely about another axis than the inertia says shows a moment."""
    size, axes = np.linalg.eigh(INERTIA)
    claimed = axes * (size * [1.0, 1.0 + level, 1.0]) @ axes.T
    case = measured(Setup(), rng, place=PLACE).with_body(inertia=claimed)
    return replace(case, misstated=("inertia", 100 * level))


@failure("body", "Mass center wrong", "m", (0, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03))
def mass_center(level: float, rng: np.random.Generator) -> Faulty:
    """A point off the mass center is accelerated by the spin."""
    off = level * np.array([0.6, 0.6, 0.53])
    case = measured(Setup(), rng, place=PLACE).with_body(mass_center=off)
    return replace(case, misstated=("center", 1e3 * level))


@failure("body", "Marker misplaced", "m", (0, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1))
def marker_place(level: float, rng: np.random.Generator) -> Faulty:
    """The axes of the body are laid by where its markers are said to be."""
    claimed = PLACE.copy()
    claimed[0] += level * np.array([0.4, -0.8, 0.45])
    case = measured(Setup(), rng, place=PLACE).with_body(position=claimed)
    return replace(case, misstated=("marker", 1e3 * level))


@failure("load", "Load directions nearly alike", "degrees", (90, 45, 20, 8, 3, 1, 0.1, 0))
def load_directions(level: float, rng: np.random.Generator) -> Faulty:
    """The wrench shows the sum of two loads along one direction, not their split."""
    at = np.radians(level)
    mixed = np.array([[1.0, np.cos(at), 0.0], [0.0, np.sin(at), 0.0], [0.0, 0.0, 1.0]])
    loads: list[dict[str, object]] = [
        {"name": name, "direction": tuple(mixed[:, k]), "axes": "world"}
        for k, name in enumerate(("first", "second", "third"))
    ]
    loads += [
        {"name": f"moment {k}", "direction": tuple(np.eye(3)[k]), "axes": "world", "kind": "moment"}
        for k in range(3)
    ]
    return replace(measured(Setup(), rng, mixed=mixed), settings={"load": loads}, mixed=mixed)


@failure(
    "deformation", "Size of the vibration", "m rms", (1e-5, 1e-4, 3e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02),
    deforms=True,
)  # fmt: skip
def vibration(level: float, rng: np.random.Generator) -> Faulty:
    """The inertia and the angular momentum of the deformation are not those of a rigid body."""
    return measured(Setup(frames=SHORT, modes=2, size=level), rng)


@failure("deformation", "Number of vibrating modes", "modes", (0, 1, 2, 3, 5, 7, 9, 12), deforms=True)
def several_modes(level: float, rng: np.random.Generator) -> Faulty:
    """More shapes than the record can tell from noise."""
    return measured(Setup(frames=SHORT, modes=int(level), size=5e-4, mode_frequency=9.0), rng)


@failure("deformation", "Mode in the band of the force", "Hz", (40, 25, 15, 10, 6, 4, 2, 1), deforms=True)
def slow_mode(level: float, rng: np.random.Generator) -> Faulty:
    """A mode as slow as the load moves the markers as the load does."""
    setup = Setup(frames=SHORT, modes=1, size=2e-3, mode_frequency=level)
    return partly_marked(measured(setup, rng), mass_gauge_shapes(1))


@failure(
    "deformation", "Mode that looks rigid", "sine of the angle", (1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 1e-3),
    deforms=True,
)  # fmt: skip
def rigid_looking_mode(level: float, rng: np.random.Generator) -> Faulty:
    """Where the markers are, the mode moves them as a turn does."""
    shape = rigid_looking_shape(level)[None]
    setup = Setup(frames=SHORT, modes=1, size=2e-3)
    return partly_marked(measured(setup, rng, shapes=shape), shape)


def rigid_looking_shape(sine: float) -> Array:
    """A shape (node, 3) in the mass gauge, which on the marked nodes is a turn but for `sine`."""
    seen = PLACE[:NODES_MARKED]
    turn = np.cross([0.3, 0.9, 0.3], seen).ravel()
    rigid = np.concatenate(
        [np.tile(np.eye(3), (NODES_MARKED, 1, 1)), np.cross(np.eye(3)[None], seen[:, None]).swapaxes(1, 2)], 2
    ).reshape(-1, 6)
    bent = np.sin(seen / 0.05 @ np.array([[1.0, 0.4, -0.7], [0.3, -1.0, 0.6], [0.5, 0.8, 0.9]])).ravel()
    bent -= rigid @ np.linalg.lstsq(rigid, bent, rcond=None)[0]
    wanted = np.sqrt(1 - sine**2) * turn / np.linalg.norm(turn) + sine * bent / np.linalg.norm(bent)
    # the unmarked nodes take up momentum and angular momentum, and move as little as that takes
    arms = np.concatenate(
        [np.tile(np.eye(3), (len(PLACE), 1, 1)), np.cross(np.eye(3)[None], PLACE[:, None]).swapaxes(1, 2)], 2
    )
    momentum = (MASS[:, None, None] * arms).reshape(-1, 6).T
    seen_part, rest = momentum[:, : 3 * NODES_MARKED], momentum[:, 3 * NODES_MARKED :]
    others = np.linalg.lstsq(rest, -seen_part @ wanted, rcond=None)[0]
    shape = np.concatenate([wanted, others]).reshape(PLACE.shape)
    return in_mass_gauge(shape, [])


def partly_marked(case: Faulty, shapes: Array) -> Faulty:
    """The case with markers on the first nodes only, and the shapes in the file."""
    lost = np.zeros_like(case.seen)
    lost[:, NODES_MARKED:] = True
    return unseen(case, lost).with_body(mode_shape=shapes)


@failure(
    "deformation", "Markers nearly in a plane", "thickness / width", (1, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3,
    0), deforms=True,
)  # fmt: skip
def flat_markers(level: float, rng: np.random.Generator) -> Faulty:
    """A stretch normal to the plane moves no marker."""
    return measured(Setup(frames=SHORT), rng, place=PLACE * [1.0, 1.0, level])


@failure(
    "deformation", "Jump of the stiffness", "ratio", (1, 10, 100, 1e3, 1e4, 1e6, 1e8, 1e10), deforms=True,
)  # fmt: skip
def stiffness_jump(level: float, rng: np.random.Generator) -> Faulty:
    """Rounding of the stiff part drowns the soft one."""
    pairs = np.argwhere(np.triu(np.ones((len(PLACE), len(PLACE))), k=1))
    stiff = (pairs < 4).all(1)
    network = connect(PLACE, pairs, np.where(stiff, 300.0 * level, 300.0), 0.0)
    K = spring_stiffness(network, PLACE)
    weight = np.repeat(MASS, 3) ** -0.5
    square, modes = np.linalg.eigh(weight[:, None] * K * weight)
    shape = in_mass_gauge((weight * modes[:, 6]).reshape(PLACE.shape), [])
    frequency = float(np.sqrt(square[6])) / (2 * np.pi)
    setup = Setup(frames=SHORT, modes=1, size=1e-3, mode_frequency=frequency)
    case = measured(setup, rng, shapes=shape[None])
    lost = np.zeros_like(case.seen)
    lost[:, NODES_MARKED:] = True
    return unseen(case, lost).with_body(stiffness=K)
