"""From markers or a measured mean motion to mass center, rotation, shape and deformation."""

from dataclasses import replace

import closed_forms as cf
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.errors import DataError
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.body.kinematics import kinematics, mapped, scaled_noise, shape_at
from forceid.records import Body


def seen(recording, noise=None, **settings):
    return kinematics(recording.body, recording.motion, load_settings(**settings), noise)


def test_pose_is_known_to_what_its_covariance_says():
    recording = cf.toss()
    kin = seen(recording)
    std = np.sqrt(np.diagonal(kin.pose.cov, axis1=1, axis2=2))
    turn = kin.pose.rotation @ Rotation.from_quat(recording.truth["orientation"]).as_matrix().swapaxes(1, 2)
    error = np.hstack([kin.pose.center - recording.truth["center"], Rotation.from_matrix(turn).as_rotvec()])
    world = kin.pose.cov[:, 3:, 3:]
    turned = np.einsum("ti,tij,tj->t", error[:, 3:], np.linalg.inv(world), error[:, 3:]).mean() / 3
    assert std[:, :3] == pytest.approx(cf.NOISE / np.sqrt(6))
    assert cf.rms(error[:, :3] / std[:, :3]) == pytest.approx(1.0, abs=0.15)  # 360 numbers: 3 sigma is 0.11
    assert turned == pytest.approx(1.0, abs=0.25)
    assert kin.attitude
    assert len(kin.shapes) == 0


def test_a_body_far_from_the_origin_is_known_as_well_as_one_at_it():
    recording = cf.toss()
    away = np.array([5e5, 4e6, 100.0])  # map coordinates
    far = replace(recording, motion=replace(recording.motion, position=recording.motion.position + away))
    near, kin = seen(recording), seen(far)
    assert kin.noise == pytest.approx(near.noise, rel=1e-6)
    assert np.abs(kin.pose.center - away - near.pose.center).max() < 1e-8
    assert kin.pose.cov == pytest.approx(near.pose.cov, rel=1e-6)


def test_three_ways_to_state_the_mass_agree():
    lumped = inertia_of(cf.star())
    consistent = inertia_of(cf.star(mass_matrix=np.kron(np.diag(np.full(6, cf.MASS / 6)), np.eye(3))))
    whole = inertia_of(cf.star(total_mass=cf.MASS, mass_center=np.zeros(3), inertia=cf.INERTIA))
    for other in (consistent, whole):
        assert other.mass == pytest.approx(lumped.mass)
        np.testing.assert_allclose(other.center, lumped.center, atol=1e-15)
        np.testing.assert_allclose(other.tensor, lumped.tensor, atol=1e-15)
    np.testing.assert_allclose(consistent.weight, lumped.weight)
    assert (whole.weight == 0).all()


def test_consistent_bars_have_the_inertia_of_bars():
    arm = cf.MASS / 2 / 6 * np.array([[2.0, 1.0], [1.0, 2.0]])
    M = np.kron(np.block([[arm, np.zeros((2, 2))], [np.zeros((2, 2)), arm]]), np.eye(3))
    cross = np.array([[0.3, 0, 0], [-0.3, 0, 0], [0, 0.3, 0], [0, -0.3, 0]])
    known = inertia_of(Body(node=("e", "w", "n", "s"), position=cross, mass_matrix=M))
    bar = cf.MASS / 2 * 0.6**2 / 12
    np.testing.assert_allclose(known.tensor, np.diag([bar, bar, 2 * bar]), atol=1e-16)
    np.testing.assert_allclose(known.weight, cf.MASS / 4)


def test_body_without_mass_is_refused():
    with pytest.raises(DataError, match="holds no mass"):
        inertia_of(Body(node=("a",), position=np.zeros((1, 3))))


@pytest.mark.parametrize(
    "body",
    [
        cf.whole([0, 0, 0]),
        cf.whole([0.1, 0, 0], [-0.1, 0, 0]),
        cf.whole([0.1, 0.2, 0], [-0.1, -0.2, 0], [0.2, 0.4, 0]),
    ],
    ids=["a particle", "two markers", "three on a line"],
)
def test_center_is_seen_where_the_rotation_is_not(body):
    recording = cf.toss(body=body)
    kin = seen(recording)
    std = np.sqrt(kin.pose.cov[:, 0, 0])
    assert not kin.attitude
    assert cf.rms((kin.pose.center - recording.truth["center"]) / std[:, None]) == pytest.approx(
        1.0, abs=0.15
    )
    assert np.isnan(kin.pose.rotation).all()


def test_center_off_the_line_of_the_markers_is_not_seen():
    recording = cf.toss(body=cf.points([0.1, 0.05, 0, 0.05], [-0.1, 0.05, 0, 0.05], [0, -0.05, 0, 0.1]))
    x = recording.motion.position.copy()
    x[:, 2] = np.nan
    assert np.isnan(seen(cf.seen_as(recording, x)).pose.center).all()


