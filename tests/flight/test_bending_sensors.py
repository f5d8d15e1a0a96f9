"""Sensors on a body that bends, against the motion of the point that they stand on."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from forceid.estimation.instruments.on_flight import mounted
from forceid.flight.instruments import INSTRUMENTS
from forceid.flight.instruments.bending import bending
from forceid.flight.instruments.moved import Moved
from forceid.flight.instruments.sensors import Sensors, sensed
from forceid.flight.modes import FlyingModes
from forceid.flight.vibration import Vibration
from forceid.motion.frames import Frames
from forceid.motion.pose import exp
from forceid.motion.products import inertia_products

MASS = np.array([0.05, 0.03, 0.04, 0.02])
X = np.array([[0.2, 0.0, 0.02], [-0.1, 0.15, 0.0], [-0.1, -0.15, -0.02], [0.0, 0.0, 0.05]])
X = X - MASS @ X / MASS.sum()
SHAPES = np.random.default_rng(1).standard_normal((2, 4, 3))
SHAPES = SHAPES - np.einsum("n,kna->ka", MASS, SHAPES)[:, None] / MASS.sum()
PRIOR = Vibration(
    np.array([300.0, 90.0]), np.array([5.0, 40.0]), np.array([1e-3, 2e-3]), np.array([30.0, 20.0])
)
POINTS = np.array([[0.15, 0.02, 0.0], [-0.05, 0.1, 0.02]])
AXES = Rotation.from_rotvec([[0.3, 0.1, -0.2], [-1.0, 0.4, 0.9]]).as_matrix()
FIELD = np.array([40.0, -20.0, 30.0])
STEADY = np.append(FIELD, np.zeros(3))  # and no clock is late
TIME = np.arange(0, 0.06, 2e-4)
INNER = slice(30, -30)


def smooth(values):
    return make_interp_spline(TIME, values, k=9)


def flown():
    """A path with every derivative known, the point of each sensor on it, and what the sensors read."""
    t = TIME[:, None]
    R = (Rotation.from_rotvec([0.2, -0.5, 0.3]) * Rotation.from_rotvec(t * [3.0, -2.0, 50.0])
         * Rotation.from_rotvec(0.1 * np.sin(20 * t) * [1.0, 0.5, 0.0])).as_matrix()  # fmt: skip
    q = np.array([8e-4, 1.5e-3]) * np.sin(np.array([290.0, 80.0]) * t + [0.2, 1.0])
    rate, second = (smooth(q)(TIME, k) for k in (1, 2))
    center = np.array([0.3, -0.2, 0.1]) * np.sin(9 * t)
    x = X + np.einsum("tk,kna->tna", q, SHAPES)
    world = np.einsum("tab,tnb->tna", R, x)
    v = smooth(world)(TIME, 1)
    H = np.einsum("n,tna->ta", MASS, np.cross(world, v))
    Phi, Psi = mounted(X, SHAPES, POINTS)
    gyro, accelerometer, magnetometer = np.empty((3, len(TIME), 2, 3))
    for s in range(2):
        axes = R @ exp(q @ Psi[s]) @ AXES[s]
        spun = smooth(axes)(TIME, 1) @ axes.swapaxes(1, 2)
        omega = np.stack([spun[:, 2, 1], spun[:, 0, 2], spun[:, 1, 0]], 1)
        gyro[:, s] = np.einsum("tab,ta->tb", axes, omega)
        magnetometer[:, s] = FIELD @ axes
        place = center + np.einsum("tab,tb->ta", R, POINTS[s] + q @ Phi[s])
        accelerometer[:, s] = np.einsum("tab,ta->tb", axes, smooth(place)(TIME, 2))
    weighs = inertia_products(MASS, X, SHAPES)
    J, h = weighs.of(q, rate)
    moved = Moved(
        R, H, smooth(H)(TIME, 1), MASS.sum() * smooth(center)(TIME, 2), MASS.sum(),
        J, CubicSpline(TIME, J)(TIME, 1), h, CubicSpline(TIME, h)(TIME, 1),
    )  # fmt: skip
    load = second + 2 * PRIOR.damping * rate + PRIOR.frequency**2 * q
    path = np.stack([q, rate, load], 2).reshape(len(TIME), -1)
    nothing = Frames(*(np.zeros((len(TIME), 0)) for _ in range(6)))
    modes = FlyingModes(nothing, PRIOR, weighs, path, mounting=(Phi, Psi))
    read = np.stack([gyro, accelerometer, magnetometer], 1)
    sensors = Sensors(INSTRUMENTS, read, POINTS, AXES, np.ones((3, 2)), np.ones((3, 2)))
    return sensors, moved, modes


def test_sensors_read_the_motion_of_the_point_they_stand_on():
    sensors, moved, modes = flown()
    rigid = sensed(sensors, moved, STEADY).reading
    bent = rigid + bending(sensors, moved, modes, STEADY)[0]
    off = np.abs(sensors.readings - bent)[INNER].max(0)
    without = np.abs(sensors.readings - rigid)[INNER].max(0)
    assert (off < 1e-4).all()
    assert without[:6].min() > 0.5  # rad/s
    assert without[6:12].min() > 5.0  # m/s2
    assert without[12:].max() > 0.05  # T, of a field of 54


@pytest.mark.parametrize("state", range(6))
def test_slopes_are_those_of_what_is_read(state):
    sensors, moved, modes = flown()
    size = [1e-6, 1e-4, 1.0][state % 3]
    rows = bending(sensors, moved, modes, STEADY)[1]
    read = []
    for sign in (1, -1):
        path = modes.path.copy()
        path[:, state] += sign * size
        there = replace(modes, path=path)
        J, h = modes.products.of(there.amplitude, there.rate)
        dJ, _, _ = modes.products.slopes(there.amplitude, there.rate)
        was, _, _ = modes.products.slopes(modes.amplitude, modes.rate)
        J_rate = moved.inertia_rate + np.einsum("tkij,tk->tij", dJ, there.rate) - np.einsum(
            "tkij,tk->tij", was, modes.rate
        )  # fmt: skip
        now = replace(moved, inertia=J, h=h, inertia_rate=J_rate)
        read.append(sensed(sensors, now, STEADY).reading + bending(sensors, now, there, STEADY)[0])
    slope = (read[0] - read[1]) / (2 * size)
    scale = np.abs(slope).max(0) + 1e-9 * np.abs(slope).max()
    assert (np.abs(rows[:, :, state] - slope)[INNER] / scale).max() < 0.02
