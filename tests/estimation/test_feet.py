"""The force of the ground on each foot: all on one that stands alone, by the pressure center on two."""

import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from forceid.config import FootSetting, load_settings
from forceid.errors import ConfigError
from forceid.estimation import feet as rule
from forceid.estimation.feet import feet_of
from forceid.estimation.run import estimate_recording
from forceid.files.formats.sources import import_sources
from forceid.files.result import read_result, write_result
from forceid.import_settings import load_import_settings
from forceid.principal import transport_cov
from forceid.records import Motion

ROOT = Path(__file__).parents[2]
REAL = Path(os.environ.get("FORCEID_REAL", ROOT / "none")) / "jump_squat_mocap_plate"
NODES = ("left_foot", "right_foot", "trunk")
FEET = feet_of((), NODES)
STD = np.array([2.0, 2.0, 5.0, 1.0, 1.0, 1.0])  # N, N m


def split_by_foot(feet, nodes, motion, state):
    whole = np.concatenate([state.force, state.moment], 1)
    return rule.split_by_foot(feet, nodes, motion, state.center, whole, state.wrench_cov)


def walking(seed, reach=0.05):
    """Feet that step in turn and stand together between, forces on each, and what the whole shows of them."""
    rng, t = np.random.default_rng(seed), np.arange(400) / 100
    lift = [0.12 * np.maximum(0.0, np.sin(np.pi * t + k * np.pi) - 0.3) for k in (0, 1)]  # m: in turn
    place = np.array([[0.0, 0.1, 0.0], [0.2, -0.1, 0.0]])
    foot = np.stack([place[k] + np.stack([5 * lift[k], 0 * t, lift[k]], 1) for k in (0, 1)], 1)
    center = np.stack([0.1 + 0.05 * np.sin(t), 0.06 * np.sin(np.pi * t), 1.0 + 0 * t], 1)
    stands = np.stack([lift[0] < 1e-9, lift[1] < 1e-9], 1)
    share = np.where(stands.all(1), 0.5 + 0.4 * np.sin(3 * t + rng.uniform(0, 6)), stands[:, 1].astype(float))
    whole = np.stack([20 * np.sin(5 * t), 10 * np.cos(4 * t), 700 + 80 * np.sin(6 * t)], 1)
    force = np.stack([1 - share, share], 1)[..., None] * whole[:, None]
    off = np.concatenate([rng.uniform(-1, 1, (1, 2, 2)) * np.sqrt(3) * reach, np.zeros((1, 2, 1))], 2)
    pressure = np.where([True, True, False], foot + off, 0.0)
    moment = np.cross(pressure - center[:, None], force).sum(1)
    noise = STD * rng.standard_normal((len(t), 6))
    cov = np.tile(np.diag(STD**2), (len(t), 1, 1))
    state = SimpleNamespace(
        force=whole + noise[:, :3], moment=moment + noise[:, 3:], wrench_cov=cov, center=center,
        pressure=pressure,
    )  # fmt: skip
    tracks = np.concatenate([foot, center[:, None]], 1) + 1e-3 * rng.standard_normal((len(t), 3, 3))
    return Motion(t, tracks, gravity=np.array([0, 0, -9.81])), state, force, stands


def test_a_foot_that_stands_alone_has_all_of_the_force():
    motion, state, _, stands = walking(0)
    found = split_by_foot(FEET, NODES, motion, state).feet
    alone = stands.sum(1) == 1
    right = (found.contact == stands).all(1)
    assert right.mean() > 0.85  # a foot that begins to leave is slow, and near
    k = alone & right & (found.share_std == 0)
    assert k.mean() > 0.3
    assert np.array_equal(found.share[k], stands[k].astype(float))
    carried = found.force[k][stands[k]]
    assert np.allclose(carried, state.force[k], atol=0.1 * STD[0])
    assert np.allclose(found.force_cov[k][stands[k]], state.wrench_cov[k][:, :3, :3], rtol=0.05, atol=0.01)


def test_a_foot_that_may_touch_by_now_shares_within_what_is_claimed():
    score = []
    for seed in range(12):
        motion, state, force, stands = walking(seed)
        found = split_by_foot(FEET, NODES, motion, state)
        near = (stands.sum(1) == 1) & (found.feet.share_std > 0)
        assert near.any()
        std = np.sqrt(found.cov[near][:, :, 2, 2])
        score.append(np.mean(((found.wrench[..., :3] - force)[near][..., 2] / std) ** 2))
    assert 0.3 < np.sqrt(np.mean(score)) < 1.4


