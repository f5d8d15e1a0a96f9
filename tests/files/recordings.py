"""Small recordings that the tests of the files share."""

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.records import Body, Estimate, Finding, Loads, ModalForces, Motion, Recording, Verdict


def markers(n=20, nodes=4, seed=0):
    """A recording of markers with a gap, noise stated, and a truth on a time of its own."""
    rng = np.random.default_rng(seed)
    position = rng.standard_normal((n, nodes, 3))
    position[3:5, 0] = np.nan
    names = tuple(f"marker_{k}" for k in range(nodes))
    body = Body(node=names, position=rng.standard_normal((nodes, 3)), mass=rng.random(nodes) + 0.1)
    motion = Motion(
        np.arange(n) / 100, position, gravity=np.array([0, 0, -9.81]), noise_std={"position": 1e-3}
    )
    truth = {"time": np.arange(2 * n) / 200, "force": rng.standard_normal((2 * n, 3))}
    return Recording(body, motion, truth, "title", "source", "history")


def mean_motion(n=20, seed=1):
    """A recording of center and orientation with sensors, strain, modes and a full set of body variables."""
    rng = np.random.default_rng(seed)
    q = rng.standard_normal((n, 4))
    q *= np.where(q[:, 3:] < 0, -1, 1) / np.linalg.norm(q, axis=1, keepdims=True)
    K = rng.standard_normal((12, 12))
    X = rng.standard_normal((4, 3))
    X -= X.mean(0)
    shape = rng.standard_normal((2, 4, 3))
    flat = shape.reshape(2, 12)
    stiff, heavy = np.einsum("ki,ij,kj->k", flat, K @ K.T, flat), 0.5 * (flat**2).sum(1)
    body = Body(
        node=("tip", "λ root", "left", "right"),
        position=X,
        mass_matrix=0.5 * np.eye(12),
        total_mass=2.0,
        mass_center=np.zeros(3),
        inertia=0.5 * ((X**2).sum() * np.eye(3) - X.T @ X),
        stiffness=K @ K.T,
        mode_shape=shape,
        mode_frequency=np.sqrt(stiff / heavy) / (2 * np.pi),
        mode_damping=np.array([0.01, 0.02]),
        sensor_position=np.zeros((1, 3)),
        sensor_rotation=np.array([[0.0, 0.0, 0.0, 1.0]]),
    )
    motion = Motion(
        np.arange(n) / 100,
        center=rng.standard_normal((n, 3)),
        orientation=q,
        specific_force=rng.standard_normal((n, 1, 3)),
        angular_velocity=rng.standard_normal((n, 1, 3)),
        strain=rng.standard_normal((n, 3)),
        gravity=np.array([0, -9.81, 0]),
        noise_std={"center": 1e-4, "strain": 1e-6},
    )
    return Recording(body, motion)


def estimate(n=20, nodes=4, modes=2, loads=True, seed=2):
    """An estimate with everything in it."""
    rng = np.random.default_rng(seed)

    def r(*shape):
        return rng.standard_normal(shape)

    A = r(n, 6, 6)
    load = Loads(("thrust", "drag"), r(n, 2), np.tile(np.eye(2), (n, 1, 1)), r(2, 1), r(1, 2), r(n) ** 2, 4)
    return Estimate(
        time=np.arange(n) / 100,
        force=r(n, 3),
        moment=r(n, 3),
        wrench_cov=A @ A.swapaxes(1, 2),
        center=r(n, 3),
        velocity=r(n, 3),
        orientation=Rotation.random(n, random_state=rng).as_quat(),
        angular_velocity=r(n, 3),
        angular_momentum=r(n, 3),
        deformation=r(n, nodes, 3),
        mean_shape=r(nodes, 3),
        nis=np.where(np.arange(n) < 2, np.nan, r(n) ** 2),
        innovation=r(n, 3 * nodes),
        mass=0.35,
        gravity=np.array([0.0, 0.0, -9.81]),
        node=tuple(f"marker_{k}" for k in range(nodes)),
        method="smoother",
        model="modal",
        engine="numpy",
        log_likelihood=12.5,
        moment_about="mass_center",
        verdict=Verdict(
            "degraded",
            (
                Finding("color", "degraded", {"variable": "position", "noise": 1e-3}, "noise is not white"),
                Finding("lost", "ok", {"time_s": None}, "marker_1 is lost for 2 s; film again"),
            ),
        ),
        mode_amplitude=r(n, modes) if modes else None,
        stretch=r(n, 3, 3),
        first_moment=r(n, 3, 3),
        first_moment_cov=r(n, 9, 9),
        modal=ModalForces(r(3, nodes, 3), r(n, 3), r(n, 3, 3)) if modes else None,
        loads=load if loads else None,
        runtime_s=0.25,
        settings='method = "smoother"\n',
        input_sha256="ab" * 32,
        tuned={"force.std": 1.5, "noise": 1e-3},
    )


def differences(a, b):
    """Names of the fields in which two records of one kind differ; NaN equals NaN."""
    return [name for name in vars(a) if not same(getattr(a, name), getattr(b, name))]


def same(a, b):
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.shape == b.shape and np.array_equal(a, b, equal_nan=True)
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if hasattr(a, "__dataclass_fields__"):
        return type(a) is type(b) and not differences(a, b)
    return a == b
