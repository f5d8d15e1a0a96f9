import numpy as np
import pytest
from printed_motions import PRINTED

from forceid.errors import ConfigError, DataError
from forceid.pseudorigid.body import Body
from forceid.pseudorigid.material.formless import PerfectGas
from forceid.pseudorigid.material.materials import (
    HadamardGreen,
    MooneyRivlin,
    NeoHookean,
    StVenantKirchhoff,
)
from forceid.pseudorigid.motion import splittings
from forceid.pseudorigid.motion.splittings import SPLITTINGS
from forceid.pseudorigid.motion.system import AffineSystem
from forceid.pseudorigid.steady.gravity import SelfGravity
from forceid.pseudorigid.steady.natural_modes import natural_modes
from forceid.pseudorigid.steady.spectra import stiffness_matrix

F0 = np.array([[1.1, 0.2, 0.0], [-0.1, 0.95, 0.15], [0.05, 0.0, 1.05]])
V0 = np.array([[0.1, -0.4, 0.3], [0.5, 0.0, -0.2], [-0.1, 0.3, -0.05]])
MOONEY = Body(1.7, MooneyRivlin(0.6, 0.25, 0.4, 3.0))
EARS = np.diag([1.0, 1.5, 2.2])
INVARIANTS = {  # section 12.8: body, energy, angular momentum and circulation
    "neo-hookean": (Body(EARS, NeoHookean(1.0, 0.5, 3.0)), 4.04585369293418, (0.858, 0.718, 1.031), None),
    "mooney-rivlin": (MOONEY, 3.57846812418418, (0.80325, 0.629, 1.5215), (0.7565, 0.64175, 1.564)),
    "gas": (
        Body(1.0, PerfectGas(1.0, 5 / 3)),
        1.71730364415652,
        (0.4725, 0.37, 0.895),
        (0.445, 0.3775, 0.92),
    ),
    "st venant-kirchhoff": (
        Body(EARS, StVenantKirchhoff(1.3, 0.7)),
        0.506960937500000,
        (0.858, 0.718, 1.031),
        None,
    ),
}


@pytest.mark.parametrize("method", ["dop853", "kahan_li_8"])
@pytest.mark.parametrize("name", INVARIANTS)
def test_trajectory_reaches_the_printed_state_with_the_printed_invariants(name, method):
    (body, energy, momentum, circulation), (F1, V1) = INVARIANTS[name], PRINTED[name]
    motion = body.simulate(F0, V0, [0.0, 1.0], method, 0.05)
    np.testing.assert_allclose(motion.energy, energy, rtol=1e-11)
    np.testing.assert_allclose(motion.angular_momentum, [momentum] * 2, atol=1e-11)
    if circulation is not None:
        np.testing.assert_allclose(motion.circulation, [circulation] * 2, atol=1e-11)
    np.testing.assert_allclose(motion.F[1], F1, rtol=1e-10)
    np.testing.assert_allclose(motion.dF[1], V1, rtol=1e-10)
    assert motion.event is None
    assert motion.pressure is None


def test_verlet_keeps_momentum_and_circulation_over_2000_s_and_energy_has_no_trend():
    motion = MOONEY.simulate(F0, V0, np.linspace(0, 2000, 4001), "verlet", 0.05)
    assert motion.step == pytest.approx(0.05)
    for kept in (motion.angular_momentum, motion.circulation):
        assert np.abs(kept - kept[0]).max() <= 3e-14
    tenths = [part.mean() for part in np.array_split(motion.energy[:-1] - motion.energy[0], 10)]
    spread = np.std(motion.energy)
    assert np.abs(motion.energy - motion.energy[0]).max() < 3e-4
    assert abs(np.polyfit(range(10), tenths, 1)[0]) * 9 < 0.2 * spread


def error(method, step, body=MOONEY):
    times = [0.0, 1.3, 5.2]
    exact = body.simulate(F0, V0, times, "dop853")
    return np.abs(body.simulate(F0, V0, times, method, step).F[-1] - exact.F[-1]).max()


