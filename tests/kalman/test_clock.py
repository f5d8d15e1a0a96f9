import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from forceid import kalman
from forceid.kalman import discretize, integrate, matern, resonator, superpose
from forceid.kalman.building.clock import discretize_steps, driven_apart
from forceid.kalman.building.lines import loosened


def scaled(error, Q):
    """Errors of covariances (step, state, state) in units of their standard deviations."""
    size = np.sqrt(np.diagonal(Q, axis1=-2, axis2=-1))
    return np.abs(error) / np.maximum(size[..., :, None] * size[..., None, :], np.finfo(float).tiny)


@settings(deadline=None, derandomize=True)
@given(
    order=st.integers(1, 4),
    turn=st.floats(1e-4, 1e3),
    jitter=st.floats(1e-6, 0.9),
    seed=st.integers(0, 9),
)
def test_every_step_of_a_clock_with_jitter_has_the_matrices_it_has_alone(order, turn, jitter, seed):
    rate = 20.0
    chain = integrate(integrate(matern(order, 1.5, rate), var=1.0), var=1.0)
    step = turn / rate * (1 + jitter * np.random.default_rng(seed).uniform(-1, 1, 600))
    F, Q = discretize_steps(chain, step)
    F_alone, Q_alone = discretize(chain, step)
    size = np.sqrt(np.diagonal(Q_alone, axis1=-2, axis2=-1))
    # states in units of the noise of a step, the spread of the start where it is more
    size = np.maximum(size, np.sqrt(np.diagonal(chain.P0)))
    assert (np.abs(F - F_alone) * size[:, None, :] / size[:, :, None]).max() < 1e-11
    assert scaled(Q - Q_alone, Q_alone).max() < 1e-11


def test_gaps_and_steps_of_no_length_are_exact_beside_short_steps():
    chain = superpose(matern(2, 1.0, 30.0), resonator(9.0, 0.3, 0.1))
    step = np.r_[0.0, np.random.default_rng(5).uniform(0.009, 0.011, 300), 0.05, 0.7, 40.0]
    F, Q = discretize_steps(chain, step)
    F_alone, Q_alone = discretize(chain, step)
    np.testing.assert_array_equal(F[0], np.eye(len(chain.A)))
    assert not Q[0].any()
    np.testing.assert_allclose(F, F_alone, rtol=1e-11, atol=1e-11 * np.abs(F_alone).max())
    assert scaled(Q - Q_alone, Q_alone)[1:].max() < 1e-11


def test_many_processes_over_many_steps_are_each_by_itself():
    each = [matern(2, 1.0, rate) for rate in (3.0, 40.0)]
    both = type(each[0])(
        *(np.stack([getattr(c, n) for c in each]) for n in ("A", "Qc", "P0")), each[0].output
    )
    step = np.random.default_rng(6).uniform(0.004, 0.03, 200)
    F, Q = discretize_steps(both, step)
    for k, one in enumerate(each):
        F_one, Q_one = discretize_steps(one, step)
        np.testing.assert_allclose(F[:, k], F_one, rtol=1e-11, atol=1e-13 * np.abs(F_one).max())
        np.testing.assert_allclose(Q[:, k], Q_one, rtol=1e-11, atol=1e-13 * np.abs(Q_one).max())


def test_steps_that_are_all_alike_are_the_one_step_they_are():
    chain = integrate(integrate(matern(3, 2.0, 7.0), var=1.0), var=1.0)
    F, Q = discretize_steps(chain, np.full(900, 0.004))
    F_one, Q_one = discretize_steps(chain, np.array([0.004]))
    np.testing.assert_allclose(F, np.broadcast_to(F_one, F.shape), rtol=1e-13)
    np.testing.assert_allclose(Q, np.broadcast_to(Q_one, Q.shape), rtol=1e-13)


