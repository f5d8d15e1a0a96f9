import numpy as np
import pytest

from forceid.errors import DataError
from forceid.pseudorigid import Body, SelfGravity, index_symbols, maclaurin, riemann_tilted

LIQUID = Body(1.0, SelfGravity(), incompressible=True)
AXES = {"I": (1.0, 1.25, 0.4703), "II": (0.8, 2.67, 0.33), "III": (0.8, 2.67, 0.33)}


LONG = [pytest.param(kind, step, marks=pytest.mark.long) for kind, step in (("II", 0.12), ("III", 0.2))]


@pytest.mark.parametrize(("kind", "step"), [("I", 0.25), *LONG])
def test_tilted_ellipsoid_stays_steady_over_turns_of_the_master_system(kind, step):
    pair = [e for e in riemann_tilted(*AXES[kind]) if e.kind == kind]
    assert len(pair) == 2
    for ellipsoid in pair:
        time = np.linspace(0, 2 * 2 * np.pi / np.linalg.norm(ellipsoid.w), 40)
        exact, rate = ellipsoid.motion(time)
        assert np.count_nonzero(ellipsoid.w) == np.count_nonzero(ellipsoid.l) == 2  # tilted, in one plane
        found = LIQUID.simulate(exact[0], rate[0], time, "kahan_li_8", step)
        np.testing.assert_allclose(found.F, exact, atol=1e-8)
        np.testing.assert_allclose(found.dF, rate, atol=1e-8)
        stretch = np.linalg.svd(found.F, compute_uv=False)
        np.testing.assert_allclose(stretch, np.broadcast_to(stretch[0], stretch.shape), atol=1e-8)
        size = np.cbrt(ellipsoid.axes.prod())
        np.testing.assert_allclose(found.pressure, 2 * ellipsoid.pressure / size**2, atol=1e-8)
        unit = 5 * np.sqrt(4 / 3)
        np.testing.assert_allclose(found.angular_momentum[0], unit * ellipsoid.angular_momentum, atol=1e-12)
        np.testing.assert_allclose(found.circulation[0], unit * ellipsoid.circulation, atol=1e-12)
        D = np.diag(ellipsoid.axes)
        flow = D @ np.cross(np.eye(3), ellipsoid.l) @ np.linalg.inv(D)  # in the figure: D l^ D^-1 x
        curl = [flow[2, 1] - flow[1, 2], flow[0, 2] - flow[2, 0], flow[1, 0] - flow[0, 1]]
        np.testing.assert_allclose(ellipsoid.vorticity, curl, atol=1e-13)


def test_the_pair_is_adjoint_and_its_transpose_moves_too():
    for axes in AXES.values():
        for faster, adjoint in zip(riemann_tilted(*axes)[::2], riemann_tilted(*axes)[1::2], strict=True):
            np.testing.assert_allclose(np.abs(faster.w), np.abs(adjoint.l), atol=1e-13)
            np.testing.assert_allclose(np.abs(faster.l), np.abs(adjoint.w), atol=1e-13)
            assert faster.pressure == pytest.approx(adjoint.pressure, rel=1e-12)
            assert np.linalg.norm(faster.w) > np.linalg.norm(adjoint.w)


def test_drawn_axes_have_the_types_of_their_inequalities_and_no_tension():
    rng = np.random.default_rng(2)
    kinds = []
    for axes in np.exp(rng.uniform(-1.5, 1.5, (400, 3))):
        b1, b2, b3 = np.sort(axes)[::-1]
        for e in riemann_tilted(*axes):
            allowed = {
                "I": 2 * b2 >= b1 + b3 and axes[e.normal] == b2,
                "II": 2 * b2 <= b1 - b3 and axes[e.normal] == b2,
                "III": 2 * b3 <= b1 - b2 and axes[e.normal] == b3,
            }
            assert allowed[e.kind]
            assert e.pressure > 0
            F, _ = e.motion(0.0)
            D = np.diag(F)
            W, Z = (np.cross(np.eye(3), v) for v in (e.w, e.l))
            acceleration = W @ W @ F + 2 * W @ F @ Z + F @ Z @ Z
            Lambda = 2 * e.pressure / np.cbrt(axes.prod()) ** 2
            expected = np.diag(-2 * index_symbols(*axes) * D + Lambda / D)
            np.testing.assert_allclose(acceleration, expected, atol=1e-9 * max(1, Lambda / D.min()))
            kinds.append(e.kind)
    assert min(kinds.count(kind) for kind in ("I", "II", "III")) > 20


def test_type_one_ends_at_maclaurin_spheroids_and_at_pairs_that_are_one():
    nearly_round = riemann_tilted(1 - 1e-10, 1.0, 0.5)[0]
    assert nearly_round.w[1] < 1e-4  # no tilt is left: figure and liquid together turn as the spheroid
    assert nearly_round.w[2] + nearly_round.l[2] == pytest.approx(maclaurin(np.sqrt(0.75)).w, rel=1e-8)
    faster, adjoint = riemann_tilted(0.8 + 1e-12, 1.0, 0.6)  # 2 a1 = a2 + a3
    np.testing.assert_allclose(faster.w, adjoint.w, rtol=1e-4)
    assert not riemann_tilted(0.8 - 1e-9, 1.0, 0.6)


def test_axes_without_a_tilted_motion_have_none_and_a_bad_axis_is_refused():
    for axes in ((1, 1, 1), (1, 0.9, 0.9), (1, 1, 0.5), (1, 0.6, 0.3), (2.0, 1e-3, 1e-3)):
        assert riemann_tilted(*axes) == ()
    for axes in ((1, 0, 1), (1, -1, 1), (1, np.nan, 1), ("a", 1, 1)):
        with pytest.raises(DataError):
            riemann_tilted(*axes)
