"""A scene moved by MuJoCo, what the surroundings did to it, and the recording that a user would have of it.

Force and moment are the rates of the momenta of what moved, summed body by body by the simulator. Velocities
are differences of the places that the markers show too, over two steps, whatever the integrator means by its
own; a sample stands for the mean over the time of one sample around it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from forceid.records import Array, Body, Flags, Indices, Motion, Recording

STEP = 2.5e-4  # s: of the simulator at most, and at most an eighth of a sample
WEIGHT = 9.81  # m/s2, down
WATCHED_BODY = 1  # of the model: the body that is watched is the first under the world
WHEEL = "wheel"  # joint of a wheel inside the body: the last body, of one moment of inertia about any axis


@dataclass(frozen=True)
class Scene:
    """What is to move: one body, the first of the world, with all that hangs on it.

    inside: the XML of the world; start: the first of its coordinates and of its velocities, the rest is zero;
    drive(data) loads it before every step. options: attributes of the simulator. mass (marker,) kg: the user
    tells masses of markers, and else the whole; at_vertices: markers are the vertices of a soft body, and its
    sites otherwise. joints: bodies that joints hold, whose wrench is asked for. settings: stated to forceid
    beside the file.
    """

    inside: str
    start: tuple[Array, Array]
    drive: Callable[[Any], None] = lambda data: None
    options: str = 'integrator="RK4"'
    gravity: float = WEIGHT
    mass: Array | None = None
    at_vertices: bool = False
    joints: tuple[int, ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Camera:
    """How a scene is watched: rate Hz, samples, noise m; lost: share of the record that some markers miss."""

    rate: float
    samples: int
    noise: float
    stated: bool
    lost: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Camera:
        """100 to 500 Hz, 1 to 2.5 s of 200 to 800 samples, noise of 0.1 to 1 mm, stated or not."""
        rate = float(np.exp(rng.uniform(np.log(100), np.log(500))))
        samples = int(np.clip(rate * rng.uniform(1.0, 2.5), 200, 800))
        noise = 10 ** rng.uniform(-4, -3)
        lost = float(rng.uniform(0.02, 0.08)) if rng.random() < 0.4 else 0.0
        return cls(rate, samples, noise, bool(rng.random() < 0.5), lost)


def model_of(scene: Scene, step: float) -> Any:
    """The model of a scene, that steps so many seconds."""
    import mujoco

    pull = f'gravity="0 0 {-scene.gravity}"'
    options = f'<compiler angle="radian"/><option timestep="{step}" {pull} {scene.options}/>'
    return mujoco.MjModel.from_xml_string(f"<mujoco>{options}{scene.inside}</mujoco>")


def recorded(scene: Scene, camera: Camera, rng: np.random.Generator) -> Recording:
    """The recording of a scene with its truth: force and moment, of joints too where they are asked for."""
    import mujoco

    half = max(4, int(np.ceil(0.5 / camera.rate / STEP)))  # steps in half a sample
    step = 0.5 / camera.rate / half
    model = model_of(scene, step)
    path = moved(scene, model, 2 * half * camera.samples + 2)
    time = np.arange(camera.samples) / camera.rate
    seen = mujoco.MjData(model)  # at the instants that are looked at; the simulation does not feel it
    reference = marker_places(scene, model, seen, model.qpos0)
    middle = 1 + half + 2 * half * np.arange(camera.samples)
    x = np.stack([marker_places(scene, model, seen, path[k]) for k in middle])
    truth = acting_wrenches(model, path, middle, half, step, (WATCHED_BODY, *scene.joints))
    named = {"force": truth[0][:, 0], "moment": truth[0][:, 1]}
    if scene.joints:
        joints = np.stack(truth[1:], 2)  # (time, force and moment, joint, 3)
        named |= {"joint_force": joints[:, 0], "joint_moment": joints[:, 1]}
    x = x + camera.noise * rng.standard_normal(x.shape)
    x[gaps(camera, x.shape[1], rng)] = np.nan
    gravity = np.array([0.0, 0.0, -scene.gravity])
    stated = {"position": camera.noise} if camera.stated else {}
    motion = Motion(time, x, gravity=gravity, noise_std=stated)
    return Recording(watched_body(scene, model, reference), motion, named)


def moved(scene: Scene, model: Any, steps: int) -> Array:
    """Coordinates (steps + 1, nq) of a scene, step by step."""
    import mujoco

    data = mujoco.MjData(model)
    for values, to in zip(scene.start, (data.qpos, data.qvel), strict=True):
        to[: len(values)] = values
    mujoco.mj_forward(model, data)
    path = np.empty((steps + 1, model.nq))
    path[0] = data.qpos
    for k in range(steps):
        scene.drive(data)
        mujoco.mj_step(model, data)
        path[k + 1] = data.qpos
    bad = mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC
    if any(data.warning[kind].number for kind in bad):  # and began again from where it started
        raise FloatingPointError("the simulator lost the scene")
    return path


def marker_places(scene: Scene, model: Any, seen: Any, q: Array) -> Array:
    """Places (marker, 3) m at coordinates q."""
    import mujoco

    seen.qpos = q
    mujoco.mj_kinematics(model, seen)
    return np.array(seen.xpos[WATCHED_BODY + 1 :] if scene.at_vertices else seen.site_xpos)


def acting_wrenches(
    model: Any, path: Array, middle: Indices, half: int, step: float, of: tuple[int, ...]
) -> list[Array]:
    """Force and moment (time, 2, 3) that act on each body with all that hangs on it, weight excluded.

    The moment on the first is about its mass center, on others about their origin, where their joint is. What
    changes the rate of a wheel, as seen from the body, counts as a moment on the body: it shows as one.
    """
    import mujoco

    ends = np.append(middle - half, middle[-1] + half)
    data, speed = mujoco.MjData(model), np.empty(model.nv)
    wheel = [model.joint(j).dofadr[0] for j in range(model.njnt) if model.joint(j).name == WHEEL]
    momenta, turning = np.empty((len(ends), len(of), 2, 3)), np.zeros(len(ends))
    for i, k in enumerate(ends):
        mujoco.mj_differentiatePos(model, speed, 2 * step, path[k - 1], path[k + 1])
        data.qpos, data.qvel = path[k], speed
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_subtreeVel(model, data)
        for j, body in enumerate(of):
            mass = model.body_subtreemass[body]
            momenta[i, j] = mass * data.subtree_linvel[body], data.subtree_angmom[body]
        turning[i] = speed[wheel[0]] if wheel else 0.0
    rate = np.diff(momenta, axis=0) / (2 * half * step)
    rate[:, :, 0] -= np.outer(model.body_subtreemass[list(of)], model.opt.gravity).reshape(-1, 3)
    for i, k in enumerate(middle):
        data.qpos = path[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for j, body in enumerate(of[1:], 1):
            rate[i, j, 1] += np.cross(data.subtree_com[body] - data.xpos[body], rate[i, j, 0])
        if wheel:
            spun = (turning[i + 1] - turning[i]) / (2 * half * step)
            rate[i, 0, 1] -= spun * model.body_inertia[-1, 0] * data.xaxis[-1]
    return list(rate.swapaxes(0, 1))


def gaps(camera: Camera, markers: int, rng: np.random.Generator) -> Flags:
    """Which readings (time, marker) are missing: in a run of frames, of up to a third of the markers."""
    missing = np.zeros((camera.samples, markers), bool)
    if camera.lost:
        for marker in rng.permutation(markers)[: max(1, markers // 3)]:
            length = max(1, int(camera.lost * camera.samples * rng.uniform(0.3, 1.7)))
            first = rng.integers(0, camera.samples - length)
            missing[first : first + length, marker] = True
    return missing


def watched_body(scene: Scene, model: Any, reference: Array) -> Body:
    """The body as its user tells it: masses of its markers, or what it is as a whole."""
    import mujoco

    names = tuple(f"m{k}" for k in range(len(reference)))
    if scene.mass is not None:
        return Body(names, reference, scene.mass)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    center, J = data.subtree_com[WATCHED_BODY], np.zeros((3, 3))
    for k in range(WATCHED_BODY, model.nbody):
        off, R = data.xipos[k] - center, data.ximat[k].reshape(3, 3)
        J += R @ np.diag(model.body_inertia[k]) @ R.T
        J += model.body_mass[k] * (off @ off * np.eye(3) - np.outer(off, off))
    mass = float(model.body_subtreemass[WATCHED_BODY])
    return Body(names, reference, total_mass=mass, mass_center=np.array(center), inertia=0.5 * (J + J.T))