@pytest.mark.parametrize(
    ("method", "step"),
    [
        ("verlet", 0.05),
        ("suzuki_4", 0.1),
        ("kahan_li_6", 0.1),
        ("blanes_moan_6", 0.1),
        ("kahan_li_8", 0.26),
    ],
)
def test_error_falls_with_the_nominal_order(method, step):
    measured = np.log2(error(method, step) / error(method, step / 2))
    assert measured == pytest.approx(SPLITTINGS[method].order, abs=0.1)


@pytest.mark.parametrize("name", SPLITTINGS)
def test_splittings_are_symmetric_and_consistent(name):
    table = SPLITTINGS[name]
    assert sum(table.kick) == pytest.approx(1, abs=1e-15)
    assert sum(table.drift) == pytest.approx(1, abs=1e-15)
    assert table.kick == pytest.approx(table.kick[::-1], abs=1e-16)
    assert table.drift == pytest.approx(table.drift[::-1], abs=1e-16)


@pytest.mark.parametrize("method", SPLITTINGS)
def test_momentum_and_energy_stay_as_each_method_promises(method):
    motion = MOONEY.simulate(F0, V0, np.linspace(0, 10, 51), method, 0.05)
    assert np.ptp(motion.angular_momentum, axis=0).max() < 1e-14
    assert np.ptp(motion.circulation, axis=0).max() < 1e-14
    assert np.ptp(motion.energy) < 4e-4


def test_momentum_is_kept_and_circulation_is_not_where_the_second_moment_is_uneven():
    E = EARS + 0.2 * np.ones((3, 3))
    motion = Body(E, NeoHookean(1.0, 0.5, 3.0)).simulate(F0, V0, np.linspace(0, 20, 41), "verlet", 0.05)
    assert np.ptp(motion.angular_momentum, axis=0).max() < 1e-14
    assert np.ptp(motion.circulation, axis=0).max() > 0.1


def test_every_method_agrees_with_the_reference_for_a_full_second_moment():
    body = Body(EARS + 0.2 * np.ones((3, 3)), MooneyRivlin(0.6, 0.25, 0.4, 3.0))
    for method, bound in (("kahan_li_8", 1e-12), ("blanes_moan_6", 1e-8), ("verlet", 1e-3)):
        assert error(method, 0.05, body) < bound


def test_a_body_without_forces_flies_straight():
    gas = Body(1.0, PerfectGas(1e-300, 1.4))
    motion = gas.simulate(F0, V0, np.linspace(0, 7, 15), "verlet", 0.5)
    np.testing.assert_allclose(motion.F, F0 + motion.time[:, None, None] * V0, atol=1e-15)


def test_natural_mooney_rivlin_vibrates_at_the_printed_frequencies():
    W = MooneyRivlin(0.6, 0.25, 0.4, 3.0)
    squares = natural_modes(W, 1.7 * np.eye(3)).squared
    np.testing.assert_allclose(squares[:3], 0, atol=1e-14)
    np.testing.assert_allclose(squares[3:8], 2, rtol=1e-14)
    assert squares[8] == pytest.approx(6.58823529411765, rel=1e-14)
    e = np.array([1.0, 1.5, 2.2])
    squares = natural_modes(W, np.diag(e)).squared
    shear = 1.7 * (1 / e[[0, 0, 1]] + 1 / e[[1, 2, 2]])
    own = np.linalg.eigvals((2.6 * np.ones((3, 3)) + 3.4 * np.eye(3)) / e[:, None])
    np.testing.assert_allclose(squares, np.sort([0, 0, 0, *shear, *own.real]), atol=1e-13)
    assert AffineSystem(W, np.diag(e)).vibration(np.eye(3)) == pytest.approx(np.sqrt(squares[-1]), rel=1e-13)


class Trapped(PerfectGas):
    """A gas in a harmonic trap of unit frequency."""

    def energy(self, F):
        return super().energy(F) + 0.5 * (F**2).sum((-1, -2))

    def gradient(self, F):
        return super().gradient(F) + F

    def hessian(self, F, H):
        return super().hessian(F, H) + H