def test_lost_marker_moves_neither_center_nor_rotation():
    recording = cf.toss(noise=1e-9)
    x = recording.motion.position.copy()
    x[50, 1] = x[51, 2:4] = np.nan
    kin, whole = seen(cf.seen_as(recording, x)), seen(recording)
    np.testing.assert_allclose(kin.pose.center, whole.pose.center, atol=1e-8)
    np.testing.assert_allclose(kin.pose.rotation, whole.pose.rotation, atol=1e-7)
    assert kin.pose.cov[51, 0, 0] > whole.pose.cov[51, 0, 0]


def test_frame_without_markers_is_lost_alone():
    recording = cf.toss()
    x = recording.motion.position.copy()
    x[40] = x[41, :4] = np.nan
    lost = ~np.isfinite(seen(cf.seen_as(recording, x)).pose.rotation).all((1, 2))
    assert np.flatnonzero(lost).tolist() == [40, 41]


def test_noise_is_found_where_it_is_not_stated():
    kin = seen(cf.toss(stated=False))
    assert kin.noise["position"] == pytest.approx(cf.NOISE, rel=0.1)
    assert kin.stated == {"position": False}


def test_noise_of_a_mean_motion_is_found():
    kin = seen(cf.mean_motion())
    assert kin.noise["center"] == pytest.approx(1e-4, rel=0.2)
    assert kin.noise["orientation"] == pytest.approx(1e-3, rel=0.2)
    assert kin.attitude


def test_stated_noise_goes_before_the_data_and_settings_before_the_file():
    recording = cf.toss()
    assert seen(recording).noise == {"position": cf.NOISE}
    assert seen(recording, noise_std={"position": 1e-3}).noise == {"position": 1e-3}
    again = scaled_noise(seen(recording), {"position": 2.0 * np.eye(3)})
    assert seen(recording, again).noise == {"position": 2 * cf.NOISE}
    assert seen(recording, again).stated == {"position": True}


def test_body_that_grew_is_measured_as_it_is():
    recording = cf.toss()
    larger = cf.star(total_mass=cf.MASS, mass_center=np.zeros(3), inertia=cf.INERTIA)
    x = recording.truth["center"][:, None] + 1.05 * (
        recording.motion.position - recording.truth["center"][:, None]
    )
    kin = kinematics(larger, cf.seen_as(recording, x).motion, load_settings(model="rigid"))
    np.testing.assert_allclose(kin.shape, 1.05 * larger.position, atol=4 * 1.05 * cf.NOISE / np.sqrt(120))


def test_reference_shape_stays_where_the_record_does_not_contradict_it():
    recording = cf.toss()
    np.testing.assert_allclose(seen(recording).shape, recording.body.position, rtol=0, atol=1e-15)


def test_breathing_body_shows_one_shape_and_its_amplitude():
    recording = cf.toss(breath=0.05)
    kin = seen(recording)
    pattern = recording.body.position.ravel() / np.linalg.norm(recording.body.position)
    assert kin.model == "modal"
    assert len(kin.shapes) == 1
    assert abs(kin.shapes[0].ravel() @ pattern) == pytest.approx(1.0, abs=1e-3)
    size = cf.size_at(kin.time, 0.05)
    amplitude = kin.amplitude[:, 0] * np.sign(kin.shapes[0].ravel() @ pattern)
    assert np.ptp(amplitude - size * np.linalg.norm(recording.body.position)) < 12 * cf.NOISE
    shape = shape_at(kin, kin.amplitude)
    assert cf.rms(shape - size[:, None, None] * recording.body.position) < cf.NOISE


def test_affine_model_takes_up_six_strains_of_a_solid_and_three_of_a_plate():
    assert seen(cf.toss(), model="affine").shapes.shape == (6, 6, 3)
    plate = cf.points([0.1, 0, 0, 0.05], [-0.1, 0, 0, 0.05], [0, 0.2, 0, 0.05], [0, -0.2, 0, 0.05])
    assert seen(cf.toss(body=plate), model="affine").shapes.shape == (3, 4, 3)


def test_shapes_given_with_the_body_are_used_without_their_rigid_part():
    wave = np.zeros((1, 6, 3))
    wave[0, 1, 0] = 1.0
    body = cf.star(mass=np.full(6, cf.MASS / 6), mode_shape=wave)
    kin = seen(cf.waved(cf.toss(body=body)))
    assert kin.shapes.shape == (1, 6, 3)
    np.testing.assert_allclose(kin.shapes[0].sum(0), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.cross(kin.shape, kin.shapes[0]).sum(0), 0.0, atol=1e-12)


def test_rigid_model_takes_up_no_shape():
    assert len(seen(cf.toss(breath=0.05), model="rigid").shapes) == 0


def test_the_map_of_a_shape_is_the_same_wherever_its_nodes_lie():
    rng = np.random.default_rng(4)
    mean, F = (
        rng.standard_normal((7, 3)) + np.array([3.0, -2.0, 1.0]),
        np.eye(3) + 0.2 * rng.standard_normal((5, 3, 3)),
    )
    shape = rng.standard_normal((5, 1, 3)) + np.einsum("tab,nb->tna", F, mean)
    np.testing.assert_allclose(mapped(mean, shape), F, atol=1e-12)
