"""A spinning body in closed form, which the chart is tried on."""

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.records import Body, Motion, Recording

HIGHEST = 3.0  # Hz, of loads


def spinning(markers, frames):
    """A rigid body of 0.2 kg that spins about a principal axis under a force and a moment at random.

    In closed form: the path of the center and the angle of the spin are sums of tones of random size, as
    dense as the record tells apart, and the loads follow. Noise 0.3 mm.
    """
    rng = np.random.default_rng(markers)
    time, J, gravity = np.arange(frames) / 500.0, np.diag([4e-4, 5e-4, 7e-4]), np.array([0.0, 0.0, -9.81])
    X = rng.uniform(-0.1, 0.1, (markers, 3))
    rate = 2 * np.pi * np.arange(0.3, HIGHEST, 0.9 / time[-1])
    push = rng.standard_normal((2, len(rate), 4)) / (1 + (rate[:, None] / 8.0) ** 2) / np.sqrt(len(rate))
    phase = np.outer(time, rate)
    load = np.cos(phase) @ push[0] + np.sin(phase) @ push[1]  # N / 0.2 kg, rad/s2
    path = -(np.cos(phase) @ (push[0] / rate[:, None] ** 2) + np.sin(phase) @ (push[1] / rate[:, None] ** 2))
    center = 5 * path[:, :3] + 0.5 * np.outer(time**2, gravity)
    R = Rotation.from_rotvec(np.outer(6.0 * time + 20 * path[:, 3], [0.0, 0.0, 1.0])).as_matrix()
    x = center[:, None] + X @ R.swapaxes(1, 2) + 3e-4 * rng.standard_normal((frames, markers, 3))
    node = tuple(f"m{i}" for i in range(markers))
    body = Body(node=node, position=X, total_mass=0.2, mass_center=np.zeros(3), inertia=J)
    truth = {"force": load[:, :3], "moment": 20 * np.outer(load[:, 3], J[2])}
    return Recording(body, Motion(time, x, gravity=gravity, noise_std={"position": 3e-4}), truth)
