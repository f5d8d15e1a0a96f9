"""Air, axes and coefficients: tables, closed forms, and what they cannot be taken with."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.aero.air import standard_density, wind_at
from forceid.aero.axes import flow
from forceid.aero.quantities import NAMES, STATE, aero_of, jacobian, quantities
from forceid.config import AeroSetting, WindProfile, load_settings
from forceid.errors import ConfigError, DataError

DOWN = np.array([0.0, 0.0, -9.81])


def test_the_standard_atmosphere_is_that_of_its_table():
    table = {
        0: 1.2250,
        1000: 1.1116,
        5000: 0.73612,
        11000: 0.36391,
        15000: 0.19367,
        20000: 0.088035,
    }  # ISO 2533
    for altitude, density in table.items():
        assert standard_density(altitude) == pytest.approx(density, rel=1e-4)


def test_wind_by_height_is_straight_between_its_heights_and_along_gravity():
    setting = AeroSetting(
        area=1.0, wind_profile=WindProfile(height=(0.0, 10.0), velocity=((0, 0, 0), (5, 1, 0)))
    )
    at = np.array([[3.0, 9.0, 2.0], [0.0, 0.0, 20.0]])
    assert np.allclose(wind_at(setting, at, DOWN), [[1.0, 0.2, 0.0], [5.0, 1.0, 0.0]])
    with pytest.raises(ConfigError, match="gravity is zero"):
        wind_at(setting, at, np.zeros(3))


def test_wind_that_was_not_measured_is_missing():
    with pytest.raises(DataError, match="/motion/wind is missing"):
        wind_at(AeroSetting(area=1.0, wind="measured"), np.zeros((2, 3)), DOWN)


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"area": -1.0}, "aero.area"), ({"area": 0.0}, "aero.area"), ({}, "aero.area"),
        ({"area": 1.0, "density": -1.0}, "aero.density"), ({"area": 1.0, "altitude": 9e4}, "aero.altitude"),
        ({"area": 1.0, "density": 1.0, "altitude": 0.0}, "density and altitude"),
        ({"area": 1.0, "up": (1.0, 0.0, 0.1)}, "right angles"), ({"area": 1.0, "chord": 0.0}, "aero.chord"),
        ({"area": 1.0, "wind_profile": {"height": [1.0], "velocity": []}}, "heights"),
        ({"area": 1.0, "wind": "north"}, "aero.wind.*measured"),
    ],
)  # fmt: skip
def test_air_and_sizes_that_cannot_be_are_one_line(told, said):
    with pytest.raises(ConfigError, match=said) as caught:
        load_settings(aero=told)
    assert "\n" not in str(caught.value)


def test_lift_and_drag_of_a_wing_in_closed_form():
    alpha, beta, V = 0.15, -0.2, 12.0
    air = V * np.array([np.cos(alpha) * np.cos(beta), -np.sin(beta), -np.sin(alpha) * np.cos(beta)])
    R = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
    setting = AeroSetting(area=0.5, chord=0.2, span=2.0, density=1.2)
    seen = flow(setting, R @ air, R, np.zeros(3))
    assert np.allclose([seen.alpha, seen.beta, seen.speed], [alpha, beta, V])
    # by turning axes one after the other, x forward, y right, z down
    wind = Rotation.from_euler("z", beta).as_matrix().T @ Rotation.from_euler("y", alpha).as_matrix()
    assert np.allclose(wind @ (seen.axes @ (R @ air)), [V, 0.0, 0.0])
    force = np.array([-0.3, 0.1, -2.0])  # drag, side, lift, wind axes
    F = seen.axes.T @ wind.T @ force
    found = dict(
        zip(NAMES, quantities(setting, R @ air, R, np.zeros(3), F, np.zeros(3))[: len(NAMES)], strict=True)
    )
    qA = 0.5 * 1.2 * V**2 * 0.5
    assert np.allclose([found[n] for n in ("drag", "side_force", "lift")], [0.3, 0.1, 2.0])
    assert np.allclose([found[n] * qA for n in ("CD", "CY", "CL")], [0.3, 0.1, 2.0])


def test_moments_are_over_their_lengths_and_positive_nose_up_and_right():
    setting = AeroSetting(area=0.5, chord=0.2, span=2.0, density=1.2)
    air, F = np.array([10.0, 0.0, 0.0]), np.zeros(3)
    M = np.array([1.0, -2.0, -3.0])  # forward, left, up: rolls right, lifts the nose, turns it right
    found = quantities(setting, air, np.eye(3), np.zeros(3), F, M)
    qA = 0.5 * 1.2 * 100 * 0.5
    own = [NAMES.index(n) for n in ("Cl", "Cm", "Cn")]
    assert np.allclose(found[own], [1 / qA / 2.0, 2 / qA / 0.2, 3 / qA / 2.0])


def test_a_ball_has_its_lift_where_magnus_has_it():
    setting = AeroSetting(area=0.004, span=0.07, density=1.2, axes="ball")
    air, omega = np.array([30.0, 0.0, 0.0]), np.array([0.0, -100.0, 0.0])  # back spin
    found = quantities(setting, air, np.eye(3), omega, np.array([-1.0, 0.0, 0.5]), np.zeros(3))
    assert np.allclose(found[[NAMES.index(n) for n in ("lift", "drag", "side_force")]], [0.5, 1.0, 0.0])
    assert found[NAMES.index("spin_parameter")] == pytest.approx(100 * 0.035 / 30)
    assert found[NAMES.index("advance_ratio")] == pytest.approx(30 / (0.07 * 100 / 2 / np.pi))


@pytest.mark.parametrize("axes", ["body", "disc", "ball"])
def test_deviations_are_those_of_drawn_errors(axes):
    rng = np.random.default_rng(3)
    setting = AeroSetting(area=0.05, chord=0.2, span=0.4, density=1.2, axes=axes)
    R, air, omega = (
        Rotation.from_rotvec([0.2, 0.1, 0.4]).as_matrix(),
        np.array([9.0, 2.0, -1.0]),
        np.array([1.0, 5, 20]),
    )
    F, M = np.array([0.1, -0.4, 2.0]), np.array([0.01, 0.05, -0.02])
    root = 1e-3 * rng.standard_normal((STATE, STATE))
    every = np.stack([air, np.zeros(3), omega, F, M]).ravel() + rng.standard_normal((40000, STATE)) @ root.T
    turned = Rotation.from_rotvec(every[:, 3:6]).as_matrix() @ R
    drawn = quantities(setting, every[:, :3], turned, every[:, 6:9], every[:, 9:12], every[:, 12:])
    found = aero_of(setting, (np.zeros((1, 3)), air[None], R[None], omega[None]), (F[None], M[None]),
                    (root @ root.T)[None], DOWN, None, "")  # fmt: skip
    want = drawn.std(0)[: len(NAMES)]
    assert np.allclose(found.std[0], want, rtol=0.03, atol=1e-9)
    cov = np.cov(drawn[:, 7:13].T)
    assert np.allclose(found.coefficient_cov[0], cov, atol=0.05 * np.abs(cov).max())
    assert np.allclose(found.force_wind_std[0], drawn.std(0)[len(NAMES) : len(NAMES) + 3], rtol=0.03)


def test_slopes_are_zero_along_a_force_that_is_not_there():
    setting = AeroSetting(area=1.0)
    slopes = jacobian(
        setting,
        np.array([[5.0, 0, 0]]),
        np.eye(3)[None],
        np.zeros((1, 3)),
        np.zeros((1, 3)),
        np.zeros((1, 3)),
    )
    assert not slopes[0, NAMES.index("CL"), :9].any()
