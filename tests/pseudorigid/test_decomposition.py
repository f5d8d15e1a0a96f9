"""Polar and bipolar factors and their rates, compiled and in numpy."""

import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.motion.pose import exp
from forceid.pseudorigid.factors import decomposition
from forceid.pseudorigid.factors.decomposition import bipolar, bipolar_rates, polar, polar_rates

F_STAR = np.array([[1.2, 0.3, -0.1], [0.2, 0.9, 0.4], [-0.3, 0.1, 0.7]])


@pytest.fixture(params=["compiled", "numpy"], autouse=True)
def engine(request, monkeypatch):
    if request.param == "numpy":
        monkeypatch.setattr(decomposition, "compiled", None)
    elif decomposition.compiled is None:
        pytest.skip("no compiler was here")


def scaled_rotation(q):
    """|q|^2 Q of whole-numbered quaternions, exact."""
    w, x, y, z = q.T
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def exact_polar(count, values, seed=0):
    """F of whole numbers below 2^53, and its polar rotation: a whole-numbered rotation times stretch."""
    rng = np.random.default_rng(seed)
    q, p = rng.integers(-7, 8, (count, 4)), rng.integers(-3, 4, (count, 4))
    q[:, 0] += ~q.any(1)
    p[:, 0] += ~p.any(1)
    A, B = scaled_rotation(q), scaled_rotation(p)
    F = A @ (B * np.array(values)) @ B.swapaxes(1, 2)
    assert np.abs(F).max() < 2**53
    return F.astype(float), A / (q * q).sum(1)[:, None, None]


def random_deformations(count, seed=1):
    rng = np.random.default_rng(seed)
    F = rng.standard_normal((count, 3, 3))
    F[np.linalg.det(F) < 0, 0] *= -1
    return F, rng.standard_normal((count, 3, 3))


def off_orthogonal(L):
    return np.abs(L.swapaxes(-1, -2) @ L - np.eye(3)).max()


@pytest.mark.parametrize(
    "values",
    [
        (3, 2, 1),
        (2**20, 2**19, 1),
        (2**20, 2**20, 1),
        (2**20, 2**10, 1),
        (2**20, 1, 1),
        (2**30, 1, 1),
        (1, 1, 1),
    ],
)
def test_polar_rotation_is_exact_to_the_last_digits_at_any_condition(values):
    F, R = exact_polar(500, values)
    L, U = polar(F)
    assert np.abs(L - R).max() < 2e-15
    assert off_orthogonal(L) < 3e-15
    size = np.abs(F).max((1, 2), keepdims=True)
    np.testing.assert_allclose(L @ U / size, F / size, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(U, U.swapaxes(1, 2))


@pytest.mark.parametrize("values", [(3, 2, 1), (2**20, 2**20, 1), (2**20, 1, 1), (1, 1, 1)])
def test_bipolar_factors_are_rotations_that_give_back_the_matrix(values):
    F, Q = exact_polar(500, values)
    L, D, R = bipolar(F)
    size = np.abs(F).max((1, 2))
    np.testing.assert_allclose(
        L * D[:, None] @ R / size[:, None, None], F / size[:, None, None], rtol=0, atol=2e-14
    )
    assert max(off_orthogonal(L), off_orthogonal(R)) < 5e-15
    assert np.linalg.det(L).min() > 0.99
    assert np.abs(L @ R - Q).max() < 5e-15
    np.testing.assert_allclose(
        D / size[:, None], np.linalg.svd(F, compute_uv=False) / size[:, None], rtol=0, atol=1e-14
    )
    assert (D[:, 2] > 0).all()


def test_factors_of_the_sample_deformation_are_the_published_ones():
    L, U = polar(F_STAR)
    printed = [
        [0.99665392707453, 0.014873134294533, 0.080372504771119],
        [-0.028267335311506, 0.98534994636807, 0.16818573348183],
        [-0.076693594265190, -0.16989488829476, 0.98247331746465],
    ]
    np.testing.assert_allclose(L, printed, rtol=0, atol=2e-14)
    np.testing.assert_allclose(
        bipolar(F_STAR)[1], [1.35950668820664, 1.05676095050727, 0.418327453323796], rtol=1e-14
    )
    np.testing.assert_allclose(U @ U, F_STAR.T @ F_STAR, rtol=0, atol=1e-14)


def test_polar_factors_agree_with_scipy_on_random_deformations():
    F, _ = random_deformations(300)
    L, U = polar(F)
    for k in range(len(F)):
        R, P = scipy.linalg.polar(F[k])
        np.testing.assert_allclose(L[k], R, rtol=0, atol=1e-12)
        np.testing.assert_allclose(U[k], P, rtol=0, atol=1e-12)


def test_shear_turns_by_half_of_its_angle():
    k = np.linspace(-1.2, 1.2, 25)
    F = np.tile(np.eye(3), (25, 1, 1))
    F[:, 0, 1] = alpha = 2 * np.tan(k)
    L, _ = polar(F)
    np.testing.assert_allclose(L, exp(-k[:, None] * np.array([0, 0, 1])), rtol=0, atol=1e-14)
    root = np.sqrt(4 + alpha**2)
    stretches = np.stack([(root + abs(alpha)) / 2, np.ones(25), (root - abs(alpha)) / 2], 1)
    np.testing.assert_allclose(bipolar(F)[1], stretches, rtol=1e-13)


def test_factors_do_not_depend_on_what_else_is_in_the_batch():
    F, _ = random_deformations(37)
    L, R = polar(F.reshape(37, 1, 3, 3))[0], bipolar(F)[2]
    assert L.shape == (37, 1, 3, 3)
    for k in (0, 5, 36):
        np.testing.assert_array_equal(polar(F[k])[0], L[k, 0])
        np.testing.assert_array_equal(bipolar(F[k])[2], R[k])
    assert [x.shape for x in polar(np.zeros((0, 3, 3)))] == [(0, 3, 3), (0, 3, 3)]


def test_of_matrices_that_are_flat_to_rounding_those_with_det_above_zero_are_decomposed():
    rng = np.random.default_rng(11)
    A, B = (Rotation.random(200, rng=rng).as_matrix() for _ in range(2))
    taken = 0
    for F in A * [1.0, 0.5, 1e-18] @ B:
        whole = [[int(x * 2**80) for x in row] for row in F]  # exact: no entry is below 2^-27
        a, b, c = whole
        det = sum(a[i] * (b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2]) for i in range(3))
        if det <= 0:
            with pytest.raises(DataError, match="expected > 0"):
                polar(F)
            continue
        taken += 1
        L, U = polar(F)
        assert off_orthogonal(L) < 3e-15
        assert np.linalg.det(L) > 0.99
        np.testing.assert_allclose(L @ U, F, rtol=0, atol=1e-14)
        assert bipolar(F)[1][2] > 0
    assert 50 < taken < 150


