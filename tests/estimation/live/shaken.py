"""A rigid body of four markers that tumbles and is shaken, its force known at every time."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.live.run import followed_live, live_pace
from forceid.records import Body, Motion, Recording

RATE, MASS, NOISE = 200.0, 0.08, 2e-4
WEIGHT = np.array([0.0, 0.0, -9.81])
TIPS = np.array([[0.1, 0.0, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.1, 0.0, 0.1]])
TIPS = TIPS - TIPS.mean(0)
BODY = Body(("a", "b", "c", "d"), TIPS, np.full(4, MASS / 4))
SHAKE, SPEED = np.array([0.05, 0.03, 0.02]), 2 * np.pi * np.array([1.0, 1.7, 2.3])


def force(t):
    """Force (time, 3) N at times t (time,)."""
    return -MASS * (SHAKE * SPEED**2 * np.sin(SPEED * np.asarray(t)[:, None]) + WEIGHT)


def frames(count, seed=3):
    """Times and positions of a number of frames."""
    t = np.arange(count) / RATE
    spin = Rotation.from_rotvec(np.outer(6.0 * t, [0.0, 0.0, 1.0]))
    R = (spin * Rotation.from_rotvec(np.outer(0.2 * np.sin(3 * t), [1.0, 0.0, 0.0]))).as_matrix()
    noise = NOISE * np.random.default_rng(seed).standard_normal((count, *TIPS.shape))
    return t, np.einsum("tab,nb->tna", R, TIPS) + (SHAKE * np.sin(SPEED * t[:, None]))[:, None] + noise


def recording(count=300):
    """A motion file of that body."""
    t, x = frames(count)
    return Recording(BODY, Motion(t, x, gravity=WEIGHT, noise_std={"position": NOISE}))


@cache
def body_file():
    """The body, with some of its motion."""
    return recording()


def followed(t, x, tell=lambda _: None, on_file=True, **pace):
    """The wrenches of frames, tuned on the file of the body unless asked otherwise."""
    given = {"lag": None, "first": None, "retune": np.inf} | pace
    stream = zip(np.asarray(t).tolist(), x, strict=True)
    return list(followed_live(stream, body_file(), load_settings(), live_pace(**given), on_file, tell))


def off(wrenches):
    """Error (time, 3) of the force, and what is claimed."""
    error = np.array([w.force for w in wrenches]) - force([w.time for w in wrenches])
    return error, np.array([w.force_std for w in wrenches])
