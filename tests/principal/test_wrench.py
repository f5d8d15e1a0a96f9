import numpy as np
import pytest
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from principal_bodies import (
    BOOMERANG,
    BOOMERANG_FORCE,
    BOOMERANG_MASS,
    TRUSS,
    boomerang_acceleration,
    frame_mass,
    truss_mass,
)
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.principal import wrench as wrench_module
from forceid.principal.mass import mass_center, mass_properties
from forceid.principal.operator import summation_operator
from forceid.principal.wrench import (
    resultant,
    transport,
    transport_cov,
)

free = settings(deadline=None, derandomize=True, max_examples=40)
near = st.floats(-10, 10)
masses = arrays(float, 5, elements=st.floats(0.01, 2))
field = arrays(float, (5, 3), elements=near)
point = arrays(float, 3, elements=near)
turn = arrays(float, 3, elements=st.floats(-3, 3)).map(lambda v: Rotation.from_rotvec(v).as_matrix())


def six(R):
    return np.kron(np.eye(2), R)


def test_boomerang_has_its_published_acceleration_and_resultants():
    a = boomerang_acceleration()
    np.testing.assert_allclose(a.ravel(), [40, -20 / 3, -14, 32, -7.5, -10], rtol=1e-12)
    about_1 = resultant(BOOMERANG_MASS, BOOMERANG, a, about=BOOMERANG[0])
    about_c = resultant(BOOMERANG_MASS, BOOMERANG, a)
    np.testing.assert_allclose(about_1, [0.2, 1, 0.285], rtol=1e-9)
    np.testing.assert_allclose(about_c, [0.2, 1, 0.13 / 3], rtol=1e-9)
    J = mass_properties(BOOMERANG_MASS, BOOMERANG).inertia
    np.testing.assert_allclose(about_c[2] / J, 11.73814898, rtol=1e-9)


def test_resultant_of_accelerations_is_that_of_the_applied_forces_whatever_the_springs_do():
    S = summation_operator(BOOMERANG, about=[0.3, 0.1])
    g = resultant(BOOMERANG_MASS, BOOMERANG, boomerang_acceleration(), about=[0.3, 0.1])
    np.testing.assert_allclose(g, S.T @ BOOMERANG_FORCE, rtol=1e-12)


def spinning_boomerang():
    """Current positions from the mass center and accelerations of the rigid body at 10 turns a second."""
    c, s = np.cos(0.4), np.sin(0.4)
    rho = (BOOMERANG - mass_center(BOOMERANG_MASS, BOOMERANG)) @ np.array([[c, -s], [s, c]]).T
    a = np.array([3, -9.81]) - 35 * np.c_[-rho[:, 1], rho[:, 0]] - (20 * np.pi) ** 2 * rho
    return rho, a


def test_moment_of_the_spinning_boomerang_is_right_at_the_current_shape_only():
    rho, a = spinning_boomerang()
    np.testing.assert_allclose(resultant(BOOMERANG_MASS, rho, a), [0.36, -1.1772, -0.129208333], rtol=1e-8)
    stale = resultant(BOOMERANG_MASS, BOOMERANG, a)
    np.testing.assert_allclose(stale, [0.36, -1.1772, -5.794437], rtol=1e-7)


@free
@given(masses, field, field, turn, point, point)
def test_resultant_turns_with_the_frame_and_ignores_where_its_origin_is(m, x, a, R, shift, about):
    g = resultant(m, x, a, about)
    turned = resultant(m, x @ R.T + shift, a @ R.T, R @ about + shift)
    np.testing.assert_allclose(turned, six(R) @ g, rtol=1e-10, atol=1e-10 * 100 * m.sum())
    default = resultant(m, x @ R.T + shift, a @ R.T)
    np.testing.assert_allclose(default, six(R) @ resultant(m, x, a), rtol=1e-10, atol=1e-10 * 100 * m.sum())