@pytest.mark.parametrize(("gamma", "period"), [(1.4, 3.49395922400503), (5 / 3, np.pi)])
def test_trapped_gas_breathes_with_the_printed_period(gamma, period):
    body = Body(1.0, Trapped(1.0, gamma))
    motion = body.simulate(1.3 * np.eye(3), np.zeros((3, 3)), [0.0, period / 2, period], "kahan_li_8", 0.05)
    np.testing.assert_allclose(motion.F[-1], 1.3 * np.eye(3), atol=1e-11)
    np.testing.assert_allclose(motion.dF[1:], 0, atol=1e-10)
    assert motion.F[1, 0, 0] < 0.9


def test_spinning_neo_hookean_body_of_the_printed_stretches_turns_rigidly():
    D = np.diag([1.01380674255519, 1.01380674255519, 0.990733529383202])
    spin = np.array([[0.0, -0.3, 0.0], [0.3, 0.0, 0.0], [0.0, 0.0, 0.0]])
    motion = Body(1.0, NeoHookean(1.0, 0.5, 3.0)).simulate(D, spin @ D, [0.0, 1.0, 8.0], "kahan_li_8", 0.1)
    np.testing.assert_allclose(motion.angular_momentum[:, 2], 0.616682466750217, rtol=1e-13)
    c, s = np.cos(0.3 * motion.time), np.sin(0.3 * motion.time)
    for F, cos, sin in zip(motion.F, c, s, strict=True):
        np.testing.assert_allclose(F, np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ D, atol=1e-12)


def test_bodies_of_a_batch_move_as_they_do_alone():
    rng = np.random.default_rng(20)
    F = np.eye(3) + 0.1 * rng.standard_normal((2, 700, 3, 3))
    V = 0.3 * rng.standard_normal((2, 700, 3, 3))
    times = [0.0, 0.4, 1.0]
    for method in ("blanes_moan_6", "dop853"):
        count = 700 if method == "blanes_moan_6" else 5
        motion = MOONEY.simulate(F[:, :count], V[:, :count], times, method, 0.1)
        assert motion.F.shape == (3, 2, count, 3, 3)
        assert motion.energy.shape == (3, 2, count)
        assert motion.angular_momentum.shape == (3, 2, count, 3)
        for i, j in ((0, 0), (1, 3), (1, count - 1)):
            alone = MOONEY.simulate(F[i, j], V[i, j], times, method, 0.1)
            np.testing.assert_allclose(motion.F[:, i, j], alone.F, rtol=0, atol=1e-13)
            np.testing.assert_allclose(motion.energy[:, i, j], alone.energy, rtol=1e-13)


@pytest.mark.skipif(splittings.compiled is None, reason="no compiler")
@pytest.mark.parametrize(
    "body",
    [
        MOONEY,
        Body(EARS, NeoHookean(1.0, 0.5, 3.0)),
        Body(EARS, HadamardGreen(1.2, 0.3, 0.0, 2.0)),
    ],
)
def test_compiled_steps_are_those_of_numpy(body, monkeypatch):
    rng = np.random.default_rng(23)
    F = np.eye(3) + 0.1 * rng.standard_normal((11, 3, 3))
    V = 0.3 * rng.standard_normal((11, 3, 3))
    V[4] = np.diag([-12.0, 0.0, 0.0])  # jumps over the barrier
    assert splittings.compiled_law(body.system) is not None
    fast = body.simulate(F, V, [0.0, 0.4, 2.0], "blanes_moan_6", 0.11)
    monkeypatch.setattr(splittings, "compiled", None)
    slow = body.simulate(F, V, [0.0, 0.4, 2.0], "blanes_moan_6", 0.11)
    np.testing.assert_allclose(fast.F, slow.F, rtol=0, atol=1e-13)
    np.testing.assert_allclose(fast.dF, slow.dF, rtol=0, atol=1e-13)
    assert fast.event.kind.tolist() == slow.event.kind.tolist()
    assert np.flatnonzero(fast.event.stopped).tolist() == [4]


