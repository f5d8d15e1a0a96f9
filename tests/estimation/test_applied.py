"""The moment about another point, and the wrench split into loads."""

import closed_forms as cf
import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.errors import ConfigError
from forceid.estimation.applied import check_points
from forceid.principal.operator import cross_matrix


def carried(force, moment, cov, arm):
    """Wrench and covariance about a point that the mass center lies `arm` away from, by the definition."""
    T = np.tile(np.eye(6), (len(arm), 1, 1))
    for k in range(3):
        T[:, 3:, k] = np.cross(arm, np.eye(3)[k])
    return moment + np.cross(arm, force), T @ cov @ T.swapaxes(1, 2)


def test_moment_about_a_node_is_the_wrench_carried_there(estimated, flown):
    recording, about_center = flown
    about_node = estimated(recording, moment_about="left")
    R = Rotation.from_quat(about_center.orientation)
    arm = -R.apply(about_center.mean_shape[1] + about_center.deformation[:, 1])
    moment, cov = carried(about_center.force, about_center.moment, about_center.wrench_cov, arm)
    assert about_node.moment_about == "left"
    np.testing.assert_array_equal(about_node.force, about_center.force)
    np.testing.assert_allclose(about_node.moment, moment, atol=1e-12)
    np.testing.assert_allclose(about_node.wrench_cov, cov, rtol=1e-9, atol=1e-20)


def test_moment_about_a_fixed_point_is_the_wrench_carried_there(estimated, flown):
    recording, about_center = flown
    about_point = estimated(recording, moment_about=(1.0, -2.0, 0.5))
    arm = about_center.center - [1.0, -2.0, 0.5]
    moment, cov = carried(about_center.force, about_center.moment, about_center.wrench_cov, arm)
    np.testing.assert_allclose(about_point.moment, moment, atol=1e-12)
    np.testing.assert_allclose(about_point.wrench_cov, cov, rtol=1e-9, atol=1e-20)


def test_force_on_a_particle_has_the_moment_of_its_arm_about_any_point(estimated):
    particle = cf.toss(body=cf.points([0, 0, 0, 0.2]))
    about_center, about_point = estimated(particle), estimated(particle, moment_about=(0.0, 0.0, 0.0))
    np.testing.assert_array_equal(about_point.force_std, about_center.force_std)
    arm = about_center.center
    np.testing.assert_allclose(about_point.moment, np.cross(arm, about_center.force), atol=1e-12)
    across = cross_matrix(arm) @ about_center.wrench_cov[:, :3, :3] @ cross_matrix(arm).mT
    np.testing.assert_allclose(about_point.wrench_cov[:, 3:, 3:], across, atol=1e-12)


def test_force_on_a_body_whose_rotation_is_not_seen_is_known_about_any_point(estimated):
    unseen = cf.toss(body=cf.whole([0, 0, 0]))
    about_center, about_point = estimated(unseen), estimated(unseen, moment_about=(0.0, 0.0, 0.0))
    np.testing.assert_array_equal(about_point.force_std, about_center.force_std)
    assert np.isnan(about_point.moment).all()
    assert np.isnan(about_point.moment_std).all()


PUSH = {"name": "push", "direction": (3, 0, 0), "point": "mass_center", "axes": "world"}
LIFT = {"name": "lift", "direction": (0, 0, 1), "point": "mass_center", "axes": "world"}
YAW = {"name": "yaw", "direction": (0, -1, 0), "point": "mass_center", "axes": "world"}
SPIN_UP = {"name": "spin", "direction": (0, 0, 1), "kind": "moment"}


def test_loads_of_the_right_pattern_are_recovered_within_their_claims(estimated, flown):
    recording, _ = flown
    result = estimated(recording, load=(PUSH, LIFT, YAW, SPIN_UP))
    loads = result.loads
    true = np.array([cf.FORCE[0], cf.FORCE[2], -cf.FORCE[1], cf.INERTIA[2, 2] * cf.SPIN[1]])
    score = (loads.load - true) / np.sqrt(np.diagonal(loads.load_cov, axis1=1, axis2=2))
    assert loads.name == ("push", "lift", "yaw", "spin")
    np.testing.assert_allclose(loads.load[60], true, rtol=5e-3)
    assert np.abs(score).max() < 5
    assert loads.dof == 2
    assert loads.null_space.shape == (4, 0)
    assert result.verdict.level == "ok"


def test_two_forces_at_nodes_are_recovered(estimated):
    # along the second body axis at front and rear: their sum pushes, their difference spins the body up
    arm, total = cf.REACH[0], 0.4
    fore = 0.5 * (total + cf.INERTIA[2, 2] * cf.SPIN[1] / arm)
    fine = cf.clock(20 * 120, 20 * 200.0)
    side = Rotation.from_quat(cf.toss(fine).truth["orientation"]).as_matrix()[..., 1]
    speed = cumulative_simpson(side, x=fine, axis=0, initial=0)
    path = cumulative_simpson(speed, x=fine, axis=0, initial=0)[::20]
    recording = cf.toss()
    push = total / cf.MASS * path - np.outer(recording.motion.time**2 / 2, cf.FORCE / cf.MASS)
    pushed = cf.seen_as(recording, recording.motion.position + push[:, None])
    pair = [{"name": end, "direction": (0, 1, 0), "point": end} for end in ("front", "rear")]
    result = estimated(pushed, load=pair)
    error = result.loads.load - [fore, total - fore]
    std = np.sqrt(np.diagonal(result.loads.load_cov, axis1=1, axis2=2))
    assert cf.rms(error[10:-10]) < 5e-3
    assert cf.rms(error / std) < 2
    assert result.loads.null_space.shape == (2, 0)
    assert result.verdict.level == "ok"


