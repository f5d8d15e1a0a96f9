import numpy as np
import pytest

from forceid.pseudorigid.body import Body
from forceid.pseudorigid.material.materials import MooneyRivlin, NeoHookean, StVenantKirchhoff
from forceid.pseudorigid.material.ogden import Ogden
from forceid.pseudorigid.motion.splittings import SPLITTINGS
from forceid.pseudorigid.steady.gravity import GasCloud, SelfGravity

TIME = np.linspace(0, 3, 61)
SOFT = Body(1.0, StVenantKirchhoff(1.3, 0.7))
INWARD = np.diag([-2.5, 0.1, 0.2])


def inversion_time():
    return float(SOFT.simulate(np.eye(3), INWARD, TIME, "dop853").event.time)


@pytest.mark.parametrize("method", SPLITTINGS)
def test_every_method_stops_where_a_body_without_barrier_turns_inside_out(method):
    motion = SOFT.simulate(np.eye(3), INWARD, TIME, method, 0.01)
    assert motion.event is not None
    assert (str(motion.event.kind), bool(motion.event.stopped)) == ("inversion", True)
    assert float(motion.event.time) == pytest.approx(inversion_time(), abs=2e-4)
    gone = motion.time > float(motion.event.time)
    assert np.isnan(motion.F[gone]).all()
    assert np.isnan(motion.energy[gone]).all()
    assert np.isfinite(motion.F[~gone]).all()


def test_time_of_inversion_is_that_of_det_f_zero():
    fine = SOFT.simulate(np.eye(3), INWARD, [0.0, inversion_time() - 1e-9], "dop853")
    assert 0 < np.linalg.det(fine.F[-1]) < 1e-8


def test_dust_collapses_in_free_fall_time():
    # a = cos^2 s of the cycloid: t = pi / (2 sqrt 2) / sqrt(4 pi G rho / 3)
    dust = Body(1.0, SelfGravity(pi_G_rho=1.0))
    fall = np.pi / 2 / np.sqrt(2 * 4 / 3)
    for method, tolerance in (("dop853", 1e-9), ("kahan_li_8", 1e-6)):
        motion = dust.simulate(np.eye(3), np.zeros((3, 3)), TIME, method, 0.01)
        assert str(motion.event.kind) == "collapse"
        assert float(motion.event.time) == pytest.approx(fall, abs=tolerance)


@pytest.mark.parametrize("method", ["verlet", "blanes_moan_6", "dop853"])
def test_a_cold_cloud_collapses_under_its_own_gravity_and_a_warm_one_of_its_batch_does_not(method):
    cold = Body(1.0, GasCloud(1e-6, 1.2, pi_G_rho=1.0))
    V = np.stack([np.zeros((3, 3)), 2.5 * np.eye(3)])  # the other flies apart
    motion = cold.simulate(np.eye(3), V, TIME[:31], method, 0.01)
    assert motion.event.kind.tolist() == ["collapse", ""]
    fall = np.pi / 2 / np.sqrt(2 * 4 / 3)
    assert float(motion.event.time[0]) == pytest.approx(fall, abs=1e-3)
    assert np.isfinite(motion.F[:, 1]).all()


def test_a_step_that_jumps_over_the_barrier_is_told_from_a_collapse():
    body = Body(1.0, NeoHookean(1.0, 0.5, 3.0))
    F0, V0 = np.diag([0.6, 1.0, 1.0]), np.diag([-3.0, 0.0, 0.0])
    jumped = body.simulate(F0, V0, [0.0, 1.0], "kahan_li_6", 0.25)
    assert str(jumped.event.kind) == "step"
    assert bool(jumped.event.stopped)
    assert body.simulate(F0, V0, TIME, "kahan_li_6", 0.01).event is None


def test_a_body_driven_deep_into_its_barrier_has_collapsed():
    body = Body(1.0, NeoHookean(1.0, 0.5, 3.0))
    motion = body.simulate(np.eye(3), np.diag([-14.0, 0.0, 0.0]), TIME, "verlet", 0.01)
    assert str(motion.event.kind) == "collapse"
    assert float(motion.event.time) == pytest.approx(1 / 14, rel=0.1)


def test_one_body_that_stops_leaves_the_others_of_its_batch_alone():
    V = np.stack([INWARD, 0.1 * INWARD, np.diag([0.1, -2.5, 0.2])])
    for method in ("blanes_moan_6", "verlet", "dop853"):
        motion = SOFT.simulate(np.eye(3), V, TIME[:21], method, 0.02)
        assert motion.event.kind.tolist() == ["inversion", "", "inversion"]
        assert motion.event.time[2] == pytest.approx(motion.event.time[0], abs=1e-9)
        assert np.isfinite(motion.F[:, 1]).all()
        alone = SOFT.simulate(np.eye(3), V[1], TIME[:21], method, 0.02)
        np.testing.assert_allclose(motion.F[:, 1], alone.F, atol=1e-13)
        assert np.ptp(motion.angular_momentum[:, 1]) < 1e-13


def test_stops_of_materials_on_singular_values_raise_nothing():
    ogden = Ogden((0.6,), (2.0,), (0.25,), (2.0,), 0.4, 3.0)
    V = np.diag([-40.0, 0.0, 0.0])
    motion = Body(1.7, ogden).simulate(np.eye(3), V, [0.0, 1.0], "suzuki_4", 0.2)
    plain = Body(1.7, MooneyRivlin(0.6, 0.25, 0.4, 3.0)).simulate(np.eye(3), V, [0.0, 1.0], "suzuki_4", 0.2)
    assert motion.event is not None
    assert motion.event.stopped.all()
    assert str(motion.event.kind) == str(plain.event.kind)
