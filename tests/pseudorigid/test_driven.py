import numpy as np
import pytest
from scipy.integrate import solve_ivp

from forceid.errors import ConfigError, DataError
from forceid.pseudorigid import Body, MooneyRivlin, NeoHookean, StVenantKirchhoff, multiplier
from forceid.pseudorigid.motion.system import AffineSystem

E = np.array([[0.03, 0.004, 0.0], [0.004, 0.02, -0.003], [0.0, -0.003, 0.05]])
MASS, WEIGHT, ETA = 0.7, np.array([0.0, 0.3, -6.9]), 0.004
F0 = np.array([[1.1, 0.1, 0.0], [-0.1, 0.95, 0.1], [0.0, 0.05, 1.0]])
V0 = np.array([[0.2, -3.0, 0.5], [2.5, 0.1, -0.4], [0.3, 0.2, -0.1]])
C0, U0 = np.array([0.1, -0.2, 1.5]), np.array([3.0, 0.5, 2.0])
TIME = np.linspace(0.0, 0.4, 21)
SHAPE = np.random.default_rng(5).normal(size=(3, 3))
LAME = 3.0, 2.0
REST = np.zeros((3, 3))


def force(t):
    return np.array([np.sin(7 * t), 0.4, np.cos(3 * t)])


def first_moment(t):
    return 0.3 * np.cos(11 * t) * SHAPE


def written_out(t, y):
    """The affine equations of St Venant and Kirchhoff, index by index."""
    F, V, velocity = y[:9].reshape(3, 3), y[9:18].reshape(3, 3), y[21:]
    G = (F.T @ F - np.eye(3)) / 2
    rate = (V.T @ F + F.T @ V) / 2
    S = LAME[0] * np.trace(G) * np.eye(3) + 2 * LAME[1] * G + 2 * ETA * rate
    acceleration = np.linalg.solve(E, (first_moment(t) - F @ S).T).T  # E is symmetric
    return np.concatenate([V.ravel(), acceleration.ravel(), velocity, (force(t) + WEIGHT) / MASS])


def test_driven_body_moves_as_the_affine_equations_written_out_say():
    start = np.concatenate([F0.ravel(), V0.ravel(), C0, U0])
    exact = solve_ivp(written_out, (0, TIME[-1]), start, "DOP853", TIME, rtol=1e-12, atol=1e-13).y.T
    body = Body(E, StVenantKirchhoff(*LAME), mass=MASS)
    loads = {"force": force, "first_moment": first_moment, "weight": WEIGHT, "damping": ETA}
    found = body.simulate(F0, V0, TIME, **loads, center=C0, velocity=U0)
    assert found.method == "dop853"
    together = (found.F.reshape(-1, 9), found.dF.reshape(-1, 9), found.center, found.velocity)
    np.testing.assert_allclose(np.hstack(together), exact, atol=1e-9)
    np.testing.assert_array_equal(found.force, [force(t) for t in TIME])
    np.testing.assert_array_equal(found.first_moment, [first_moment(t) for t in TIME])
    # what turns it is the skew part of N F^T
    N = found.first_moment @ found.F.mT
    turning = np.stack([(N - N.mT)[:, i, j] for i, j in ((2, 1), (0, 2), (1, 0))], -1)
    gained = np.gradient(found.angular_momentum, TIME, axis=0, edge_order=2)
    np.testing.assert_allclose(gained[2:-2], turning[2:-2], atol=0.02 * np.abs(turning).max())


def test_body_alone_loses_what_its_damping_takes():
    body = Body(E, NeoHookean.natural(1.0, 0.5))
    path = np.linspace(0, 0.2, 201)
    damped = body.simulate(F0, V0, path, damping=ETA)
    C_rate = damped.F.mT @ damped.dF
    C_rate = C_rate + C_rate.mT
    taken = ETA / 2 * np.einsum("tij,tij->t", C_rate, C_rate)
    lost = np.concatenate([[0], np.cumsum((taken[1:] + taken[:-1]) / 2 * np.diff(path))])
    np.testing.assert_allclose(damped.energy[0] - damped.energy, lost, atol=1e-4 * lost[-1])
    assert lost[-1] > 2e-3


