import numpy as np
import pytest
from printed_motions import PRINTED

from forceid.errors import ConfigError, DataError
from forceid.pseudorigid.body import Body
from forceid.pseudorigid.factors.cofactors import cofactor, determinant
from forceid.pseudorigid.material.materials import MooneyRivlin, NeoHookean
from forceid.pseudorigid.motion.constrained import volume_root
from forceid.pseudorigid.motion.splittings import COMPOSITIONS
from forceid.pseudorigid.steady.gravity import SelfGravity

F0 = np.diag([1.25, 0.8, 1.0])
V0 = F0 @ np.array([[0.1, -0.5, 0.2], [0.7, 0.05, -0.3], [0.1, 0.25, -0.15]])
RIEMANN = Body(1.0, SelfGravity(pi_G_rho=1.0), incompressible=True)
F1, V1 = PRINTED["riemann"]


@pytest.mark.parametrize(("method", "step"), [("dop853", None), ("kahan_li_8", 0.1), ("kahan_li_6", 0.02)])
def test_riemann_ellipsoid_reaches_the_printed_state_with_the_printed_invariants(method, step):
    motion = RIEMANN.simulate(F0, V0, [0.0, 1.0], method, step)
    assert motion.energy[0] == pytest.approx(-3.47923390681306, rel=1e-13)
    np.testing.assert_allclose(motion.angular_momentum, [[0.44, 0.125, 1.2]] * 2, atol=1e-11)
    np.testing.assert_allclose(motion.circulation, [[0.442, 0.2125, 1.22925]] * 2, atol=1e-11)
    np.testing.assert_allclose(motion.F[1], F1, rtol=0, atol=1e-11)
    np.testing.assert_allclose(motion.dF[1], V1, rtol=0, atol=1e-10)


@pytest.mark.long
def test_riemann_ellipsoid_keeps_volume_momentum_and_circulation_over_100_s():
    motion = RIEMANN.simulate(F0, V0, np.linspace(0, 100, 5001), "verlet", 0.02)
    assert motion.method == "rattle_verlet"
    assert np.abs(determinant(motion.F) - 1).max() <= 1e-15
    assert np.abs(motion.angular_momentum - motion.angular_momentum[0]).max() <= 3e-14
    assert np.abs(motion.circulation - motion.circulation[0]).max() <= 3e-14
    assert np.abs(np.einsum("tij,tij->t", cofactor(motion.F), motion.dF)).max() < 2e-15
    tenths = [part.mean() for part in np.array_split(motion.energy[:-1] - motion.energy[0], 10)]
    assert np.abs(motion.energy - motion.energy[0]).max() < 2e-5
    assert abs(np.polyfit(range(10), tenths, 1)[0]) * 9 < 0.5 * np.std(motion.energy)


@pytest.mark.long
@pytest.mark.parametrize(("method", "step"), [("verlet", 0.05), ("suzuki_4", 0.1), ("kahan_li_8", 0.2)])
def test_spinning_rubber_keeps_volume_momentum_and_circulation_and_its_energy_has_no_trend(method, step):
    # 0.55 to 1.45 of stretch, three turns in 10 s
    Y = np.array([[0.1, -0.9, 0.2], [1.1, 0.05, -0.3], [0.1, 0.25, -0.15]])
    body = Body(1.7, MooneyRivlin(0.6, 0.25, incompressible=True))
    motion = body.simulate(F0, F0 @ Y, np.linspace(0, 40, 201), method, step)
    assert np.abs(determinant(motion.F) - 1).max() <= 1e-15
    assert np.abs(np.einsum("tij,tij->t", cofactor(motion.F), motion.dF)).max() <= 1e-15
    assert np.abs(motion.angular_momentum - motion.angular_momentum[0]).max() <= 1e-14
    assert np.abs(motion.circulation - motion.circulation[0]).max() <= 1e-14
    assert motion.event is None
    assert motion.pressure.min() > 0
    change = motion.energy[:-1] - motion.energy[0]
    tenths = [part.mean() for part in np.array_split(change, 10)]
    assert np.abs(change).max() < {"verlet": 1e-3, "suzuki_4": 1e-5, "kahan_li_8": 1e-8}[method]
    assert abs(np.polyfit(range(10), tenths, 1)[0]) * 9 < 0.3 * np.std(change)