@free
@given(masses, field, field, point, point)
def test_resultant_about_another_point_is_the_transported_one(m, x, a, p, q):
    carried = transport(resultant(m, x, a, p), p - q)
    np.testing.assert_allclose(carried, resultant(m, x, a, q), rtol=1e-10, atol=1e-10 * 100 * m.sum())
    from_center = transport(resultant(m, x, a), mass_center(m, x) - p)
    np.testing.assert_allclose(from_center, resultant(m, x, a, p), rtol=1e-10, atol=1e-10 * 100 * m.sum())


@pytest.mark.parametrize("axis", [2, 3])
@pytest.mark.parametrize("kind", ["lumped", "consistent", "sparse"])
@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("about", [None, "fixed", "moving"])
def test_every_route_gives_the_operator_form_frame_by_frame(axis, kind, moving, about):
    rng = np.random.default_rng(7)
    x, a = rng.normal(size=(6, 9, axis)), rng.normal(size=(6, 9, axis))
    x = x if moving else x[0]
    m = rng.uniform(0.1, 1, 9)
    M = np.diag(np.repeat(m, axis)) if kind == "lumped" else truss_mass(TRUSS[:, :axis])
    p = None if about is None else rng.normal(size=(6, axis))[0 if about == "fixed" else slice(None)]
    g = resultant({"lumped": m, "consistent": M, "sparse": scipy.sparse.csr_array(M)}[kind], x, a, p)
    for k in range(6):
        xk = x[k] if moving else x
        pk = mass_properties(M, xk).center if p is None else np.broadcast_to(p, (6, axis))[k]
        expected = summation_operator(xk, pk).T @ M @ a[k].ravel()
        np.testing.assert_allclose(g[k], expected, rtol=1e-12, atol=1e-12 * np.abs(M).sum())


@pytest.mark.parametrize("kind", [np.asarray, scipy.sparse.csr_array])
def test_rigid_acceleration_of_a_welded_frame_gives_back_force_and_moment(kind):
    p = mass_properties(frame_mass(), TRUSS)
    pattern = np.array([0.3, -1.0, 0.2, 0.5, 0.4, -0.7])
    a = summation_operator(TRUSS, p.center, rotations=True) @ pattern
    g = resultant(kind(frame_mass()), TRUSS, a.reshape(9, 6))
    np.testing.assert_allclose(g, p.matrix @ pattern, rtol=1e-12)
    moving = resultant(kind(frame_mass()), np.stack([TRUSS, TRUSS]), np.stack([a, a]).reshape(2, 9, 6))
    np.testing.assert_allclose(moving, [g, g], rtol=1e-12)


def wobbling(t, origin=0.0):
    """Positions, velocities and accelerations (time, 9, 3) of nodes that each swing on their own."""
    rng = np.random.default_rng(11)
    size, rate, phase = (
        rng.normal(size=(9, 3)),
        rng.uniform(20, 60, size=(9, 3)),
        rng.uniform(0, 6, size=(9, 3)),
    )
    s = rate * t[:, None, None] + phase
    drift = np.array([20.0, 0.0, 2.0])
    x = TRUSS + origin + drift * t[:, None, None] + size * np.sin(s)
    return x, drift + size * rate * np.cos(s), -size * rate**2 * np.sin(s)


def eighth_order_rate(y, dt):
    weights = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / dt
    return sum(w * y[k : len(y) - 8 + k] for k, w in enumerate(weights))