def test_a_material_derived_from_mooney_rivlin_is_asked_for_its_own_force():
    class Pulled(MooneyRivlin):
        def energy(self, F):
            return super().energy(F) + 0.1 * F[..., 0, 0]

        def gradient(self, F):
            out = super().gradient(F)
            out[..., 0, 0] += 0.1
            return out

    motion = Body(1.7, Pulled(0.6, 0.25, 0.4, 3.0)).simulate(F0, V0, [0.0, 5.0], "kahan_li_8", 0.1)
    assert np.ptp(motion.energy) < 1e-9
    assert np.abs(motion.F[-1] - MOONEY.simulate(F0, V0, [0.0, 5.0], "kahan_li_8", 0.1).F[-1]).max() > 1e-2


def test_numpy_alone_keeps_momentum_and_circulation_as_well(monkeypatch):
    monkeypatch.setattr(splittings, "compiled", None)
    motion = MOONEY.simulate(F0, V0, np.linspace(0, 200, 401), "verlet", 0.05)
    for kept in (motion.angular_momentum, motion.circulation):
        assert np.abs(kept - kept[0]).max() <= 3e-15


def test_without_a_step_one_is_taken_from_the_fastest_vibration():
    motion = MOONEY.simulate(F0, V0, [0.0, 0.5, 2.0], "kahan_li_6")
    assert 0.05 < motion.step < 0.5
    exact = MOONEY.simulate(F0, V0, [0.0, 0.5, 2.0], "dop853")
    np.testing.assert_allclose(motion.F, exact.F, atol=1e-5)


def test_one_sample_gives_the_start():
    for method in ("verlet", "dop853"):
        motion = MOONEY.simulate(F0, V0, [3.0], method)
        np.testing.assert_array_equal(motion.F, [F0])


def test_gravity_lets_a_spherical_cloud_of_gas_oscillate_at_the_frequency_of_the_note():
    # radial omega^2 = (3 gamma - 4) 4/3 pi G rho about the balance K = 4/3 pi G rho mu
    class Star(SelfGravity):
        gas = PerfectGas(4 / 3, 1.5)

        def energy(self, F):
            return super().energy(F) + self.gas.energy(F)

        def gradient(self, F):
            return super().gradient(F) + self.gas.gradient(F)

        def hessian(self, F, H):
            return super().hessian(F, H) + self.gas.hessian(F, H)

    square = stiffness_matrix(Star(), np.eye(3))[::4, ::4].sum() / 3
    assert square == pytest.approx((3 * 1.5 - 4) * 4 / 3, rel=1e-12)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Body(np.diag([1.0, 1.0, 0.0]), MOONEY.material), "eigenvalue 0 beside 1.*flat or thin"),
        (lambda: Body(np.triu(np.ones((3, 3))), MOONEY.material), "not a finite symmetric"),
        (lambda: Body(np.eye(2), MOONEY.material), "shape \\(2, 2\\)"),
        (lambda: MOONEY.simulate(np.diag([1.0, 1, -1]), V0, [0, 1]), "det F0 = -1, expected > 0"),
        (lambda: MOONEY.simulate(F0 * np.nan, V0, [0, 1]), "not finite"),
        (lambda: MOONEY.simulate(np.zeros((0, 3, 3)), V0, [0, 1]), "holds no body"),
        (lambda: MOONEY.simulate(F0[0], V0[0], [0, 1]), "expected \\(..., 3, 3\\)"),
        (lambda: MOONEY.simulate(F0, V0, [0, 1, 1]), "growing"),
        (lambda: MOONEY.simulate(F0, V0, [0, 1], "verlet", 2.0), "beyond 0.7.*take a shorter one"),
        (lambda: MOONEY.simulate(F0, V0, [0, 1], "verlet", -1.0), "expected > 0"),
    ],
)
def test_bad_bodies_and_starts_are_refused_with_what_to_change(make, says):
    with pytest.raises(DataError, match=says):
        make()


def test_an_unknown_method_is_refused_with_the_names_there_are():
    with pytest.raises(ConfigError, match=r"'rk4' is unknown; choose one of verlet, .*dop853"):
        MOONEY.simulate(F0, V0, [0, 1], "rk4")
