"""The mean rotation of a body over a step, by which a load that turns with it counts."""

import numpy as np
import pytest

from forceid.flight.priors import body_fixed
from forceid.flight.priors.body_fixed import swept
from forceid.motion.free_rotation import free_turn

INERTIA = np.diag([1.0, 4.0, 5.0])
SPIN = np.array([3.0, 2.0, 5.0])


def top(time):
    """Rotations (time, 3, 3) of a free top."""
    many = (
        np.broadcast_to(a, (len(time), *a.shape)) for a in (np.eye(3), INERTIA @ SPIN, INERTIA, np.zeros(3))
    )
    return free_turn(time, *many)[0]


def missed(step):
    """By what `swept` misses the mean rotations of a top over steps, plain and weighted for the integral."""
    time = np.arange(12) * step
    early, mean = swept(np.diff(time), top(time))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    u, w = 0.5 + 0.5 * nodes, 0.5 * weights
    between = np.stack([top(time[:-1] + x * step) for x in u])
    off = (
        mean - np.einsum("u,utab->tab", w, between),
        early - np.einsum("u,utab->tab", 2 * (1 - u) * w, between),
    )
    return [np.abs(a[1:-1]).max() for a in off]


def test_mean_rotations_of_a_nutating_top_are_right_to_third_order_in_the_step():
    plain, weighted = (np.log2(a / b) for a, b in zip(missed(0.04), missed(0.02), strict=True))
    assert plain > 2.9
    assert weighted > 2.9
    assert max(missed(0.02)) < 2e-5


@pytest.mark.skipif(body_fixed.compiled is None, reason="no compiler was here")
@pytest.mark.parametrize("beside", [0, 2])
def test_compiled_steps_of_a_load_that_keeps_to_the_body_are_those_in_numpy(beside):
    rng, n = np.random.default_rng(3), 15
    size, time = n + beside, np.cumsum(rng.uniform(0.01, 0.03, 9))
    F, Q = np.zeros((3, size, size)), np.zeros((3, size, size))
    for axis in range(3):
        own = np.s_[:, axis:n:3, axis:n:3]
        F[own], root = np.triu(rng.standard_normal((3, n // 3, n // 3))), rng.standard_normal((3, n // 3, 4))
        Q[own] = root @ root.mT
    which = rng.integers(0, 3, len(time) - 1)
    at = top(time)
    early, mean = swept(np.diff(time), at)
    one, other = (
        fixed(F, Q, which, early, mean, at, n)
        for fixed in (body_fixed.compiled.fixed_to_body, body_fixed.fixed_in_numpy)
    )
    for ours, plain in zip(one, other, strict=True):
        np.testing.assert_allclose(ours, plain, rtol=1e-13, atol=1e-13)
    assert np.array_equal(one[1], one[1].swapaxes(1, 2))
