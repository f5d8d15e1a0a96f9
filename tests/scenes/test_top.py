"""Against Jacobi's elliptic functions and the two constants of the free top."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import ellipj

from forceid.errors import ConfigError
from forceid.scenes.flights.top import Parameters, fly
from forceid.scenes.mechanics import center_of, inertia_tensor
from forceid.sections import validate

TIME = np.linspace(0.0, 3.0, 301)


def elliptic_spin(inertia, a, c, time):
    """Principal rates from (a, 0, c) on, for I1 < I2 < I3 and H^2 > 2 E I2 (Landau, section 37)."""
    I1, I2, I3 = inertia
    energy, square = I1 * a**2 + I3 * c**2, (I1 * a) ** 2 + (I3 * c) ** 2
    assert square > energy * I2
    upper, lower = energy * I3 - square, square - energy * I1
    m = (I2 - I1) * upper / ((I3 - I2) * lower)
    sn, cn, dn, _ = ellipj(time * np.sqrt((I3 - I2) * lower / (I1 * I2 * I3)), m)
    one, two = np.sqrt(upper / (I1 * (I3 - I1))), np.sqrt(upper / (I2 * (I3 - I2)))
    return np.stack([one * cn, two * sn, np.sqrt(lower / (I3 * (I3 - I1))) * dn], -1)


def body_spin(truth):
    return Rotation.from_quat(truth["orientation"]).apply(truth["angular_velocity"], inverse=True)


@pytest.mark.parametrize("inertia", [(6e-4, 1.1e-3, 1.5e-3), (1e-3, 1.01e-3, 1.9e-3), (2e-4, 9e-4, 1e-3)])
def test_rates_follow_the_elliptic_functions(inertia):
    top = Parameters(inertia=tuple(map(tuple, np.diag(inertia))), spin=(6.0, 0.0, 12.0))
    expected = elliptic_spin(inertia, 6.0, 12.0, TIME)
    np.testing.assert_allclose(body_spin(fly(top, TIME).truth), expected, rtol=0.0, atol=1e-9)


def test_tumbling_top_keeps_angular_momentum_and_energy_and_shows_no_wrench():
    truth = fly(Parameters(), TIME).truth
    H, omega = truth["angular_momentum"], truth["angular_velocity"]
    assert np.ptp(body_spin(truth)[:, 1]) > 30.0, "the middle axis must turn over"
    np.testing.assert_array_equal(H, H[[0]].repeat(len(H), 0))
    np.testing.assert_allclose((H * omega).sum(1), H[0] @ omega[0], rtol=1e-9)
    assert not truth["force"].any()
    assert not truth["moment"].any()


def test_angular_momentum_is_inertia_times_rate_in_world_axes():
    truth = fly(Parameters(), TIME).truth
    R = Rotation.from_quat(truth["orientation"]).as_matrix()
    J = R @ np.array(Parameters().inertia) @ R.mT
    measured = (J @ truth["angular_velocity"][..., None])[..., 0]
    np.testing.assert_allclose(measured, truth["angular_momentum"], atol=1e-11)


def test_mass_center_falls_freely():
    p = Parameters()
    truth = fly(p, TIME).truth
    t = TIME[:, None]
    fall = np.array(p.center) + np.array(p.velocity) * t + 0.5 * np.array(p.gravity) * t**2
    np.testing.assert_allclose(truth["center"], fall, atol=1e-9)


def test_masses_on_nodes_and_the_same_body_as_a_whole_move_alike():
    mass = np.array([0.04, 0.06, 0.05, 0.03, 0.02, 0.07])
    X = np.array(Parameters().position)
    middle = center_of(mass, X)
    J = inertia_tensor(mass, X - middle)
    lumped = fly(Parameters(mass=tuple(mass)), TIME)
    whole = Parameters(total_mass=mass.sum(), mass_center=tuple(middle), inertia=tuple(map(tuple, J)))
    np.testing.assert_allclose(fly(whole, TIME).position, lumped.position, atol=1e-9)
    np.testing.assert_allclose(center_of(mass, lumped.position), lumped.truth["center"], atol=1e-12)


def test_markers_keep_their_distances():
    position = fly(Parameters(), TIME).position
    distance = np.linalg.norm(position[:, :, None] - position[:, None], axis=-1)
    np.testing.assert_allclose(distance, distance[[0]].repeat(len(TIME), 0), atol=1e-12)


def test_body_that_cannot_tumble_is_refused():
    with pytest.raises(ConfigError, match="inertia"):
        fly(Parameters(mass=(0.1, 0.1), position=((0, 0, 0), (0.1, 0, 0))), TIME)


def test_a_mass_for_every_node_or_none():
    with pytest.raises(ConfigError, match="2 masses for 6 nodes"):
        validate(Parameters, {"mass": [0.1, 0.2]}, "top.toml")
