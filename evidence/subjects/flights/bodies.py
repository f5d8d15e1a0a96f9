"""Bodies flown under drawn loads: the exact motion of every marker, and the exact wrench.

Force and moment are written down, and with them momentum and angular momentum; only the rotation is
integrated, from the angular momentum, by DOP853. A body may vibrate in modes in the mass gauge, whose
amplitudes are written down too. No code is shared with the estimators. Source: principal equations 2.4, 4b.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.subjects.flights.drawn_loads import Drawn, draw_matern
from forceid.records import Array, Body
from forceid.scenes.mechanics import inertia_tensor, solve_ode

X = np.array(
    [
        [0.13, 0.02, 0.01], [-0.11, 0.05, -0.03], [0.01, 0.10, 0.04], [-0.02, -0.12, 0.02],
        [0.05, -0.04, 0.08], [-0.04, 0.03, -0.09], [0.08, 0.07, -0.04], [-0.09, -0.06, 0.05],
    ]
)  # fmt: skip
MASS = np.array([0.045, 0.035, 0.040, 0.030, 0.042, 0.038, 0.033, 0.037])  # kg, 0.3 in all
PLACE = X - MASS @ X / MASS.sum()  # m, about the mass center
INERTIA = inertia_tensor(MASS, PLACE)
INERTIA_INVERSE = np.linalg.inv(INERTIA)
NODES = tuple(f"m{k + 1}" for k in range(len(MASS)))
TOLERANCE = 1e-10


@dataclass(frozen=True)
class Setup:
    """What flies, and under what. frames at rate Hz; spin rev/s about the body's third axis, and rad/s of
    wobble. force_std N, moment_std N m: Matern loads of load_rate 1/s. modes: how many of the body's own
    shapes vibrate, of size m (rms of a marker) at mode_frequency Hz, and each next 1.3 times as fast. impulse
    N s: Gaussian pulse of pulse_width s in the middle; line N: amplitude of a force at twice the spin. speed
    m/s at the start; hovers: it starts so that it goes nowhere instead.
    """

    frames: int = 240
    rate: float = 200.0
    spin: float = 2.0
    wobble: float = 1.0
    force_std: float = 1.0
    moment_std: float = 0.02
    load_rate: float = 20.0
    modes: int = 0
    size: float = 1e-3
    mode_frequency: float = 18.0
    impulse: float = 0.0
    pulse_width: float = 1.0
    line: float = 0.0
    gravity: float = 9.81
    speed: float = 4.0
    hovers: bool = False


@dataclass(frozen=True)
class Flown:
    """An exact flight at its instants. position (time, node, 3) m; rotation (time, 3, 3) body to world;
    inertia (time, 3, 3) kg m2 and h (time, 3) of the deformation in body axes; body: as it truly is.
    """

    setup: Setup
    time: Array
    position: Array
    rotation: Array
    inertia: Array
    h: Array
    body: Body
    truth: dict[str, Array]

    @property
    def gravity(self) -> Array:
        """Weight per mass (3,) m/s2."""
        return np.array([0.0, 0.0, -self.setup.gravity])


def fly(
    setup: Setup,
    rng: np.random.Generator,
    time: Array | None = None,
    shapes: Array | None = None,
    mixed: Array | None = None,
) -> Flown:
    """The flight of a setup at its regular instants, or at `time` (time,) s, none before zero.

    shapes (mode, node, 3): in which it vibrates, in place of the body's own, in the mass gauge; mixed (3, 3):
    directions, as columns, along which the three components of the force are drawn, in place of x, y, z.
    """
    span = setup.frames / setup.rate
    time = np.arange(setup.frames) / setup.rate if time is None else time
    force = draw_matern(setup.force_std, setup.load_rate, span, rng)
    parts = force.at(time)
    if mixed is not None:
        force = replace(force, a=force.a @ mixed.T, b=force.b @ mixed.T)
    force = with_extras(force, setup, span)
    moment = draw_matern(setup.moment_std, setup.load_rate, span, rng)
    shapes = mass_gauge_shapes(setup.modes) if shapes is None else shapes
    faster = 1.3 ** np.arange(setup.modes)
    w = 2 * np.pi * setup.mode_frequency * faster * rng.uniform(0.97, 1.03, setup.modes)
    phase = rng.uniform(0, 2 * np.pi, setup.modes)
    start = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    turning = np.array([setup.wobble, -0.6 * setup.wobble, 2 * np.pi * setup.spin])

    def deformed(t: Array) -> tuple[Array, Array, Array]:
        q = np.sqrt(2) * setup.size * np.sin(np.multiply.outer(t, w) + phase)
        dq = np.sqrt(2) * setup.size * w * np.cos(np.multiply.outer(t, w) + phase)
        u, du = (np.einsum("tk,kna->tna", v, shapes) for v in (q, dq))
        place = PLACE + u
        square = np.einsum("n,tna,tnb->tab", MASS, place, place)
        J = np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3) - square
        return place, J, np.einsum("n,tna->ta", MASS, np.cross(place, du))

    _, J0, h0 = deformed(np.zeros(1))
    H0 = start @ (J0[0] @ turning + h0[0])
    lone = np.zeros(1)

    def rate(t: float, y: Array) -> Array:
        lone[0] = t
        R = y.reshape(3, 3)
        H = H0 + moment.impulse(lone)[0]
        if setup.modes:
            _, J, h = deformed(lone)
            omega = R @ np.linalg.solve(J[0], R.T @ H - h[0])
        else:
            omega = R @ (INERTIA_INVERSE @ (R.T @ H))
        a, b, c = omega
        return np.asarray((np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]]) @ R).ravel())

    R = solve_ode(rate, start.ravel(), time, TOLERANCE).reshape(-1, 3, 3)
    place, J, h = deformed(time)
    t, mass = time[:, None], MASS.sum()
    weight = np.array([0.0, 0.0, -setup.gravity])
    gained = force.impulse(time) / mass
    begin = -gained.mean(0) if setup.hovers else setup.speed * np.array([0.5, 0.2, 1.0])
    truth = {
        "time": time,
        "force": force.at(time),
        "moment": moment.at(time),
        "load": parts,
        "center": begin * t + 0.5 * weight * t**2 + force.second(time) / mass,
        "velocity": begin + weight * t + gained,
        "orientation": Rotation.from_matrix(R).as_quat(canonical=True),
        "angular_momentum": H0 + moment.impulse(time),
    }
    in_body = np.einsum("tba,tb->ta", R, truth["angular_momentum"]) - h
    turning = np.linalg.solve(J, in_body[..., None])[..., 0]
    truth["angular_velocity"] = np.einsum("tab,tb->ta", R, turning)
    x = truth["center"][:, None] + np.einsum("tab,tnb->tna", R, place)
    body = Body(node=NODES, position=PLACE, mass=MASS)
    return Flown(setup, time, x, R, J, h, body, truth)


def with_extras(force: Drawn, setup: Setup, span: float) -> Drawn:
    """The force with its pulse in the middle of the record and its line at twice the spin."""
    turn = np.array([[1.0, 0.5, 0.2], [-0.5, 1.0, 0.3]]) * setup.line / np.sqrt(1.25)
    return replace(
        force,
        w=np.append(force.w, 4 * np.pi * max(setup.spin, 1e-3)),
        a=np.concatenate([force.a, turn[:1]]),
        b=np.concatenate([force.b, turn[1:]]),
        pulse=setup.impulse * np.array([0.8, -0.5, 0.3]),
        when=0.5 * span,
        width=setup.pulse_width,
    )


@lru_cache(maxsize=8)
def mass_gauge_shapes(count: int) -> Array:
    """Shapes (mode, node, 3) of one meter rms a node, that move neither mass center nor angular momentum."""
    rng = np.random.default_rng(5)
    found: list[Array] = []
    for _ in range(count):
        shape = rng.standard_normal((3, 3))
        bent = np.sin(PLACE / 0.05 @ shape) @ rng.standard_normal((3, 3))
        found.append(in_mass_gauge(bent, found))
    return np.array(found).reshape(-1, *PLACE.shape)


def in_mass_gauge(shape: Array, others: list[Array]) -> Array:
    """A shape (node, 3) less its rigid motion and the others, in the metric of the mass, of one meter rms."""
    turns = np.cross(np.eye(3)[None], PLACE[:, None]).swapaxes(1, 2)
    rigid = np.concatenate([np.tile(np.eye(3), (len(PLACE), 1, 1)), turns], 2).reshape(-1, 6)
    base = np.column_stack([rigid, *(o.ravel() for o in others)])
    weight, v = np.repeat(MASS, 3), shape.ravel()
    v = v - base @ np.linalg.solve(base.T @ (weight[:, None] * base), base.T @ (weight * v))
    return np.asarray((v / np.sqrt((v**2).sum() / len(PLACE))).reshape(PLACE.shape))