def test_circulation_of_rubber_is_not_kept_where_the_second_moment_is_uneven():
    body = Body(np.diag([1.0, 1.5, 2.2]), MooneyRivlin(0.6, 0.25, incompressible=True))
    motion = body.simulate(F0, V0, np.linspace(0, 10, 51), "verlet", 0.05)
    assert np.abs(motion.angular_momentum - motion.angular_momentum[0]).max() <= 1e-14
    assert np.ptp(motion.circulation, axis=0).max() > 0.1


@pytest.mark.long
@pytest.mark.parametrize("method", COMPOSITIONS)
def test_composed_rattle_converges_with_its_nominal_order(method):
    W = Body(np.diag([1.0, 1.5, 2.2]), MooneyRivlin(0.5, 0.25, incompressible=True))
    step = {"verlet": 0.05, "kahan_li_8": 0.25}.get(method, 0.1)
    exact = W.simulate(F0, V0, [0.0, 4.0], "kahan_li_8", 0.025).F[-1]
    errors = [np.abs(W.simulate(F0, V0, [0.0, 4.0], method, h).F[-1] - exact).max() for h in (step, step / 2)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(COMPOSITIONS[method].order, abs=0.1)


def test_rattle_agrees_with_the_index_reduced_reference_for_a_full_second_moment():
    E = np.diag([1.0, 1.5, 2.2]) + 0.2
    body = Body(E, MooneyRivlin(0.5, 0.25, incompressible=True))
    exact, found = (body.simulate(F0, V0, [0.0, 3.0], m, 0.05) for m in ("dop853", "kahan_li_8"))
    np.testing.assert_allclose(found.F, exact.F, atol=1e-11)
    np.testing.assert_allclose(found.pressure, exact.pressure, rtol=1e-10)
    np.testing.assert_allclose(found.angular_momentum[1], found.angular_momentum[0], atol=1e-14)


def test_multiplier_carries_gamma_so_that_it_changes_the_pressure_only():
    plain = Body(1.0, MooneyRivlin(0.5, 0.25, incompressible=True))
    full = Body(1.0, MooneyRivlin(0.5, 0.25, 0.4, 3.0), incompressible=True)
    a, b = (body.simulate(F0, V0, [0.0, 2.0], "kahan_li_6", 0.05) for body in (plain, full))
    np.testing.assert_allclose(a.F, b.F, atol=1e-13)
    np.testing.assert_allclose(b.pressure - a.pressure, 2 * 0.4 - 3.0, atol=1e-12)


def test_maclaurin_spheroid_at_rest_has_the_pressure_of_the_note():
    # e = 0.5: Lambda = 2 A_3 a_3^2, and Omega^2 of the table turns it rigidly
    e, square = 0.5, 0.13799364234218
    a = (1 - e**2) ** (-1 / 6)
    D = np.diag([a, a, a * np.sqrt(1 - e**2)])
    spin = np.sqrt(square) * np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]])
    motion = RIEMANN.simulate(D, spin @ D, np.linspace(0, 3, 7), "kahan_li_8", 0.1)
    A3 = 2 / e**2 * (1 - np.sqrt(1 - e**2) * np.arcsin(e) / e)
    np.testing.assert_allclose(motion.pressure, 2 * A3 * D[2, 2] ** 2, rtol=1e-11)
    np.testing.assert_allclose(np.linalg.svd(motion.F)[1], [[a, a, D[2, 2]]] * 7, rtol=1e-11)


