"""A filter that tells its output a lag behind."""

import numpy as np
import pytest

from forceid import kalman
from forceid.kalman.recursions import fixed_lag
from forceid.kalman.recursions.fixed_lag import NO_FRAME, begun, followed, followed_in_numpy, without_first


def model_of(T=60, n=5, seed=1):
    """A model whose matrices change with time, three of whose states are seen, some frames not."""
    rng = np.random.default_rng(seed)
    F = np.eye(n) + 0.1 * rng.standard_normal((T - 1, n, n))
    Q, R = (0.1 * a @ a.swapaxes(1, 2) for a in (rng.standard_normal((T, k, k)) for k in (n, 3)))
    R = R + 0.1 * np.eye(3)
    z = rng.standard_normal((T, 3))
    z[20:26] = np.nan
    return kalman.StateSpace(F, Q[:-1], np.eye(3, n), R, np.zeros(n), 4 * np.eye(n)), z


def told(model, z, rows, lag, follow):
    """Output and variance at every frame, `lag` frames behind."""
    n, found = len(model.x0), []
    course = begun(model.x0, model.P0)
    for k in range(len(z)):
        F, Q = (model.F[k - 1], model.Q[k - 1]) if k else (np.eye(n), np.zeros((n, n)))
        seen = z[k] if np.isfinite(z[k]).all() else NO_FRAME
        course, _ = follow(course, F @ course.x, F, Q, rows, seen, model.R[k])
        if k >= lag:
            found.append((course.y[:3], course.var[:3]))
            course = without_first(course, 1)
    rest = len(course.y) // 3
    found += [(course.y[3 * i : 3 * i + 3], course.var[3 * i : 3 * i + 3]) for i in range(rest)]
    return (np.array(a) for a in zip(*found, strict=True))


@pytest.mark.parametrize("follow", [followed, followed_in_numpy])
def test_with_a_lag_as_long_as_the_record_it_is_the_smoother(follow):
    model, z = model_of()
    rows = np.random.default_rng(2).standard_normal((3, 5))
    y, var = told(model, z, rows, len(z), follow)
    smooth = kalman.smooth(model, z, engine="numpy")
    np.testing.assert_allclose(y, smooth.x @ rows.T, atol=1e-9)
    np.testing.assert_allclose(var, np.einsum("ij,tjk,ik->ti", rows, smooth.P, rows), rtol=1e-8)


def test_with_no_lag_it_is_the_filter():
    model, z = model_of()
    rows = np.eye(3, 5)
    y, var = told(model, z, rows, 0, followed)
    own = kalman.filter(model, z, engine="numpy")
    np.testing.assert_allclose(y, own.x[:, :3], atol=1e-9)
    np.testing.assert_allclose(var, np.diagonal(own.P, axis1=1, axis2=2)[:, :3], rtol=1e-8)


def test_with_a_lag_it_is_the_smoother_of_the_record_up_to_there():
    model, z = model_of()
    rows, lag, k = np.eye(3, 5), 7, 30
    y, _ = told(model, z, rows, lag, followed)
    end = k + lag + 1
    part = kalman.StateSpace(
        model.F[: end - 1], model.Q[: end - 1], model.H, model.R[:end], model.x0, model.P0
    )
    np.testing.assert_allclose(y[k], kalman.smooth(part, z[:end], engine="numpy").x[k, :3], atol=1e-9)


@pytest.mark.skipif(fixed_lag.FOLLOW is None, reason="nothing was compiled")
@pytest.mark.parametrize(("states", "pending"), [(3, 0), (5, 1), (8, 3), (21, 50), (27, 13)])
def test_what_is_compiled_is_what_is_written_in_numpy(states, pending):
    rng = np.random.default_rng(states)
    a = rng.standard_normal((states, states))
    course = fixed_lag.Course(
        rng.standard_normal(states), a @ a.T, 0.1 * rng.standard_normal((states, 3)), np.eye(3),
        rng.standard_normal(3 * pending), rng.standard_normal((3 * pending, states)), np.ones(3 * pending),
    )  # fmt: skip
    F, rows = np.eye(states) + 0.1 * rng.standard_normal((states, states)), rng.standard_normal((3, states))
    for z in (rng.standard_normal(3), NO_FRAME):
        given = (course, F @ course.x, F, 0.1 * np.eye(states), rows, z, 0.5 * np.eye(3))
        (one, off), (other, beside) = followed(*given), followed_in_numpy(*given)
        assert off == pytest.approx(beside)
        for x, y in zip(one, other, strict=True):
            np.testing.assert_allclose(x, y, rtol=1e-9, atol=1e-9 * max(np.abs(y).max(initial=0.0), 1.0))


@pytest.mark.parametrize("follow", [followed, followed_in_numpy])
def test_a_frame_too_far_off_changes_nothing(follow):
    one = np.eye(3)
    course, off = follow(begun(np.zeros(3), one), np.zeros(3), one, 0 * one, one, 9 * np.ones(3), one, 25.0)
    assert off > 25
    assert course.x.tolist() == course.y.tolist() == [0, 0, 0]
    assert course.var.tolist() == [1, 1, 1]
    assert len(course.gain) == 0