@pytest.mark.parametrize("M", [np.linspace(0.5, 2, 9), truss_mass()], ids=["lumped", "consistent"])
def test_rate_of_momentum_is_the_resultant_about_the_center_and_about_a_moving_point(M):
    dt = 1 / 4000
    t = np.arange(200) * dt
    x, v, a = wobbling(t)
    inside = slice(4, -4)
    g = resultant(M, x, a)
    rate = eighth_order_rate(resultant(M, x, v), dt)
    np.testing.assert_allclose(rate, g[inside], rtol=0, atol=1e-7 * np.abs(g).max())

    p = np.array([0.5, -1.0, 0.2]) + np.array([3.0, -40.0, 7.0]) * t[:, None] ** 2
    point_velocity = 2 * np.array([3.0, -40.0, 7.0]) * t[:, None]
    h = resultant(M, x, v, about=p)
    g = resultant(M, x, a, about=p)
    rate = eighth_order_rate(h, dt)
    corrected = rate + transport(h[inside], point_velocity[inside]) - h[inside]  # + v_p x P
    np.testing.assert_allclose(corrected, g[inside], rtol=0, atol=1e-7 * np.abs(g).max())
    assert np.abs(rate - g[inside]).max() > 1e-4 * np.abs(g).max()


def test_moment_survives_a_flight_far_from_the_origin():
    t = np.arange(50) / 1000
    x, _, a = wobbling(t)
    far, _, _ = wobbling(t, origin=1e5)
    m = np.linspace(0.5, 2, 9)
    np.testing.assert_allclose(resultant(m, far, a), resultant(m, x, a), rtol=0, atol=1e-8 * np.abs(a).max())


def test_gap_in_a_node_with_mass_is_a_gap_and_without_mass_is_none():
    x, _, a = wobbling(np.arange(3) / 100)
    m = np.linspace(0.5, 2, 9)
    x[1, 4] = np.nan
    g = resultant(m, x, a)
    assert np.isnan(g[1, 3:]).all()
    assert np.isfinite(g[[0, 2]]).all()
    m[4] = 0.0
    assert np.isfinite(resultant(m, x, a)).all()


@free
@given(arrays(float, (6, 6), elements=st.floats(-2, 2)), point)
def test_transported_covariance_is_that_of_transported_samples(L, arm):
    samples = np.concatenate([L, -L])  # a set with covariance L^T L / 6, exactly
    carried = transport(samples, arm)
    np.testing.assert_allclose(
        transport_cov(samples.T @ samples / 12, arm), carried.T @ carried / 12, rtol=1e-10, atol=1e-10
    )
    np.testing.assert_allclose(transport(carried, -arm), samples, atol=1e-12)


def test_planar_transport_is_the_planar_part_of_the_spatial_one():
    g, arm = np.random.default_rng(4).normal(size=(5, 3)), np.array([0.3, -0.2])
    spatial = transport(np.c_[g[:, :2], np.zeros((5, 3)), g[:, 2]], [*arm, 0.0])
    np.testing.assert_allclose(transport(g, arm), spatial[:, [0, 1, 5]], atol=1e-15)


def test_acceleration_of_other_nodes_is_refused_by_name():
    with pytest.raises(DataError, match=r"acceleration has shape \(4, 3\), expected \(..., 9, 3\)"):
        resultant(np.ones(9), TRUSS, np.zeros((4, 3)))
    with pytest.raises(DataError, match="acceleration has shape"):
        resultant(frame_mass(), TRUSS, np.zeros((9, 3)))


@pytest.mark.skipif(wrench_module.compiled is None, reason="no compiler was here")
@pytest.mark.parametrize("nodes", [1, 3, 21, 22, 100, 700])
def test_compiled_sums_are_those_in_numpy(nodes, monkeypatch):
    """Of short and of long frames, whole registers of them or not, and of every other frame."""
    rng = np.random.default_rng(nodes)
    mass, x = rng.uniform(0.5, 1.5, nodes), rng.standard_normal((nodes, 3))
    a = rng.standard_normal((3, 7, nodes, 3))
    ours = resultant(mass, x, a), resultant(mass, x, a[0, ::2])
    monkeypatch.setattr(wrench_module, "compiled", None)
    plain = resultant(mass, x, a), resultant(mass, x, a[0, ::2])
    for mine, theirs in zip(ours, plain, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-12 * nodes)