def test_three_loads_on_one_line_leave_a_null_space_and_say_so(estimated, flown):
    recording, _ = flown
    line = [{"name": f"p{k}", "direction": (0, 0, 1), "point": (0.1 * k, 0, 0)} for k in range(3)]
    result = estimated(recording, load=line)
    null = result.loads.null_space[:, 0] * np.sqrt(6)
    np.testing.assert_allclose(null * np.sign(null[0]), [1, -2, 1], atol=1e-9)
    assert result.loads.estimable.shape == (2, 3)
    assert any("p0, p1, p2 are determined in combination only" in r for r in result.verdict.reasons)


def test_loads_that_cannot_explain_the_wrench_degrade_it(estimated, flown):
    recording, _ = flown
    result = estimated(recording, load=(LIFT,))
    assert result.verdict.level == "degraded"
    assert "other loads act" in result.verdict.reasons[0]


@pytest.mark.parametrize("point", ["n0", (0.0, 0.0, 0.0), "mass_center"])
def test_loads_on_a_body_whose_rotation_is_not_seen_are_not_known(estimated, point):
    push = {"name": "push", "direction": (1, 0, 0), "point": point}
    result = estimated(cf.toss(body=cf.whole([0, 0, 0])), load=(push,))
    assert np.isnan(result.loads.load).all()
    assert "particle" in result.verdict.reasons[0]


def test_loads_on_a_particle_are_told_by_their_force(estimated):
    result = estimated(cf.toss(body=cf.points([0, 0, 0, 0.2])), load=(PUSH, LIFT, YAW))
    true = np.array([cf.FORCE[0], cf.FORCE[2], -cf.FORCE[1]])
    score = (result.loads.load - true) / np.sqrt(np.diagonal(result.loads.load_cov, axis1=1, axis2=2))
    assert np.abs(score).max() < 5
    assert result.loads.dof == 0


def test_body_point_and_node_of_the_same_place_carry_the_same_load(estimated, flown):
    recording, _ = flown
    results = [
        estimated(recording, load=({"name": "p", "direction": (0, 0, 1), "point": point},))
        for point in ("left", tuple(recording.body.position[1].tolist()))
    ]
    np.testing.assert_allclose(results[0].loads.load, results[1].loads.load, rtol=1e-9)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"moment_about": "lefd"}, "moment_about names the point 'lefd'.*front, left, top"),
        ({"load": [{"name": "p", "direction": (0, 0, 1), "point": "tip"}]}, "load p names the point 'tip'"),
        ({"load": [{"name": "p", "direction": (0, 0, 0)}]}, "load p has no direction but 0 0 0"),
    ],
)
def test_settings_that_the_body_cannot_meet_are_refused(settings, words):
    with pytest.raises(ConfigError, match=words):
        check_points(load_settings(**settings), cf.star())


def test_body_without_nodes_says_that_it_has_none():
    with pytest.raises(ConfigError, match="this body has no nodes"):
        check_points(load_settings(moment_about="tip"), cf.mean_motion().body)


def test_a_load_spread_over_nodes_is_its_pattern_and_pushes_as_its_forces_do(estimated, flown):
    recording, _ = flown
    ends = {"front": (0.0, 0.0, 0.5), "rear": (0.0, 0.0, 0.5)}
    spread = {"name": "lift", "nodes": ["front", "rear"], "direction": (0.0, 0.0, 2.0)}
    even, written = (
        estimated(recording, load=[load]).loads for load in (spread, {"name": "lift", "pattern": ends})
    )
    np.testing.assert_allclose(even.load, written.load, rtol=1e-12)
    center = estimated(recording, load=[{"name": "lift", "direction": (0.0, 0.0, 1.0)}]).loads
    np.testing.assert_allclose(even.load, center.load, atol=0.05 * np.abs(center.load).max())


@pytest.mark.parametrize(
    ("load", "said"),
    [
        ({"pattern": {"nose": (1.0, 0.0, 0.0)}}, "names 'nose', expected a node"),
        ({"pattern": {"front": (1.0, 0.0, 0.0)}, "point": "rear"}, "point and pattern, expected one of them"),
        ({"pattern": {"front": (1.0, 0.0)}}, "pattern.front"),
        ({"pattern": {"front": (0.0, 0.0, 0.0)}}, "no direction but 0 0 0"),
        ({"nodes": ["front"], "direction": (1.0, 0.0, 0.0), "kind": "moment"}, "is a moment"),
        ({"nodes": ["front"]}, "takes a direction, or a pattern"),
    ],
)
def test_a_pattern_that_names_no_load_on_nodes_is_refused_in_one_line(load, said):
    with pytest.raises(ConfigError, match=said) as refused:
        check_points(load_settings(load=[{"name": "push"} | load]), cf.star())
    assert "\n" not in str(refused.value)
