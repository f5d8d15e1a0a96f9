"""Against trim, symmetry, the power of the wrench, and free flight without air."""

import numpy as np
import pytest
from scipy.integrate import simpson

from forceid.scenes.flights.frisbee import Coefficients, Parameters, aerodynamic_wrench, fly, launch
from forceid.scenes.rigid import RigidState

TIME = np.arange(1001) / 1000.0
STILL = dict.fromkeys(Coefficients.model_fields, 0.0)
MIRROR = np.array([1.0, -1.0, 1.0])


def dynamic_force(p):
    return 0.5 * p.air_density * p.speed**2 * p.area


@pytest.fixture(scope="module")
def flight():
    return fly(Parameters(), TIME)


def test_without_coefficients_the_disc_is_a_free_top_on_a_parabola():
    p = Parameters(coefficients=STILL, bank=10.0)
    truth = fly(p, TIME).truth
    t = TIME[:, None]
    fall = np.array(p.center) + [p.speed, 0, 0] * t + 0.5 * np.array(p.gravity) * t**2
    np.testing.assert_allclose(truth["center"], fall, atol=1e-9)
    np.testing.assert_array_equal(truth["angular_momentum"], truth["angular_momentum"][[0]].repeat(1001, 0))


def test_disc_without_spin_is_in_trim_where_the_pitch_line_crosses_zero():
    k = Coefficients()
    trim = np.degrees(-k.PTy0 / k.PTya)
    _, moment = aerodynamic_wrench(Parameters(spin=0.0), launch(Parameters(spin=0.0, nose_up=trim)))
    np.testing.assert_allclose(moment, 0.0, atol=1e-15)


@pytest.mark.parametrize(("nose_up", "sign"), [(20.0, 1.0), (2.0, -1.0)])
def test_above_trim_the_moment_lifts_the_nose_and_below_it_drops_it(nose_up, sign):
    p = Parameters(spin=0.0, nose_up=nose_up)
    _, moment = aerodynamic_wrench(p, launch(p))
    assert np.sign(-moment[1]) == sign, "nose up is a turn about -y, from x toward z"
    assert np.abs(moment[[0, 2]]).max() < 1e-15


def test_lift_and_drag_have_the_coefficients_of_the_angle_of_attack():
    p, k = Parameters(), Coefficients()
    alpha = np.radians(p.nose_up)
    force, _ = aerodynamic_wrench(p, launch(p))
    drag = k.PD0 + k.PDa * (alpha - np.radians(4.0)) ** 2
    np.testing.assert_allclose(force / dynamic_force(p), (-drag, 0.0, k.PL0 + k.PLa * alpha), atol=1e-14)


def test_each_rate_meets_its_own_coefficient():
    p = Parameters(nose_up=0.0)
    qAD = dynamic_force(p) * 2.0 * np.sqrt(p.area / np.pi)
    k = p.coefficients

    def moment(omega):
        state = RigidState(np.zeros(3), np.array([10.0, 0.0, 0.0]), np.eye(3), np.array(omega))
        return aerodynamic_wrench(p, state)[1] / qAD + [0.0, k.PTy0, 0.0]

    np.testing.assert_allclose(moment((2.0, 0.0, 0.0)), (2.0 * k.PTxwx, 0.0, 0.0), atol=1e-15)
    np.testing.assert_allclose(moment((0.0, 3.0, 0.0)), (0.0, 3.0 * k.PTywy, 0.0), atol=1e-15)
    np.testing.assert_allclose(moment((0.0, 0.0, 62.0)), (62 * k.PTxwz, 0.0, 62 * k.PTzwz), atol=1e-15)


def test_opposite_spin_flies_the_mirror_image(flight):
    other = fly(Parameters(spin=-62.0), TIME).truth
    np.testing.assert_allclose(other["center"], flight.truth["center"] * MIRROR, atol=1e-9)
    np.testing.assert_allclose(other["moment"], -flight.truth["moment"] * MIRROR, atol=1e-9)


def test_power_of_the_wrench_is_the_loss_of_energy(flight):
    p, truth = Parameters(), flight.truth
    power = (truth["force"] * truth["velocity"] + truth["moment"] * truth["angular_velocity"]).sum(1)
    kinetic = 0.5 * p.mass * (truth["velocity"] ** 2).sum(1)
    kinetic += 0.5 * (truth["angular_momentum"] * truth["angular_velocity"]).sum(1)
    energy = kinetic - p.mass * truth["center"] @ np.array(p.gravity)
    assert simpson(power, x=TIME) < -1.0
    assert energy[-1] - energy[0] == pytest.approx(simpson(power, x=TIME), abs=1e-8)


def test_momenta_change_by_the_wrench(flight, differentiate):
    truth, mass = flight.truth, Parameters().mass
    force = differentiate(mass * truth["velocity"], 1e-3) - mass * flight.gravity
    assert np.abs(force - truth["force"][4:-4]).max() < 1e-6
    assert np.abs(differentiate(truth["angular_momentum"], 1e-3) - truth["moment"][4:-4]).max() < 1e-6