def test_wrenches_of_two_feet_add_up_to_the_whole_as_it_is_known_and_tip_as_claimed():
    score = []
    for seed in range(12):
        motion, state, force, stands = walking(seed)
        found = split_by_foot(FEET, NODES, motion, state)
        both = stands.all(1) & (found.feet.share_std > 0)
        whole = np.concatenate([state.force, state.moment], 1)
        assert (np.abs(found.wrench[both].sum(1) - whole[both]) < STD).all()
        assert np.linalg.eigvalsh(found.cov[both]).min() > 0
        arm = found.middle - state.center[:, None]
        twist = found.wrench[..., 3:] - np.cross(arm, found.wrench[..., :3])
        off = state.pressure - found.middle
        true = np.cross(off, force)
        std = np.sqrt(np.einsum("tfaa->tfa", transport_cov(found.cov, -arm)[..., 3:, 3:]))
        score.append(np.mean(((twist - true)[both] / std[both])[..., :2] ** 2))
    assert 0.3 < np.sqrt(np.mean(score)) < 1.4


def test_two_feet_share_by_the_pressure_center_within_what_is_claimed():
    score = []
    for seed in range(12):
        motion, state, force, stands = walking(seed)
        found = split_by_foot(FEET, NODES, motion, state).feet
        both = stands.all(1) & (found.contact == 1).all(1)
        assert both.sum() > 20
        std = np.sqrt(found.force_cov[both][:, :, 2, 2])
        score.append(np.mean(((found.force - force)[both][..., 2] / std) ** 2))
        assert (np.abs(found.force[both].sum(1) - state.force[both]) < STD[:3]).all()
    assert 0.3 < np.sqrt(np.mean(score)) < 1.4


def test_in_the_air_no_foot_has_a_force():
    motion, state, _, _ = walking(1)
    air = slice(100, 200)
    motion.position[air, :, 2] += 0.3
    state.force[air] = 0.0
    found = split_by_foot(FEET, NODES, motion, state)
    inner = slice(110, 190)
    assert not found.wrench[inner].any()
    assert not found.feet.contact[inner].any()


def test_feet_that_hardly_push_share_what_is_known_of_it():
    motion, state, _, stands = walking(1)
    state.force[:], state.moment[:] = 0.0, 0.0
    found = split_by_foot(FEET, NODES, motion, state)
    both = stands.all(1) & (found.feet.share_std > 0)
    assert (np.abs(found.wrench[both][..., 2]) < 3 * STD[2]).all()
    assert (np.sqrt(found.cov[both][..., 2, 2]) > 0.3 * STD[2]).all()


def test_feet_under_no_load_at_all_have_none():
    motion, state, _, _ = walking(1)
    state.force[:], state.moment[:], state.wrench_cov[:] = 0.0, 0.0, 0.0
    found = split_by_foot(FEET, NODES, motion, state)
    assert np.abs(found.wrench).max() < 1e-3
    assert np.isfinite(found.cov).all()


def test_feet_are_two_of_nodes_that_there_are():
    assert feet_of((), ("a", "b")) == ()
    one = FootSetting(name="left", nodes=("heel",))
    with pytest.raises(ConfigError, match="are 1, expected two"):
        feet_of((one,), NODES)
    with pytest.raises(ConfigError, match="unknown node 'heel'"):
        feet_of((one, one), NODES)


@pytest.mark.long
@pytest.mark.skipif(not REAL.is_dir(), reason="measured data not found: set FORCEID_REAL")
def test_squats_on_two_plates_are_split_as_these_say(tmp_path):
    settings = load_import_settings(ROOT / "config" / "jump_squat.toml")
    plates = []
    for known in ("1", "2"):
        own = settings.model_copy(update={"plates": settings.plates.model_copy(update={"plate": (known,)})})
        ((_, recording),) = import_sources([REAL / "squats1.trc", REAL / "squats1_grf.mot"], own)
        plates.append(
            np.interp(recording.motion.time, recording.truth["time"], recording.truth["force"][:, 1])
        )
    found = estimate_recording(recording, load_settings())
    write_result(tmp_path / "r.h5", found)
    feet = read_result(tmp_path / "r.h5").feet
    assert feet.name == ("left_foot", "right_foot")
    assert (feet.contact == 1).all()
    true = np.stack(plates, 1)
    if (true[:, 0] * feet.force[:, 0, 1]).sum() < (true[:, 1] * feet.force[:, 0, 1]).sum():
        true = true[:, ::-1]
    error = feet.force[..., 1] - true
    std = np.sqrt(feet.force_cov[..., 1, 1])
    print(np.sqrt((error**2).mean(0)), np.sqrt((std**2).mean(0)), true.mean(0), feet.force[..., 1].mean(0))
    assert (np.sqrt((error**2).mean(0)) < 2 * np.sqrt((std**2).mean(0))).all()