def test_loads_may_ask_for_the_state():
    """A follower force on a spring and drag: both of the state, against a body that swings by hand."""
    k, drag = 40.0, 0.6
    body = Body(E, NeoHookean.natural(50.0, 50.0), mass=MASS)
    found = body.simulate(
        np.eye(3), REST, TIME, force=lambda t, s: -k * s.center - drag * s.velocity, center=C0
    )
    rate, loss = k / MASS, drag / MASS / 2
    w = np.sqrt(rate - loss**2)
    swing = np.exp(-loss * TIME) * (np.cos(w * TIME) + loss / w * np.sin(w * TIME))
    np.testing.assert_allclose(found.center, swing[:, None] * C0, atol=1e-11)
    carried = body.simulate(np.eye(3), REST, TIME, first_moment=lambda t, s: 0.2 * s.F @ SHAPE)
    np.testing.assert_allclose(carried.first_moment, 0.2 * carried.F @ SHAPE, atol=1e-15)


def test_free_body_moves_alike_when_nothing_but_its_center_is_asked_for():
    body = Body(E, NeoHookean.natural(1.0, 0.5))
    free, moved = body.simulate(F0, V0, TIME, "dop853"), body.simulate(F0, V0, TIME, velocity=U0)
    assert free.center is None
    np.testing.assert_allclose(moved.F, free.F, atol=1e-11)
    np.testing.assert_allclose(moved.center, TIME[:, None] * U0, atol=1e-13)


def test_bodies_of_a_batch_share_the_loads():
    body = Body(E, StVenantKirchhoff(*LAME), mass=MASS)
    both = body.simulate([F0, np.eye(3)], V0, TIME, first_moment=first_moment, force=force)
    lone = body.simulate(np.eye(3), V0, TIME, first_moment=first_moment, force=force)
    assert both.center.shape == (len(TIME), 2, 3)
    np.testing.assert_array_equal(both.F[:, 1], lone.F)
    np.testing.assert_array_equal(both.first_moment[:, 1], lone.first_moment)


def test_driven_body_of_constant_volume_keeps_it_and_its_pressure_carries_the_load():
    body = Body(E, MooneyRivlin(1.0, 0.5, incompressible=True))
    start = F0 / np.cbrt(np.linalg.det(F0))
    rate = V0 - np.trace(np.linalg.solve(start, V0)) / 3 * start
    found = body.simulate(start, rate, TIME, first_moment=first_moment, damping=ETA)
    np.testing.assert_allclose(np.linalg.det(found.F), 1, atol=1e-9)
    still = body.simulate(np.eye(3), REST, [0.0, 0.1], first_moment=-0.5 * np.eye(3))
    alone = multiplier(AffineSystem(body.material, E), np.eye(3), REST)
    np.testing.assert_allclose(still.pressure, alone + 0.5, rtol=1e-12)  # squeezed from all sides: no motion
    np.testing.assert_allclose(still.F, [np.eye(3)] * 2, atol=1e-12)
    assert body.simulate(np.eye(3), REST, [0.0, 0.1], first_moment=5 * np.eye(3)).event.kind == "tension"


def test_load_between_two_samples_far_into_the_motion_is_not_missed():
    body = Body(0.1, StVenantKirchhoff(0.0, 1e-9), mass=2.0)
    time = np.linspace(0, 20, 201)
    pushed = body.simulate(np.eye(3), REST, time, force=lambda t: [np.exp(-((t - 15.0) ** 2) / 0.02), 0, 0])
    assert pushed.velocity[-1, 0] == pytest.approx(np.sqrt(0.02 * np.pi) / 2, rel=1e-9)


@pytest.mark.parametrize(
    ("options", "error", "told"),
    [
        ({"force": [0, 0, 1.0]}, DataError, "has no mass to move"),
        ({"weight": [0, 0, 1.0]}, DataError, "has no mass to move"),
        ({"first_moment": [0, 0, 1.0]}, DataError, "first_moment has shape (3,), expected (3, 3)"),
        ({"first_moment": lambda t: np.full((3, 3), np.nan)}, DataError, "at t = 0 s is not finite"),
        ({"first_moment": lambda t: "none"}, DataError, "without real numbers"),
        ({"damping": -1.0}, DataError, "damping = -1, expected >= 0"),
        ({"center": [0.0, 1.0]}, DataError, "center has shape (2,)"),
        ({"damping": 1.0, "method": "verlet"}, ConfigError, "moves free bodies; take dop853"),
        ({"damping": 1.0, "method": "euler"}, ConfigError, "is unknown"),
    ],
)  # fmt: skip
def test_loads_that_cannot_be_are_refused(options, error, told):
    with pytest.raises(error) as caught:
        Body(E, StVenantKirchhoff(1.0, 1.0)).simulate(np.eye(3), REST, [0.0, 1.0], **options)
    assert told in str(caught.value)


@pytest.mark.parametrize("mass", [0.0, -1.0, np.nan, "one"])
def test_mass_is_a_number_above_zero(mass):
    with pytest.raises(DataError, match="mass"):
        Body(E, StVenantKirchhoff(1.0, 1.0), mass=mass)