def drawn_load(rng):
    """A load of any kind that may stand beside others in a chain."""
    kinds = (
        lambda: matern(int(rng.integers(1, 5)), rng.uniform(0.1, 3.0, 4), rng.uniform(3.0, 60.0, 4)),
        lambda: resonator(rng.uniform(2.0, 60.0), rng.uniform(0.1, 3.0, 4), rng.choice([0.0, 2.0])),
        lambda: loosened(resonator(rng.uniform(2.0, 60.0), np.ones(4), 0.0), 0.1),
        lambda: kalman.integrated_wiener(int(rng.integers(1, 4)), np.full(4, 3.0), 1.0),
        lambda: kalman.random_walk(0.0, np.ones(4)),
    )
    return kinds[int(rng.integers(len(kinds)))]()


@settings(deadline=None, derandomize=True, max_examples=60)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 6))
def test_loads_beside_each_other_go_by_themselves_and_have_the_matrices_of_all(seed, count):
    rng = np.random.default_rng(seed)
    chain = integrate(integrate(superpose(*(drawn_load(rng) for _ in range(count))), np.ones(4)), np.ones(4))
    order = rng.permutation(len(chain.output))  # in whichever places
    chain = kalman.Process(
        *(a[..., order[:, None], order] for a in (chain.A, chain.Qc, chain.P0)), chain.output[order]
    )
    step = 0.01 * (1 + 0.8 * rng.uniform(-1, 1, 80))
    F, Q = discretize_steps(chain, step)
    F_alone, Q_alone = discretize(
        kalman.Process(chain.A[None], chain.Qc[None], chain.P0, chain.output), step[:, None]
    )
    size = np.maximum(np.sqrt(np.diagonal(Q_alone, axis1=-2, axis2=-1)), 1.0)
    assert (np.abs(F - F_alone) * size[..., None, :] / size[..., :, None]).max() < 1e-10
    assert scaled(Q - Q_alone, Q_alone).max() < 1e-10


def test_parts_are_what_nothing_else_moves_and_all_that_they_move():
    chain = integrate(superpose(matern(2, 1.0, 3.0), loosened(resonator(5.0, 1.0, 0.0), 0.1)), var=1.0)
    assert [own.tolist() for own in driven_apart(chain.A, chain.Qc)] == [[0, 1, 2], [0, 3, 4, 5, 6]]
    shaken = chain.Qc.copy()
    shaken[2, 3] = shaken[3, 2] = 0.1
    assert [own.tolist() for own in driven_apart(chain.A, shaken)] == [list(range(7))]
    alone = matern(3, 1.0, 3.0)
    assert [own.tolist() for own in driven_apart(alone.A, alone.Qc)] == [[0, 1, 2]]


def test_a_constant_goes_along_with_what_moves():
    chain = integrate(superpose(kalman.random_walk(0.0, 1.0), matern(1, 1.0, 3.0)), var=1.0)
    assert [own.tolist() for own in driven_apart(chain.A, chain.Qc)] == [[0, 1, 2]]


def test_two_structures_of_a_hundred_modes_are_two_parts():
    A = np.kron(np.eye(2), np.ones((200, 200)))
    parts = driven_apart(A, 0 * A)
    assert [own.tolist() for own in parts] == [list(range(200)), list(range(200, 400))]


def test_models_that_differ_by_their_power_alone_keep_it():
    rng = np.random.default_rng(8)
    step, std, rate = rng.uniform(0.01, 0.02, 60), rng.uniform(0.1, 9.0, (3, 4)), np.array([1.0, 3.0, 9.0])
    std[1, 2] = 0.0
    load = matern(3, std, np.repeat(rate[:, None], 4, 1))
    F, Q = discretize_steps(load, step)
    for at in np.ndindex(3, 4):
        f, q = discretize(matern(3, std[at], rate[at[0]]), step)
        np.testing.assert_allclose(F[(slice(None), *at)], f, rtol=1e-11, atol=1e-13 * np.abs(f).max())
        np.testing.assert_allclose(Q[(slice(None), *at)], q, rtol=1e-11, atol=1e-13 * np.abs(q).max())
