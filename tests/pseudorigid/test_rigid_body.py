"""The free rigid body in closed form: printed values, an integration of its own, conservation, limits."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj

from evidence.subjects.affine.reduced.quaternions import quaternion, quaternion_rates, rotation
from forceid.errors import DataError
from forceid.principal import cross_matrix, mass_properties
from forceid.pseudorigid.body import Body
from forceid.pseudorigid.material.materials import MooneyRivlin
from forceid.pseudorigid.steady.rigid_body import free_rotation

PERIOD = 12.8454061684513872  # of omega, section 12.5
AXES = rotation(np.array([0.3, -0.5, 0.2, 0.7]))


def inertia(E):
    """tr(E) I - E."""
    return np.trace(E) * np.eye(3) - E


def any_axes(J):
    return AXES @ np.diag(J) @ AXES.T


def integrated(J, w0, L0, t):
    """Euler's equations and L' = L [w]x, rows of L crossed with w."""

    def rates(_, y):
        w, L = y[:3], y[3:].reshape(3, 3)
        return np.concatenate([np.linalg.solve(J, np.cross(J @ w, w)), np.cross(L, w).ravel()])

    start = np.concatenate([w0, L0.ravel()])
    run = solve_ivp(rates, (t[0], t[-1]), start, "DOP853", t, rtol=3e-14, atol=1e-15)
    return run.y[:3].T, run.y[3:].T.reshape(-1, 3, 3)


def test_inertia_of_points_is_the_trace_of_their_second_moment_less_that_and_has_no_half():
    rng = np.random.default_rng(3)
    m, X = rng.uniform(0.1, 1.0, 9), rng.standard_normal((9, 3))
    X -= m @ X / m.sum()
    second_moment = (m[:, None] * X).T @ X
    np.testing.assert_allclose(mass_properties(m, X).inertia, inertia(second_moment), atol=1e-14)


def test_printed_motion_of_section_12_5_comes_out_to_the_last_digit():
    motion = free_rotation(np.diag([2.0, 3, 4]), np.array([1.0, 0, 1]), np.array([1.0, 5, PERIOD]))
    expected = [
        [0.845956445829557, 0.615746367437572, 0.926186349564864],
        [-0.709932072666369, 0.813221127942975, 0.867180358345473],
        [1.0, 0, 1],
    ]
    np.testing.assert_allclose(motion.omega, expected, atol=2e-15)
    L = [
        [
            [0.51111341298428, -0.60663001630687, 0.60890319623327],
            [0.84304988874106, 0.21583347431567, -0.49262845680951],
            [0.16742151642264, 0.76512478373162, 0.62173475144823],
        ],
        [
            [0.70476821988560, 0.36510689763268, 0.60827519227758],
            [0.054383148149267, 0.82707819147347, -0.55944985332588],
            [-0.70735014627598, 0.42736239714089, 0.56304276220668],
        ],
    ]
    np.testing.assert_allclose(motion.L[:2], L, atol=1e-14)


def test_moments_1_2_3_give_the_bare_elliptic_functions():
    t = np.linspace(-30, 30, 101)
    sn, cn, dn, _ = ellipj(t, 1 / 3)
    motion = free_rotation(np.diag([1.0, 2, 3]), np.array([1.0, 0, 1]), t)
    np.testing.assert_allclose(motion.omega, np.stack([cn, sn, dn], -1), atol=1e-14)


def test_closed_form_is_the_integrated_motion_of_random_bodies():
    rng = np.random.default_rng(0)
    t = np.linspace(0, 6, 4)
    for _ in range(8):
        A = rng.standard_normal((3, 3))
        J, w0, L0 = (
            inertia(A @ A.T + 0.1 * np.eye(3)),
            rng.standard_normal(3),
            rotation(rng.standard_normal(4)),
        )
        omega, L = integrated(J, w0, L0, t)
        motion = free_rotation(J, w0, t, L0)
        np.testing.assert_allclose(motion.omega, omega, atol=2e-12)
        np.testing.assert_allclose(motion.L, L, atol=2e-12)


@pytest.mark.parametrize(
    ("moments", "omega0"),
    [
        ((1, 1, 1.7), (0.3, -0.8, 0.5)),
        ((1, 1.7, 1.7), (0.3, -0.8, 0.5)),
        ((1, 1, 1.7), (0.3, -0.8, 0)),
        ((1, 1.7, 1.7), (1e-9, -0.8, 0.5)),
        ((2, 2, 2), (0.3, -0.8, 0.5)),
        ((1, 2, 3), (0, 1, 0)),
        ((1, 2, 3), (0, 0, -1.3)),
        ((1, 2, 3), (1e-9, 0, -1.3)),
        ((1, 2, 3), (1.1, 1e-9, 0)),
        ((1, 2, 3), (0, -1e-5, 1.3)),
        ((1, 2, 3), (-1.1, 0.4, -0.1)),
    ],
)
def test_symmetric_and_steadily_spinning_bodies_need_no_other_formula(moments, omega0):
    J, w0, t = any_axes(moments), AXES @ np.array(omega0, float), np.linspace(0, 5, 6)
    omega, L = integrated(J, w0, np.eye(3), t)
    motion = free_rotation(J, w0, t)
    np.testing.assert_allclose(motion.omega, omega, atol=1e-12)
    np.testing.assert_allclose(motion.L, L, atol=1e-12)


@pytest.mark.parametrize("relative", [1e-3, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 3e-16])
@pytest.mark.parametrize("middle_is", ["largest", "smallest"])
def test_nearly_symmetric_bodies_lose_no_digits_where_the_phase_goes_slowly(relative, middle_is):
    # J2 next to J3 or J1, and a spin across that axis: near the separatrix, whose phase takes ages
    J, w0 = np.array([0.3, 1, 1 + relative]), np.array([7.5e-7, 0.46, 0.89])
    if middle_is == "smallest":
        J, w0 = np.array([1, 1 + relative, 1.7]), np.array([-0.46, 0.89, -7.5e-7])
    t = np.linspace(0, 3, 4)
    difference = J[[1, 2, 0]] - J[[2, 0, 1]]

    def rates(_, y):  # Euler's equations by differences of moments, which np.cross would round
        w, L = y[:3], y[3:].reshape(3, 3)
        return np.concatenate([difference * w[[1, 2, 0]] * w[[2, 0, 1]] / J, np.cross(L, w).ravel()])

    start = np.concatenate([w0, np.eye(3).ravel()])
    run = solve_ivp(rates, (0, 3), start, "DOP853", t, rtol=3e-14, atol=1e-16)
    motion = free_rotation(np.diag(J), w0, t)
    np.testing.assert_allclose(motion.omega, run.y[:3].T, rtol=0, atol=2e-14)
    np.testing.assert_allclose(motion.L, run.y[3:].T.reshape(-1, 3, 3), rtol=0, atol=5e-14)


def test_random_nearly_symmetric_bodies_keep_their_angular_momentum_and_come_to_an_end():
    rng, t = np.random.default_rng(3), np.linspace(0, 50, 20)
    for _ in range(150):
        J = 1 + np.cumsum([0.0, *10.0 ** rng.uniform(-16, -0.5, 2)])
        w0 = rng.standard_normal(3) * 10.0 ** rng.uniform(-8, 0, 3)
        motion = free_rotation(np.diag(J), w0, t)
        world = np.einsum("tab,tb->ta", motion.L, motion.omega * J)
        np.testing.assert_allclose(world, np.tile(J * w0, (20, 1)), atol=1e-14 * np.linalg.norm(J * w0))


@pytest.mark.parametrize(
    "omega0", [(3**0.5, 0.2, 1.0), (1e-6, 1, 0), (1e-5, 1, 1e-5), (-(3**0.5) * (1 + 1e-12), -0.5, 1)]
)
def test_a_body_that_tips_over_from_its_middle_axis_is_followed(omega0):
    J, w0, t = np.diag([1.0, 2, 3]), np.array(omega0), np.linspace(0, 12, 7)
    omega, L = integrated(J, w0, np.eye(3), t)
    motion = free_rotation(J, w0, t)
    np.testing.assert_allclose(motion.omega, omega, atol=1e-9)  # the body itself turns 1e-15 into e^12 of it
    np.testing.assert_allclose(motion.L, L, atol=1e-9)


def test_a_stiff_body_is_the_rigid_one_but_for_one_over_its_stiffness():
    E, w0, t = np.diag([1.0, 1.5, 2.2]), np.array([0.4, -0.7, 0.9]), np.array([0.0, 2.0])
    rigid = free_rotation(inertia(E), w0, t).L[-1]
    off = []
    for k in (1e3, 1e4, 1e5):
        body = Body(E, MooneyRivlin.natural(0.6 * k, 0.25 * k, 0.4 * k))
        motion = body.simulate(np.eye(3), cross_matrix(w0), t, "blanes_moan_6")
        off.append(k * np.abs(motion.F[-1] - rigid).max())
    np.testing.assert_allclose(off, 1.25, atol=0.2)  # vibrations of the start take part in it


def test_separatrix_ends_on_the_middle_axis():
    J, w0, t = np.diag([1.0, 2, 3]), np.array([3**0.5, 0, 1.0]), np.linspace(0, 8, 9)
    motion = free_rotation(J, w0, t)  # h^2 = 2T J2 = 12; h^2 - 2T J1 = 6, so the rate of the phase is 1
    np.testing.assert_allclose(motion.omega[:, 0], 3**0.5 / np.cosh(t), atol=1e-11)
    np.testing.assert_allclose(motion.omega[:, 1], 3**0.5 * np.tanh(t), atol=1e-11)


def test_energy_and_both_angular_momenta_stay_to_rounding_for_long():
    J, t = any_axes([1.0, 1.8, 2.5]), np.linspace(0, 1000, 400)
    motion = free_rotation(J, np.array([0.7, -0.9, 0.4]), t)
    momentum = motion.omega @ J
    world = np.einsum("tab,tb->ta", motion.L, momentum)
    energy = np.einsum("ta,ta->t", motion.omega, momentum)
    assert np.ptp(energy) < 2e-14 * energy[0]
    assert np.abs(world - world[0]).max() < 1e-14 * np.linalg.norm(world[0])
    assert np.abs(motion.L.swapaxes(1, 2) @ motion.L - np.eye(3)).max() < 1e-14


def test_rotation_turns_at_the_rate_that_is_said():
    J, t, h = any_axes([1.0, 1.8, 2.5]), np.linspace(0, 20, 41), 1e-3
    w0 = np.array([0.7, -0.9, 0.4])
    at = free_rotation(J, w0, t)
    L = [free_rotation(J, w0, t + k * h).L for k in (-2, -1, 1, 2)]
    dL = (L[0] - 8 * L[1] + 8 * L[2] - L[3]) / (12 * h)
    expected = np.cross(at.L, at.omega[:, None])
    np.testing.assert_allclose(dL, expected, atol=1e-10)


def test_quaternion_rates_are_those_of_the_rotation_at_any_length():
    rng = np.random.default_rng(1)
    q, w, h = 3 * rng.standard_normal((2, 7, 4)), rng.standard_normal((2, 7, 3)), 1e-5
    dq = quaternion_rates(q, w)
    dL = (rotation(q + h * dq) - rotation(q - h * dq)) / (2 * h)
    np.testing.assert_allclose(dL, np.cross(rotation(q), w[..., None, :]), atol=1e-9)
    back = quaternion(rotation(q))
    np.testing.assert_allclose(rotation(back), rotation(q), atol=1e-15)


@pytest.mark.parametrize(
    "J", [np.diag([1.0, 2, -3]), np.array([[1.0, 1, 0], [0, 2, 0], [0, 0, 3]]), np.ones(3)]
)
def test_what_is_no_inertia_is_refused(J):
    with pytest.raises(DataError, match=r"^inertia .*(symmetric positive definite|shape \(3,\))"):
        free_rotation(J, np.ones(3), np.array([0.0, 1]))