@pytest.mark.parametrize("scale", [1e-90, 1e90])
def test_factors_scale_with_the_unit_of_length(scale):
    F, _ = random_deformations(40)
    D = bipolar(scale * F)[1]
    np.testing.assert_allclose(polar(scale * F)[0], polar(F)[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(D / scale, bipolar(F)[1], rtol=1e-10)


def test_two_engines_give_the_same_factors(monkeypatch):
    F, _ = random_deformations(200, seed=7)
    one = polar(F), bipolar(F)[1]
    monkeypatch.setattr(decomposition, "compiled", None)
    two = polar(F), bipolar(F)[1]
    np.testing.assert_allclose(one[0][0], two[0][0], rtol=0, atol=3e-15)
    np.testing.assert_allclose(one[0][1], two[0][1], rtol=0, atol=1e-13)
    np.testing.assert_allclose(one[1], two[1], rtol=0, atol=1e-13)


@pytest.mark.parametrize("decompose", [polar, bipolar])
def test_a_folded_or_flat_frame_is_refused_by_its_number(decompose):
    F = np.tile(np.eye(3), (2, 4, 1, 1))
    F[1, 2] = np.diag([1.0, 1.0, -1.0])
    with pytest.raises(DataError, match=r"F\[1, 2\] has determinant -1, expected > 0; no body"):
        decompose(F)
    with pytest.raises(DataError, match="F has determinant 0, expected"):
        decompose(np.arange(1.0, 10.0).reshape(3, 3))  # exactly singular
    F[1, 2] = np.nan
    with pytest.raises(DataError, match=r"F\[1, 2\] is not finite"):
        decompose(F)
    with pytest.raises(DataError, match=r"shape \(2, 2\)"):
        decompose(np.eye(2))


def test_polar_rates_are_the_slopes_of_the_factors():
    F, dF = random_deformations(100, seed=3)
    F += 2.5 * np.eye(3) * np.sign(np.linalg.det(F + 2.5 * np.eye(3)))[:, None, None]
    F = F[np.linalg.det(F) > 0.5]
    dF, h = dF[: len(F)], 1e-3
    omega, dU = polar_rates(F, dF)
    steps = {m: polar(F + m * h * dF) for m in (-2, -1, 1, 2)}
    slope = [(8 * (steps[1][i] - steps[-1][i]) - steps[2][i] + steps[-2][i]) / (12 * h) for i in (0, 1)]
    xi = polar(F)[0].swapaxes(1, 2) @ slope[0]
    np.testing.assert_allclose(np.stack([xi[:, 2, 1], xi[:, 0, 2], xi[:, 1, 0]], 1), omega, rtol=0, atol=1e-7)
    np.testing.assert_allclose(slope[1], dU, rtol=0, atol=1e-7)


def test_bipolar_rates_give_back_the_rate_of_the_matrix():
    F, dF = random_deformations(300, seed=4)
    rates = bipolar_rates(F, dF)
    assert rates.defined.all()
    xi, eta = np.cross(rates.omega[:, None], -np.eye(3)), np.cross(rates.lam[:, None], -np.eye(3))
    L, D, R = rates.L, rates.D[:, None] * np.eye(3), rates.R
    again = L @ (xi @ D + rates.dD[:, None] * np.eye(3) + D @ eta) @ R
    size = np.abs(rates.omega).max((1,)) + np.abs(dF).max((1, 2))
    assert (np.abs(again - dF).max((1, 2)) / size).max() < 1e-13


def test_bipolar_rates_of_a_motion_with_known_factors_are_those():
    rng = np.random.default_rng(5)
    omega, lam, dD = rng.standard_normal((3, 50, 3))
    D = np.sort(rng.uniform(0.5, 3, (50, 3)))[:, ::-1] + [0.2, 0.1, 0]
    L, R = (Rotation.random(50, rng=rng).as_matrix() for _ in range(2))
    xi, eta = np.cross(omega[:, None], -np.eye(3)), np.cross(lam[:, None], -np.eye(3))
    dF = L @ (xi * D[:, None] + dD[:, None] * np.eye(3) + D[..., None] * eta) @ R
    rates = bipolar_rates(L * D[:, None] @ R, dF, (L, D, R))
    for name, true in (("omega", omega), ("lam", lam), ("dD", dD)):
        np.testing.assert_allclose(getattr(rates, name), true, rtol=0, atol=1e-12)


def test_rates_are_undefined_only_about_the_axis_of_equal_values():
    F, dF = np.diag([2.0, 2.0, 1.0]), np.array([[0.3, 0.5, 0.2], [0.1, -0.3, 0.4], [0.0, 0.6, 0.1]])
    rates = bipolar_rates(F, dF)
    assert rates.defined.tolist() == [True, True, False]
    assert np.isnan(rates.omega).tolist() == [False, False, True]
    assert np.isnan(rates.lam).tolist() == [False, False, True]
    # dD are the slopes of the values on both sides, not ordered
    h = 1e-6
    ordered = (np.linalg.svd(F + h * dF)[1] - np.linalg.svd(F - h * dF)[1]) / (2 * h)
    sides = (np.linalg.svd(F + h * dF)[1] - [2, 2, 1]) / h
    np.testing.assert_allclose(np.sort(rates.dD[:2]), np.sort(sides[:2]), atol=1e-5)
    np.testing.assert_allclose(rates.dD[2], ordered[2], atol=1e-8)
    np.testing.assert_allclose(rates.L * rates.D @ rates.R, F, atol=1e-14)


def test_rates_of_a_sphere_are_undefined_about_all_axes_but_its_stretch_is_not():
    dF = np.array([[0.3, 0.5, 0.2], [0.1, -0.3, 0.4], [0.0, 0.6, 0.1]])
    rates = bipolar_rates(np.eye(3), dF)
    assert not rates.defined.any()
    np.testing.assert_allclose(np.sort(rates.dD), np.linalg.eigvalsh(0.5 * (dF + dF.T)), atol=1e-14)
    omega, dU = polar_rates(np.eye(3), dF)
    np.testing.assert_allclose(
        omega, 0.5 * np.array([dF[2, 1] - dF[1, 2], dF[0, 2] - dF[2, 0], dF[1, 0] - dF[0, 1]])
    )
    np.testing.assert_allclose(dU, 0.5 * (dF + dF.T), atol=1e-15)
