"""Constants of a material from a free flight: against DOP853 on equations of motion that stand here."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from forceid.cli.app import main
from forceid.config import load_settings
from forceid.estimation.identify import identify_recording
from forceid.files.stored.hdf5 import write_motion
from forceid.records import Body, Motion, Recording

EYE, G = np.eye(3), np.array([0.0, 0.0, -9.81])
SETTINGS = {law: load_settings(material={"name": law, **c}) for law, c in (
    ("st_venant_kirchhoff", {"lam": 1.0, "mu": 1.0}), ("neo_hookean", {"a": 1.0, "c": 1.0})
)}  # fmt: skip


def stress(law, F, V, lam, mu, eta):
    """First Piola-Kirchhoff stress, J."""
    if law == "st_venant_kirchhoff":
        strain = (F.T @ F - EYE) / 2
        elastic = F @ (lam * np.trace(strain) * EYE + 2 * mu * strain)
    else:
        cof, J = np.linalg.inv(F).T, np.linalg.det(F)
        elastic = mu * (F - cof) + lam / 2 * (J**2 - 1) * cof
    return elastic + eta * F @ (F.T @ V + V.T @ F)


def flight(
    seed, law="st_venant_kirchhoff", truth=(6.0, 4.0, 1e-3), size=0.05, spin=4, push=None, samples=200
):
    """A block of eight masses let go deformed and turning: 0.3 mm, 200 Hz."""
    rng = np.random.default_rng(seed)
    X = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3) * rng.uniform(0.08, 0.16, 3)
    mass = rng.uniform(0.04, 0.1, 8)
    X -= mass @ X / mass.sum()
    inverse = np.linalg.inv((mass * X.T) @ X)
    R, A, B = Rotation.random(rng=rng).as_matrix(), *rng.standard_normal((2, 3, 3))
    F0 = R @ (EYE + size * (A + A.T) / 2)
    W = np.cross(EYE, rng.uniform(-spin, spin, 3))
    V0 = W @ F0 + R @ (size * np.sqrt(8 * np.trace(inverse)) * (B + B.T) / 2)
    t = np.arange(samples) / 200

    def rate(now, y):
        F, V = y.reshape(2, 3, 3)
        N = 0.0 if push is None else push(now)
        return np.concatenate([y[9:], ((N - stress(law, F, V, *truth)) @ inverse).ravel()])

    start = np.concatenate([F0.ravel(), V0.ravel()])
    F = solve_ivp(rate, (0, t[-1]), start, "DOP853", t, rtol=1e-10, atol=1e-11).y[:9].T.reshape(-1, 3, 3)
    x = np.einsum("tab,nb->tna", F, X) + np.outer(t, [1.0, 0, 3])[:, None] + 0.5 * (t**2)[:, None, None] * G
    x += 3e-4 * rng.standard_normal(x.shape)
    return Recording(Body(tuple("abcdefgh"), X, mass), Motion(t, x, gravity=G))


@pytest.mark.parametrize(
    ("seed", "law"), [(1, "st_venant_kirchhoff"), pytest.param(2, "neo_hookean", marks=pytest.mark.long)]
)
def test_constants_of_one_flight_are_right_within_their_claims(seed, law):
    truth = np.array([6.0, 4.0, 1e-3])
    found = identify_recording(flight(seed, law, truth, samples=120), SETTINGS[law])
    assert found.verdict.level == "ok"
    assert found.law == law
    np.testing.assert_allclose(found.value[:2], truth[:2], rtol=5e-3)
    score = np.linalg.solve(np.linalg.cholesky(found.cov), found.value - truth)
    assert score @ score < 16.3  # 1 in 1000 of chi-square of three
    assert 0.85 < found.misfit < 1.15
    assert found.noise_std == pytest.approx(3e-4, rel=0.05)


@pytest.mark.long
def test_settings_of_what_was_found_are_those_of_the_material(tmp_path, capsys):
    path, out = tmp_path / "flight.h5", tmp_path / "material.toml"
    (tmp_path / "law.toml").write_text('[material]\nname = "neo_hookean"\na = 1.0\nc = 1.0\nvolume = 0.01\n')
    write_motion(path, flight(3, "neo_hookean", samples=80))
    words = ["identify", str(path), "-c", str(tmp_path / "law.toml"), "-o", str(out), "--json"]
    assert main(words) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["constants"]["mu"]["unit"] == "Pa"
    assert said["constants"]["mu"]["value"] == pytest.approx(400.0, rel=0.01)
    assert said["constants"]["mu"]["low"] < said["constants"]["mu"]["value"] < said["constants"]["mu"]["high"]
    written = tomllib.loads(out.read_text())["material"]
    assert written == said["material"]
    assert written["a"] == pytest.approx(200.0, rel=0.01)


def test_a_body_that_hardly_deforms_tells_no_material(tmp_path):
    still = flight(4, size=1e-6, spin=0.1, samples=50)
    material = {"name": "st_venant_kirchhoff", "lam": 1.0, "mu": 1.0}
    path, out = tmp_path / "still.h5", tmp_path / "out.toml"
    write_motion(path, replace(still, body=replace(still.body, material=material)))
    assert main(["identify", str(path), "-o", str(out)]) == 1
    assert not out.exists()


@pytest.mark.long
def test_first_moments_that_are_applied_do_not_pass_for_the_material():
    tones = np.random.default_rng(5).standard_normal((3, 3))
    pushed = flight(6, push=lambda t: 0.2 * tones * np.sin(9 * t), samples=80)
    found = identify_recording(pushed, SETTINGS["st_venant_kirchhoff"])
    assert "flight-misfit" in found.verdict.codes


def test_markers_in_a_plane_and_laws_without_lame_constants_are_one_line(tmp_path, capsys):
    flat = flight(7, samples=20)
    flat.motion.position[:, 4:] = np.nan
    order = np.argsort(flat.body.position[:, 0])
    x = flat.motion.position.copy()
    x[:, order[:4]] = 0.1 * np.random.default_rng(0).standard_normal((20, 4, 3))
    x[:, order[4:]] = np.nan
    gas = replace(flat.body, material={"name": "perfect_gas", "K": 1.0, "gamma": 1.4})
    for name, recording, said in (
        ("flat", replace(flat, motion=replace(flat.motion, position=x)), "lie in a plane"),
        ("gas", replace(flat, body=gas), "expected one of"),
    ):
        write_motion(tmp_path / f"{name}.h5", recording)
        assert main(["identify", str(tmp_path / f"{name}.h5")]) == 3
        line = capsys.readouterr().err
        assert said in line
        assert line.count("\n") == 1


@pytest.mark.long
def test_modes_of_a_frame_of_springs_have_frequency_and_damping_within_their_claims(tmp_path, capsys):
    rng = np.random.default_rng(9)
    X = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3) * [0.2, 0.15, 0.1] + 0.02 * rng.random(
        (8, 3)
    )
    mass, K = rng.uniform(0.1, 0.2, 8), np.zeros((24, 24))
    X -= mass @ X / mass.sum()
    for i in range(8):
        for j in range(i):
            n = np.zeros(24)
            n[3 * i : 3 * i + 3] = (X[i] - X[j]) / np.linalg.norm(X[i] - X[j])
            n[3 * j : 3 * j + 3] = -n[3 * i : 3 * i + 3]
            K += 1e3 * np.outer(n, n)
    values, vectors = eigh(K, np.diag(np.repeat(mass, 3)))
    w, Phi, z = np.sqrt(values[6:10]), vectors[:, 6:10], np.array([0.01, 0.02, 0.015, 0.005])
    t = np.arange(400) / 500
    q = 1e-3 * np.exp(-np.outer(t, z * w)) * np.cos(np.outer(t, w * np.sqrt(1 - z**2)) + np.arange(4))
    R = Rotation.from_rotvec([0.3, 0.5, -0.2]).as_matrix()
    x = (X + (q @ Phi.T).reshape(-1, 8, 3)) @ R.T + np.outer(t, [1.0, 0, 2])[:, None]
    x += 2e-4 * rng.standard_normal(x.shape)
    body = Body(tuple("abcdefgh"), X, mass, mode_shape=Phi.T.reshape(-1, 8, 3))
    path = tmp_path / "frame.h5"
    write_motion(path, Recording(body, Motion(t, x, gravity=np.zeros(3), noise_std={"position": 2e-4})))
    assert main(["identify", str(path), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)["constants"]
    for k in range(4):
        for name, truth in (("frequency", w[k] / (2 * np.pi)), ("damping", z[k])):
            found = said[f"{name}_{k + 1}"]
            assert abs(found["value"] - truth) < 3.5 * found["std"]
        assert said[f"frequency_{k + 1}"]["std"] < 0.01 * w[k] / (2 * np.pi)


def test_a_body_that_stays_rigid_is_refused_without_a_search():
    rng, time = np.random.default_rng(3), np.arange(400) / 200
    X = 0.1 * rng.standard_normal((6, 3))
    R = Rotation.from_rotvec(time[:, None] * [3.0, -5.0, 8.0]).as_matrix()
    x = np.einsum("tab,nb->tna", R, X) + 3e-4 * rng.standard_normal((400, 6, 3))
    found = identify_recording(
        Recording(Body(tuple("abcdef"), X, np.full(6, 0.1)), Motion(time, x)), load_settings()
    )
    assert found.verdict.codes == ("no-free-flight",)
    assert np.isnan(found.value).all()
