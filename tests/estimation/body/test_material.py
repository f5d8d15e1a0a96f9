"""The material that a file or the settings state: what it means, and what is no material."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.cli.app import main
from forceid.config import load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.body.material import Solid, solid_of, with_material
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.files.tree import recording_from_tree, tree_from_recording
from forceid.pseudorigid import HadamardGreen, MooneyRivlin, NeoHookean, Ogden, PerfectGas, StVenantKirchhoff
from forceid.records import Body, Motion, Recording

EQUAL = [  # what is stated, and the law that it means
    ({"name": "mooney_rivlin", "a": 0.6, "b": 0.25, "c": 0.4}, MooneyRivlin(0.6, 0.25, 0.4, 3.0)),
    ({"name": "mooney_rivlin", "a": 0.6, "b": 0.25, "c": 0.4, "d": 2.0}, MooneyRivlin(0.6, 0.25, 0.4, 2.0)),
    ({"name": "Neo-Hookean", "a": 3.0, "c": 1.0, "volume": 2.0}, NeoHookean(6.0, 2.0, 16.0)),
    ({"name": "HadamardGreen", "alpha": 1.2, "beta": 0.25, "c": 0.4}, HadamardGreen(1.2, 0.25, 0.4, 3.0)),
    ({"name": "ogden", "alpha": 0.6, "gamma": 2.0, "beta": (0.25,), "delta": (2.0,), "c": 0.4},
     Ogden((0.6,), (2.0,), (0.25,), (2.0,), 0.4, 3.0)),
    ({"name": "St. Venant-Kirchhoff", "lam": 4e5, "mu": 2e5, "volume": 1e-3}, StVenantKirchhoff(4e2, 2e2)),
    ({"name": "perfect_gas", "K": 2.0, "gamma": 1.4, "volume": 3.0}, PerfectGas(6.0, 1.4)),
]  # fmt: skip
WRONG = [
    ({"name": "rubber"}, "did you mean"),
    ({"lam": 1.0, "mu": 1.0}, "has no name"),
    ({"name": "st_venant_kirchhoff", "lam": 1.0}, "lacks 'mu'"),
    ({"name": "st_venant_kirchhoff", "lam": 1.0, "mu": -1.0}, "out of range"),
    ({"name": "st_venant_kirchhoff", "lam": 1.0, "mu": 1.0, "a": 2.0}, "has 'a'"),
    ({"name": "neo_hookean", "a": (1.0, 2.0), "c": 1.0}, "expected finite numbers"),
    ({"name": "neo_hookean", "a": 1.0, "c": 1.0, "volume": 0.0}, "has volume 0"),
    ({"name": "neo_hookean", "a": 1.0, "c": 1.0, "damping": -0.1}, "has damping -0.1"),
    ({"name": "perfect_gas", "K": float("nan"), "gamma": 1.4}, "expected finite numbers"),
]  # fmt: skip


def falling(material):
    t = np.arange(20) / 100
    X = np.array([[0.1, 0, 0], [-0.1, 0.1, 0], [0, -0.1, 0.1], [0, 0, -0.1]])
    body = Body(tuple("abcd"), X, np.ones(4), material=material)
    x = X + 0.5 * t[:, None, None] ** 2 * [0, 0, -9.81]
    return Recording(body, Motion(t, x, gravity=np.array([0, 0, -9.81]), noise_std={"position": 1e-4}))


@pytest.mark.parametrize(("stated", "law"), EQUAL, ids=lambda x: str(x)[:24])
def test_what_is_stated_is_the_law_of_that_name(stated, law, tmp_path):
    recording = falling(stated)
    write_motion(tmp_path / "m.h5", recording)
    F = np.eye(3) + 0.1 * np.random.default_rng(1).standard_normal((3, 3))
    in_file, tree = read_motion(tmp_path / "m.h5"), tree_from_recording(recording)
    by_settings = with_material(replace(recording.body, material=None), load_settings(material=stated))
    for body in (recording.body, in_file.body, recording_from_tree(tree).body, by_settings):
        np.testing.assert_allclose(solid_of(body).law.gradient(F), law.gradient(F), rtol=1e-12)


@pytest.mark.parametrize(("stated", "said"), WRONG)
def test_what_is_no_material_is_one_line_and_nothing_is_written(stated, said, tmp_path, capsys):
    path, out = tmp_path / "m.h5", tmp_path / "out.h5"
    write_motion(path, falling(stated))
    assert main(["estimate", str(path), "-o", str(out)]) == 3
    line = capsys.readouterr().err.strip()
    assert said in line
    assert f"{path}:/body/material" in line
    assert "\n" not in line
    assert not out.exists()
    assert main(["inspect", str(path)]) == 3
    if np.isfinite(stated.get("K", 1.0)):
        with pytest.raises(ConfigError, match=said):
            with_material(Body(), load_settings(material=stated))


def test_a_material_of_text_or_of_variables_is_refused(tmp_path):
    write_motion(tmp_path / "m.h5", falling({"name": "perfect_gas", "K": 1.0, "gamma": 1.4}))
    with h5py.File(tmp_path / "m.h5", "r+") as f:
        f["body/material"].attrs["K"] = "one"
    with pytest.raises(DataError, match="body/material@K"):
        read_motion(tmp_path / "m.h5")


def test_damping_takes_energy_turns_nothing_and_has_the_slopes_of_its_differences():
    rng = np.random.default_rng(3)
    F, dF, H = np.eye(3) + 0.2 * rng.standard_normal((3, 3)), *rng.standard_normal((2, 3, 3))
    solid = Solid(StVenantKirchhoff(1.3, 0.7), 0.4)
    P = solid.stress(F, dF)
    np.testing.assert_allclose(P @ F.T, (P @ F.T).T, atol=1e-12)
    assert ((P - solid.law.gradient(F)) * dF).sum() > 0
    Q = Rotation.random(rng=rng).as_matrix()
    np.testing.assert_allclose(solid.stress(Q @ F, Q @ dF), Q @ P, atol=1e-12)
    by_F, by_dF = solid.slopes(F[None], dF[None])
    for slope, ahead, behind in (
        (by_F, (F + 1e-5 * H, dF), (F - 1e-5 * H, dF)),
        (by_dF, (F, dF + 1e-5 * H), (F, dF - 1e-5 * H)),
    ):
        difference = (solid.stress(*ahead) - solid.stress(*behind)) / 2e-5
        np.testing.assert_allclose(slope[0] @ H.ravel(), difference.ravel(), rtol=1e-6, atol=1e-8)
