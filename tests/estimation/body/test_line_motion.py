"""Directions of a line from points on it, and rotations that follow it without spin."""

import numpy as np
import pytest

from forceid.estimation.body.spin import directions, without_spin


def cone(time, half_angle, rate):
    """Directions of a line that goes round a cone about the third axis."""
    turn = rate * time
    wide = np.full_like(time, np.sin(half_angle))
    return np.stack([wide * np.cos(turn), wide * np.sin(turn), np.full_like(time, np.cos(half_angle))], 1)


def test_spin_free_turn_along_a_cone_leaves_the_solid_angle_behind():
    """Once round, parallel transport turns about the line by 2 pi (1 - cos): Gauss and Bonnet."""
    time = np.linspace(0.0, 1.0, 101)
    n = cone(time, 0.6, 2 * np.pi)
    R = without_spin(time, n, np.array([0.0, 0, 1]))
    left = R[0].T @ R[-1]  # about the third body axis
    angle = np.arctan2(left[1, 0], left[0, 0])
    assert angle == pytest.approx(2 * np.pi * (1 - np.cos(0.6)), abs=1e-4)


def test_spin_free_turn_takes_the_axis_along_and_is_bridged_over_gaps():
    time = np.linspace(0.0, 1.0, 101)
    n = cone(time, 0.4, 3.0)
    n[40:60] = np.nan
    R = without_spin(time, n, np.array([0.0, 0, 1]))
    np.testing.assert_allclose(R[:40, :, 2], n[:40], atol=1e-12)
    assert np.isnan(R[40:60]).all()
    whole = without_spin(time, cone(time, 0.4, 3.0), np.array([0.0, 0, 1]))
    turned = 3.0 * 0.21  # rad round the cone in the gap; a chord would leave out the segment beside it
    segment = np.cos(0.4) * np.sin(0.4) ** 2 * turned**3 / 12
    assert np.abs(R[60:] - whole[60:]).max() < 0.1 * segment


def test_direction_of_masses_is_right_to_first_order_however_the_line_bends():
    """A bend that moves neither the center nor the angular momentum of the line does not turn it."""
    s, m = np.array([-1.0, -0.2, 0.5, 1.1]), np.array([0.2, 0.5, 0.3, 0.4])
    s = s - m @ s / m.sum()
    bend = s**2
    fit = np.stack([np.ones(4), s], 1)
    bend = bend - fit @ np.linalg.solve(fit.T @ (m[:, None] * fit), fit.T @ (m * bend))
    x = s[:, None] * np.array([1.0, 0, 0]) + 0.05 * bend[:, None] * np.array([0.0, 0, 1])
    n, _ = directions(x[None], s, np.ones(4, bool), m * s, 1e-3)
    np.testing.assert_allclose(n[0], [1, 0, 0], atol=1e-14)


def test_variance_of_a_direction_is_that_of_its_errors():
    rng, s = np.random.default_rng(0), np.array([-0.3, 0.1, 0.5])
    x = s[:, None] * np.array([0.0, 1, 0]) + 1e-3 * rng.standard_normal((4000, 3, 3))
    x[::2, 1] = np.nan
    n, var = directions(x, s, np.ones(3, bool), None, 1e-3)
    for part in (slice(0, None, 2), slice(1, None, 2)):
        assert np.mean(n[part][:, [0, 2]] ** 2 / var[part, None]) == pytest.approx(1.0, abs=0.08)


def test_direction_known_less_well_than_a_third_of_a_radian_is_none():
    x = np.array([[[0.0, 0, 0], [1e-3, 0, 0]]])
    assert np.isnan(directions(x, np.array([0.0, 1e-3]), np.ones(2, bool), None, 1e-3)[0]).all()
