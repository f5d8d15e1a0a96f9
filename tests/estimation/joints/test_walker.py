"""Joint forces and moments of a walker on one leg beside the recursion of Newton and Euler.

Four rigid segments turn about ball joints by closed forms of seven harmonics; the shank stands on the ground,
whose load is found.
The recursion of a textbook (Winter, Biomechanics and Motor Control of Human Movement, ch. 5, in space) takes
accelerations by differences of these forms, and shares nothing with the estimate.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import KnownLoadSetting, load_settings
from forceid.errors import ConfigError
from forceid.estimation.run import estimate_recording
from forceid.records import Body, KnownLoads, Motion, Recording

GRAVITY = np.array([0.0, 0.0, -9.81])
RATE, NOISE, SAMPLES = 100.0, 1e-3, 110  # Hz, m
SEGMENTS = {  # mass kg, from joint to joint m, center as a part of that, gyration as a part of its length
    "shank": (4.0, (0.0, 0.0, 0.50), 0.50, 0.35), "thigh": (7.0, (0.0, 0.0, 0.42), 0.57, 0.32),
    "trunk": (44.0, (0.0, 0.18, 0.0), 0.5, 1.2), "swing_leg": (11.0, (0.0, 0.0, -0.92), 0.40, 0.33),
}  # fmt: skip
UP = {"trunk": np.array([0.0, 0.0, 0.35])}  # m: its center is above the line of the hips
JOINTS = {"knee": ("shank", "thigh"), "hip": ("thigh", "trunk"), "swing_hip": ("trunk", "swing_leg")}
NAMES = list(SEGMENTS)
INNER = slice(20, -20)


def rotations(t, seed):
    """How every segment stands (time, 3, 3), by name: all swing, the trunk less."""
    rng, found = np.random.default_rng(seed), {}
    for name in NAMES:
        size = 0.12 if name == "trunk" else 0.4
        angle = np.zeros((len(t), 3))
        for axis, part in enumerate((0.25, 1.0, 0.2)):
            for k in range(1, 8):
                phase, weight = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.0) / k**2
                angle[:, axis] += part * size * weight * np.sin(2 * np.pi * 0.8 * k * t + phase)
        found[name] = Rotation.from_euler("xyz", angle).as_matrix()
    return found


def posed(t, seed):
    """Places (time, 3) m of the near end of every segment, the joint to the one before, and rotations."""
    R, at, found = rotations(t, seed), np.zeros((len(t), 3)), {}
    for name in NAMES:
        found[name] = at
        at = at + R[name] @ np.array(SEGMENTS[name][1])
    return found, R


def inertia(name):
    mass, along, _, gyration = SEGMENTS[name]
    length = np.linalg.norm(along)
    return mass * (gyration * length) ** 2 * np.diag([1.0, 0.9, 0.4] if name != "trunk" else [1.0, 0.9, 0.5])


def center_of(name):
    return SEGMENTS[name][2] * np.array(SEGMENTS[name][1]) + UP.get(name, 0.0)


def recursion(t, seed, h=2e-4):
    """Force (time, joint, 3) and moment about each joint that the segment before has on the one behind."""

    def centers(s):
        near, R = posed(s, seed)
        return {n: near[n] + R[n] @ center_of(n) for n in NAMES}, R

    def momenta(s):
        (_, before), (_, here), (_, after) = (posed(s + d, seed) for d in (-h, 0.0, h))
        found = {}
        for n in NAMES:
            omega = Rotation.from_matrix(after[n] @ before[n].mT).as_rotvec() / (2 * h)
            found[n] = np.einsum("tab,bc,tdc,td->ta", here[n], inertia(n), here[n], omega)
        return found

    near, _ = posed(t, seed)
    c, _ = centers(t)
    ahead, behind, up, down = centers(t + h)[0], centers(t - h)[0], momenta(t + h), momenta(t - h)
    force, moment, out = np.zeros((len(t), 3)), np.zeros((len(t), 3)), []
    for k in range(len(NAMES) - 1, 0, -1):
        name, mass = NAMES[k], SEGMENTS[NAMES[k]][0]
        a = (ahead[name] - 2 * c[name] + behind[name]) / h**2
        rate = (up[name] - down[name]) / (2 * h)
        distal = near[NAMES[k + 1]] if k + 1 < len(NAMES) else near[name]
        total = mass * (a - GRAVITY) + force  # what the joint gives, for itself and all beyond
        moment = rate + moment + np.cross(distal - c[name], force) - np.cross(near[name] - c[name], total)
        force = total
        out.append((force, moment))
    forces, moments = zip(*out[::-1], strict=True)
    return np.stack(forces, 1), np.stack(moments, 1)


def walked(seed):
    """Four markers a segment, on the skin by their noise alone; masses and centers by the settings."""
    rng, t = np.random.default_rng(100 + seed), np.arange(SAMPLES) / RATE
    near, R = posed(t, seed)
    still, _ = {n: np.zeros(3) for n in NAMES}, None
    base, shape, tracks, parts = np.zeros(3), [], [], []
    for name in NAMES:
        still[name] = base
        own = center_of(name) + rng.uniform(-1, 1, (4, 3)) * [0.08, 0.08, 0.12]
        shape.append(base + own)
        tracks.append(near[name][:, None] + np.einsum("tab,nb->tna", R[name], own))
        k = 4 * NAMES.index(name)
        parts.append({
            "name": name, "nodes": list(range(k, k + 4)), "mass": SEGMENTS[name][0], "rigid": True,
            "center": tuple((base + center_of(name)).tolist()), "inertia": inertia(name).tolist(),
            "external": name == "shank",
        })  # fmt: skip
        base = base + np.array(SEGMENTS[name][1])
    x = np.concatenate(tracks, 1)
    x = x + NOISE * rng.standard_normal(x.shape)
    joints = [
        {"name": j, "parts": pair, "at": tuple(still[pair[1]].tolist()), "kind": "ball", "driven": True}
        for j, pair in JOINTS.items()
    ]
    body = Body(
        tuple(f"m{k}" for k in range(x.shape[1])), np.concatenate(shape), mass=np.full(x.shape[1], 66 / 16)
    )
    recording = Recording(body, Motion(t, x, gravity=GRAVITY, noise_std={"position": NOISE}))
    return recording, load_settings(part=parts, joint=joints, model="rigid", internal_momentum=(0, 0, 0)), t


def test_the_recursion_ends_with_all_of_the_weight_in_the_mean():
    t = np.arange(0, 2.5, 0.002)  # two periods
    force, _ = recursion(t, 0)
    above = sum(SEGMENTS[n][0] for n in NAMES[1:])
    assert np.allclose(force[:-1, 0].mean(0), [0, 0, 9.81 * above], atol=0.01 * 9.81 * above)


def on_a_plate(recording, settings, t, seed):
    """The same whose ground load is measured by a plate, in place of being found."""
    force, moment = recursion(t, seed)
    near, R = posed(t, seed)
    c, mass = near["shank"] + R["shank"] @ center_of("shank"), SEGMENTS["shank"][0]
    h = 2e-4

    def at(s):
        near, R = posed(s, seed)
        return near["shank"] + R["shank"] @ center_of("shank"), R["shank"]

    (before, Rb), (here, Rh), (after, Ra) = at(t - h), at(t), at(t + h)
    omega = Rotation.from_matrix(Ra @ Rb.mT).as_rotvec() / (2 * h)
    spin = np.einsum("tab,bc,tdc,td->ta", Rh, inertia("shank"), Rh, omega)
    rate = np.gradient(spin, t, axis=0)
    knee = near["thigh"]
    ground = mass * ((after - 2 * here + before) / h**2 - GRAVITY) + force[:, 0]
    about = rate + moment[:, 0] + np.cross(knee - c, force[:, 0]) + np.cross(c, ground)
    loads = KnownLoads(t, ("plate",), ground[:, None], about[:, None], point=np.zeros((len(t), 1, 3)))
    parts = [p.model_copy(update={"external": False}) for p in settings.part]
    plate = KnownLoadSetting(name="plate", part="shank")
    told = settings.model_copy(update={"part": tuple(parts), "known_load": (plate,)})
    return replace(recording, known_loads=loads), told


@pytest.mark.long
def test_a_plate_under_a_part_takes_the_place_of_the_load_on_it():
    recording, settings, t = walked(0)
    found = estimate_recording(*on_a_plate(recording, settings, t, 0)).interface
    for true, loads, std in zip(
        recursion(t, 0), (found.force, found.moment), (found.force_std, found.moment_std), strict=True
    ):
        error = (loads - true)[INNER]
        assert np.sqrt((error**2).mean()) < 0.1 * np.sqrt((true[INNER] ** 2).mean())
        assert np.sqrt((error**2).mean()) < 1.5 * np.sqrt((std[INNER] ** 2).mean())
    assert found.dof == 6


@pytest.mark.long
def test_a_known_load_beside_parts_says_on_which_it_acts():
    recording, settings, t = walked(0)
    beside, told = on_a_plate(recording, settings, t, 0)
    for part in (None, "arm"):
        plate = KnownLoadSetting(name="plate", part=part)
        with pytest.raises(ConfigError, match="does not say which part"):
            estimate_recording(beside, told.model_copy(update={"known_load": (plate,)}))
    with pytest.raises(ConfigError, match="of a body that is whole"):
        estimate_recording(beside, load_settings(known_load=[{"name": "plate", "part": "shank"}]))


@pytest.mark.long
def test_joint_loads_of_a_walker_are_those_of_the_recursion():
    recording, settings, t = walked(0)
    found, (force, moment) = estimate_recording(recording, settings).interface, recursion(t, 0)
    for true, loads in ((force, found.force), (moment, found.moment)):
        error = (loads - true)[INNER]
        assert np.sqrt((error**2).mean()) < 0.06 * np.sqrt((true[INNER] ** 2).mean())
    assert found.verdict.level == "ok"


@pytest.mark.long
def test_joint_moments_of_drawn_walkers_err_by_what_they_claim():
    """All moments of ten walkers together: asked is an error over claim of 0.7 to 1.4."""
    squares = []
    for seed in range(1000, 1010):
        recording, settings, t = walked(seed)
        found, (_, moment) = estimate_recording(recording, settings).interface, recursion(t, seed)
        squares.append((((found.moment - moment) / found.moment_std)[INNER] ** 2).mean((0, 2)))
    each = np.sqrt(np.mean(squares, axis=0))
    assert 0.7 < np.sqrt(np.mean(squares)) < 1.4
    assert (each < 1.4).all()