def test_tension_is_flagged_with_its_time_and_does_not_stop_the_body():
    # a soft body that spins is held together by tension from the start; a quiet one is not
    body = Body(1.0, NeoHookean(0.1, incompressible=True))
    spin = np.array([[0.0, -2, 0], [2, 0, 0], [0, 0, 0]])
    calm = 0.01 * spin
    motion = body.simulate(np.eye(3), np.stack([spin, calm]), np.linspace(0, 1, 11), "kahan_li_6", 0.05)
    assert motion.event is not None
    assert motion.event.kind.tolist() == ["tension", ""]
    assert motion.event.time[0] == 0
    assert np.isnan(motion.event.time[1])
    assert not motion.event.stopped.any()
    assert np.isfinite(motion.F).all()
    assert "tension at t = 0 s" in str(motion.event)


def test_tension_that_comes_later_is_timed_within_the_sample():
    body = Body(1.0, NeoHookean(1.0, incompressible=True))
    twist = np.array([[0.0, -1.2, 0], [1.2, 0, 0], [0, 0, 0]]) + np.diag([0.6, 0.4, -1.0])
    fine = body.simulate(np.eye(3), 1.2 * twist, np.linspace(0, 3, 1501), "verlet")
    assert fine.event is not None
    k = int((fine.pressure < 0).argmax())
    assert k > 0
    coarse = body.simulate(np.eye(3), 1.2 * twist, np.linspace(0, 3, 61), "kahan_li_6", 0.05)
    assert fine.time[k - 1] <= fine.event.time <= fine.time[k]
    assert coarse.event.time == pytest.approx(float(fine.event.time), abs=1e-3)


def test_batches_of_incompressible_bodies_move_as_they_do_alone():
    rng = np.random.default_rng(21)
    F = np.eye(3) + 0.1 * rng.standard_normal((20, 3, 3))
    F /= np.cbrt(np.linalg.det(F))[:, None, None]
    Y = 0.3 * rng.standard_normal((20, 3, 3))
    V = F @ (Y - np.trace(Y, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3))
    body = Body(1.3, NeoHookean(1.0, incompressible=True))
    motion = body.simulate(F, V, [0.0, 1.0], "suzuki_4", 0.1)
    alone = body.simulate(F[7], V[7], [0.0, 1.0], "suzuki_4", 0.1)
    np.testing.assert_allclose(motion.F[:, 7], alone.F, atol=1e-14)
    assert np.abs(determinant(motion.F[1]) - 1).max() <= 1e-15


def test_dropping_gamma_without_the_constraint_is_refused():
    with pytest.raises(DataError, match=r"collapses; choose d > 0, or incompressible=True"):
        MooneyRivlin(0.5, 0.25)
    assert Body(1.0, MooneyRivlin(0.5, 0.25, incompressible=True)).constrained


def test_starts_off_the_constraint_are_refused_with_the_correction():
    with pytest.raises(
        DataError, match=r"det F0 = 1.1, expected 1; divide F0 by det\(F0\)\^\(1/3\) = 1.0322"
    ):
        RIEMANN.simulate(np.diag([1.1, 1, 1]), np.zeros((3, 3)), [0, 1])
    with pytest.raises(DataError, match=r"tr\(F0\^-1 dF0\) = 0.3, expected 0.*subtract 0.1 F0 from dF0"):
        RIEMANN.simulate(F0, V0 + 0.1 * F0, [0, 1])


def test_methods_that_do_not_keep_the_volume_are_refused():
    with pytest.raises(ConfigError, match="'blanes_moan_6' does not keep det F = 1"):
        RIEMANN.simulate(F0, V0, [0, 1], "blanes_moan_6")


def test_volume_root_solves_the_cubic_and_says_where_it_cannot():
    rng = np.random.default_rng(22)
    A, K = (
        np.eye(3) + 0.05 * rng.standard_normal((100, 3, 3)),
        np.eye(3) + 0.1 * rng.standard_normal((100, 3, 3)),
    )
    s = volume_root(A, K)
    np.testing.assert_allclose(determinant(A + s[:, None, None] * K), 1, rtol=0, atol=2e-15)
    assert np.isnan(volume_root(2 * np.eye(3)[None], np.zeros((1, 3, 3)))).all()
