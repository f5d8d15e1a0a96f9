"""The records of the stress study, against differences and closed forms that share no code with them."""

import numpy as np
import pytest

from evidence.stress.failure_table import FAILURES
from evidence.stress.subjects import FLIGHTS, subject_of
from evidence.subjects.flights.bodies import MASS, PLACE, Setup, fly, mass_gauge_shapes
from evidence.subjects.flights.drawn_loads import draw_matern
from evidence.subjects.flights.failures.body import rigid_looking_shape
from evidence.subjects.flights.failures.sensing import frames_lost
from evidence.subjects.flights.oracle import bound
from forceid.files.validate import check_recording

FINE = 1 / 4000  # s


def inner(values):
    return values[5:-5]


@pytest.fixture(scope="module", params=["rigid", "bending", "struck"])
def flight(request):
    setup = {
        "rigid": Setup(),
        "bending": Setup(modes=2, size=5e-3),
        "struck": Setup(impulse=0.1, pulse_width=0.02, line=0.5),
    }[request.param]
    return fly(setup, np.random.default_rng(3), time=0.5 + FINE * np.arange(1200))


def moments_of_momentum(x):
    v = np.gradient(x, FINE, axis=0)
    a = np.gradient(v, FINE, axis=0)
    arm = x - (np.einsum("n,tna->ta", MASS, x) / MASS.sum())[:, None]
    return np.einsum("n,tna->ta", MASS, a), np.einsum("n,tna->ta", MASS, np.cross(arm, a))


def test_force_is_the_rate_of_the_momentum_of_the_nodes_less_weight(flight):
    rate, _ = moments_of_momentum(flight.position)
    force = rate - MASS.sum() * flight.gravity
    np.testing.assert_allclose(inner(force), inner(flight.truth["force"]), atol=2e-3)


def test_moment_is_the_rate_of_the_angular_momentum_of_the_nodes(flight):
    _, rate = moments_of_momentum(flight.position)
    np.testing.assert_allclose(inner(rate), inner(flight.truth["moment"]), atol=3e-4)


def test_a_pulse_gives_its_impulse_and_no_more():
    quiet, struck = (fly(Setup(impulse=p, pulse_width=5e-3), rng_of(1)) for p in (0.0, 0.1))
    gained = MASS.sum() * (struck.truth["velocity"] - quiet.truth["velocity"])
    np.testing.assert_allclose(gained[-1], 0.1 * np.array([0.8, -0.5, 0.3]), rtol=1e-9)
    np.testing.assert_allclose(gained[0], 0, atol=1e-12)


def rng_of(seed):
    return np.random.default_rng(seed)


def test_a_drawn_load_has_the_autocorrelation_of_its_prior():
    rate, lag = 20.0, 0.05
    load = draw_matern(2.0, rate, 600.0, rng_of(4))
    time = np.arange(0, 600, 0.1)
    now, then = load.at(time), load.at(time + lag)
    x = rate * lag
    expected = (1 + x + x**2 / 3) * np.exp(-x)  # of Matern 5/2
    assert np.mean(now * then) / np.mean(now**2) == pytest.approx(expected, abs=0.03)
    assert now.std() == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("shapes", [mass_gauge_shapes(3), rigid_looking_shape(0.05)[None]])
def test_shapes_move_neither_mass_center_nor_angular_momentum(shapes):
    np.testing.assert_allclose(np.einsum("n,kna->ka", MASS, shapes), 0, atol=1e-12)
    np.testing.assert_allclose(np.einsum("n,kna->ka", MASS, np.cross(PLACE, shapes)), 0, atol=1e-12)
    np.testing.assert_allclose((shapes**2).sum((1, 2)) / len(PLACE), 1)


def test_the_mode_that_looks_rigid_leaves_a_turn_by_the_sine_asked_for():
    for sine in (0.5, 0.01):
        seen = rigid_looking_shape(sine)[:5]
        arms = np.cross(np.eye(3)[None], PLACE[:5, None]).swapaxes(1, 2)
        rigid = np.concatenate([np.tile(np.eye(3), (5, 1, 1)), arms], 2).reshape(-1, 6)
        left = seen.ravel() - rigid @ np.linalg.lstsq(rigid, seen.ravel(), rcond=None)[0]
        assert np.linalg.norm(left) / np.linalg.norm(seen) == pytest.approx(sine, rel=0.05)


def test_the_bound_grows_with_the_square_root_of_what_is_lost_at_most():
    shown = [frames_lost(level, rng_of(2)) for level in (0.0, 0.75)]
    whole, part = (bound(c.flight, c.seen, c.noise, c.place)[30:-30] for c in shown)
    ratio = np.sqrt(np.trace(part, axis1=1, axis2=2).mean() / np.trace(whole, axis1=1, axis2=2).mean())
    assert 1.1 < ratio < 2.0  # a quarter of the frames


def test_there_are_twenty_failures_of_eight_levels_with_names_of_their_own():
    assert len(FAILURES) >= 20
    assert len({f.name for f in FAILURES}) == len(FAILURES)
    assert all(len(set(f.levels)) == 8 for f in FAILURES)


RECORDED = [f for f in FAILURES if not f.deforms and subject_of(f) is FLIGHTS]


@pytest.mark.long
@pytest.mark.parametrize("failure", RECORDED, ids=lambda f: f.name)
def test_every_failure_begins_with_a_valid_record_and_the_same_seed_makes_it_again(failure):
    level = failure.levels[0]
    first, again = (failure.make(level, rng_of(1)) for _ in range(2))
    check_recording(first.recording)
    for name, value in vars(first.recording.motion).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, getattr(again.recording.motion, name))
