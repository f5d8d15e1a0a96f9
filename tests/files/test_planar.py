"""Planar files: two axes, one moment of inertia, motion in the plane z = 0."""

import numpy as np
import pytest
import xarray as xr

from forceid import estimate
from forceid.errors import DataError
from forceid.files import recording_from_tree

TIME = np.arange(0, 1.0, 0.005)
MASS, J = 0.6, 2e-3
ORIGIN = np.zeros(2)
SHAPE = np.array([[0.08, 0.0], [-0.05, 0.06], [-0.03, -0.07], [0.02, 0.05]])


def planar(seed=4, noise=2e-4, **changed):
    """A plate in the plane under a force and a moment in closed form, as a tree with two axes."""
    rng, t = np.random.default_rng(seed), TIME
    gravity = np.array([0.0, -9.81])
    w, a, b = 9.0, np.array([2.0, -1.5]), 0.05
    force, moment = a * np.sin(w * t)[:, None], b * np.cos(w * t)
    c = (
        -a / MASS * (np.sin(w * t) / w**2)[:, None]
        + [0.3, 1.2] * t[:, None]
        + 0.5 * gravity * t[:, None] ** 2
    )
    angle = 5.0 * t - b / J * (np.cos(w * t) - 1) / w**2
    R = np.stack([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]).transpose(2, 0, 1)
    x = c[:, None] + np.einsum("tab,nb->tna", R, SHAPE) + noise * rng.standard_normal((len(t), 4, 2))
    body = {
        "position": (("node", "axis"), SHAPE), "total_mass": ((), MASS), "mass_center": (("axis",), ORIGIN),
        "inertia": ((), J),
    } | changed  # fmt: skip
    motion = {"time": (("time",), t), "position": (("time", "node", "axis"), x, {"noise_std": noise})}
    groups = {
        "/": xr.Dataset(attrs={"forceid_schema": "1"}), "/body": xr.Dataset(body),
        "/motion": xr.Dataset(motion, attrs={"gravity": gravity}),
    }  # fmt: skip
    return xr.DataTree.from_dict(groups), force, moment


def test_force_and_moment_in_the_plane_are_found():
    tree, force, moment = planar()
    found = estimate(tree)["estimate"]
    cut = slice(25, -25)
    error = found["force"].values[cut, :2] - force[cut]
    assert np.sqrt((error**2).mean()) < 1.6 * np.sqrt((found["force_std"].values[cut, :2] ** 2).mean())
    error = found["moment"].values[cut, 2] - moment[cut]
    assert np.sqrt((error**2).mean()) < 1.6 * np.sqrt((found["moment_std"].values[cut, 2] ** 2).mean())
    assert np.abs(found["force"].values[:, 2]).max() < 1e-6
    assert np.abs(found["moment"].values[:, :2]).max() < 1e-6


def test_the_plane_is_that_of_x_and_y_and_the_inertia_that_of_a_plate():
    recording = recording_from_tree(planar()[0])
    assert recording.motion.position.shape == (len(TIME), 4, 3)
    assert not recording.motion.position[..., 2].any()
    assert np.diag(recording.body.inertia).tolist() == [J / 2, J / 2, J]
    assert recording.motion.gravity.tolist() == [0.0, -9.81, 0.0]


def test_a_file_of_two_axes_and_three_is_refused():
    tree, _, _ = planar(mass_center=(("axis_3d",), np.zeros(3)))
    with pytest.raises(DataError, match=r"/body/mass_center has shape \(3,\), expected \(axis = 2\)"):
        recording_from_tree(tree)
