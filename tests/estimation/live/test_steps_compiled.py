"""One frame more: compiled, and as it is written in numpy."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.estimation.live import loads, sight
from forceid.kalman.recursions import fixed_lag
from forceid.motion import Products, ReadingCov, frame_fit

NOTHING = np.zeros(0)


@pytest.mark.skipif(loads.ONWARD is None, reason="nothing was compiled")
@pytest.mark.parametrize("shown", [True, False])
@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize("step", [0.002, 0.05])
def test_a_compiled_step_is_what_is_written_in_numpy(step, fixed, shown):
    """Of a moment along axes of the world, or of the body beside one line of the world; seen or not."""
    rng = np.random.default_rng(0)
    F, Q = rng.standard_normal((2, 15, 15))
    axes, own, R, seen_R = Rotation.random(4, random_state=1).as_matrix()
    F[:, :3] = np.eye(15, 3)
    F[:3, 3:6], F[3:6, 3:6] = step * np.eye(3), np.eye(3)
    rows, read = rng.standard_normal((2, 3, 15))
    prior = SimpleNamespace(axes=axes, body_axes=own if fixed else None, vectors=9)
    model = SimpleNamespace(moment=prior, least=1.0, turns=fixed)
    swings = [
        sight.Swing(NOTHING, np.diag([1.0, 2.0, 2.5]) + 0.01 * k, 0.1 * rng.standard_normal(3))
        for k in (0, 1)
    ]
    C, gain = rng.standard_normal((12, 15)), 0.1 * rng.standard_normal((15, 3))
    x = np.append(np.zeros(3), rng.standard_normal(12))
    course = fixed_lag.Course(x, np.eye(15), gain, 0.1 * np.eye(3), C[:, 0], C, 20 + C[:, 1])
    looked = SimpleNamespace(cov=np.diag(np.arange(1.0, 7)))
    seen = sight.Seen(NOTHING, seen_R, looked) if shown else None
    linear = F, Q @ Q.T, rows, read if fixed else None
    plain = loads.onward_in_numpy(model, course, R, (step, 1), seen, swings, (*linear, np.inf))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loads, "transition", lambda *_: (*linear[:2], None))
        patch.setattr(loads, "still_rows", lambda *_: linear[2:])
        compiled = loads.next_moment(model, course, R, (step, 1), seen, swings, False)
    for one, other in zip((*compiled[0], *compiled[1:]), (*plain[0], *plain[1:]), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-8 * np.abs(other).max(initial=1e-300))


@pytest.mark.skipif(sight.SEE is None, reason="nothing was compiled")
@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("modes", [0, 2])
def test_a_compiled_look_is_what_is_written_in_numpy(modes, shared):
    """Of a body that swings or not, with a marker missing, whose center is that of markers or of the pose."""
    rng = np.random.default_rng(0)
    shape, each = rng.standard_normal((6, 3)), 3
    flags = np.arange(6) != 4
    fit = frame_fit(shape, np.ones(6), flags, ReadingCov.of(0.01 * np.eye(18)))
    share = np.array([0.5, 0.25, 0.25, 0, 0, 0]) if shared else None
    n = modes * each
    F, gain, leak = (0.1 * rng.standard_normal(size) for size in ((n, n), (n, 15), (6, n)))
    read = sight.Sight(fit, share, np.eye(6), F, gain, leak)
    products = Products(
        np.eye(3) + 0.1 * rng.standard_normal((modes + 1, modes + 1, 3, 3)),
        rng.standard_normal((modes + 1, modes, 3)),
    )
    swings = SimpleNamespace(each=each) if modes else None
    model = SimpleNamespace(swings=swings, products=products, inside=rng.standard_normal(3), seen=flags)
    x = shape @ Rotation.random(random_state=3).as_matrix().T + 0.01 * rng.standard_normal((6, 3))
    x[4] = np.nan
    before = sight.moved(model, rng.standard_normal(n))
    plain, after = sight.look_in_numpy(model, read, x, before.x)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sight, "sight", lambda *_: read)
        seen, swing, lacking = sight.look(model, x, before, 1)
    assert lacking == 0
    for one, other in zip((*seen[:2], *swing), (*plain[:2], *after), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max(initial=1e-300))
