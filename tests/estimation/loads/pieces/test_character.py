"""Channels of loads in closed form: waves and boxes, integrated twice by hand, with white noise."""

from dataclasses import replace
from functools import partial
from itertools import cycle

import numpy as np
import pytest

from evidence.calibration.record import drawn_record
from evidence.drawn.edges import drawn_flight
from evidence.strangers.attempt import attempt
from forceid.config import load_settings
from forceid.estimation.loads.channels import tune_channel
from forceid.estimation.loads.pieces import character
from forceid.estimation.loads.pieces.character import with_character
from forceid.estimation.loads.pieces.edges import Spread, share_of_cells, spread_of
from forceid.estimation.loads.pieces.impulses import change_cov
from forceid.estimation.run import estimate_recording
from forceid.flight.channels import Channel
from forceid.flight.priors.protocol import channel_model
from forceid.kalman.engines import engine

STEP, NOISE, COUNT = 0.004, 2e-4, 400
TIME = STEP * np.arange(COUNT)
ENGINE = engine()


def drawn(seed, edges=(), size=0.0):
    """A channel of unit mass under slow waves and boxes of force along one axis, its load, and their axis."""
    rng = np.random.default_rng(seed)
    t = TIME[:, None, None]
    w, phase = 2 * np.pi * rng.uniform(0.3, 2.0, (3, 3)), rng.uniform(0, 2 * np.pi, (3, 3))
    amplitude = rng.normal(size=(3, 3))
    load = (amplitude * np.sin(w * t + phase)).sum(1)
    path = (-amplitude / w**2 * np.sin(w * t + phase)).sum(1)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    for edge, sign in zip(edges, cycle((1, -1)), strict=False):
        late = np.maximum(TIME - edge, 0.0)[:, None]
        load = load + sign * size * direction * (late > 0)
        path = path + 0.5 * sign * size * direction * late**2
    z = path + rng.normal(size=(COUNT, 3)) * NOISE
    cov = np.tile(NOISE**2 * np.eye(3), (COUNT, 1, 1))
    return Channel(TIME, z, 1.0, cov, np.zeros((3, 3))), load, direction


def searched(channel):
    tune = partial(tune_channel, channel, (1.0, 1.0), (), engine=ENGINE)
    return with_character(channel, tune(), ENGINE, tune)


def load_under(channel, prior):
    path = ENGINE.smooth(channel_model(channel, prior), channel.moved)
    rows = prior.rows
    return path.x @ rows.T, rows @ path.P @ rows.T


def test_a_step_is_found_within_a_sample_and_the_load_beside_it_is_as_well_known_as_without():
    edge = 0.7713
    channel, load, _ = drawn(3, (edge,), 10.0)
    prior = searched(channel)
    assert prior.tuned.pieces.edges == pytest.approx([edge], abs=STEP)
    found, cov = load_under(channel, prior)
    away = np.abs(TIME - edge) > 2 * STEP
    away[:20] = away[-20:] = False
    off = np.sqrt(((found - load)[away] ** 2).mean() / np.trace(cov[away].mean(0)) * 3)
    assert 0.3 < off < 1.6
    blurred, _ = load_under(channel, tune_channel(channel, (1.0, 1.0), (), engine=ENGINE))
    assert ((found - load)[away] ** 2).mean() < 0.25 * ((blurred - load)[away] ** 2).mean()


def test_both_ends_of_a_contact_are_found_within_a_sample():
    edges = (0.5221, 0.5837)
    prior = searched(drawn(4, edges, 40.0)[0])
    assert prior.tuned.pieces.edges == pytest.approx(edges, abs=STEP)


@pytest.mark.long
def test_both_ends_of_each_of_several_contacts_are_found():
    edges = (0.2413, 0.2729, 0.6112, 0.6391, 1.1209, 1.1518)
    prior = searched(drawn(4, edges, 100.0)[0])
    assert prior.tuned.pieces.edges == pytest.approx(edges, abs=STEP)


def test_an_impact_between_two_samples_is_known_by_its_impulse():
    edges = (0.5221, 0.5236)
    channel, _, direction = drawn(5, edges, 600.0)
    prior = searched(channel)
    first, last = prior.tuned.pieces.edges[[0, -1]]
    a, b = np.searchsorted(TIME, first, "right") - 1, np.searchsorted(TIME, last)
    assert TIME[b] - TIME[a] < 6 * STEP
    model = channel_model(channel, prior)
    x = ENGINE.smooth(model, channel.moved).x
    impulse = prior.axes @ (x[b] - x[a])[3:6]
    std = np.sqrt(np.trace(change_cov(model, channel.moved, a, b, ENGINE)))
    gone = impulse - 600.0 * (edges[1] - edges[0]) * direction
    assert np.linalg.norm(gone) < 3 * std + 3.0 * (TIME[b] - TIME[a])  # and what the slow waves give
    assert std < 0.05 * np.linalg.norm(impulse)
    assert (prior.kernel.std < 10).all()  # N, of the slow waves: the prior is that of the longest piece


@pytest.mark.parametrize("size", [100.0, 10000.0])
def test_an_impact_of_any_size_is_where_another_load_has_it(size):
    """Its own channel tells its impulse, and hardly its length: a wide weak piece gives as much."""
    given = np.array([0.5211, 0.5243])
    channel = drawn(12, (0.5221, 0.5236), size)[0]
    tune = partial(tune_channel, channel, (1.0, 1.0), (), engine=ENGINE)
    told = with_character(channel, tune(), ENGINE, tune, given)
    assert told.tuned.pieces.edges == pytest.approx(given, abs=1e-9)


@pytest.mark.long
def test_near_an_impact_the_load_is_its_mean_over_the_cell_of_a_sample_and_as_far_off_as_claimed():
    """Wherever in a step it falls, and be it found as a piece of a few steps, as long as it is found."""
    rng, off = np.random.default_rng(29), []
    for seed in range(430, 438):
        begin, length, impulse = rng.uniform(0.4, 1.0), STEP * rng.uniform(0.05, 1.0), rng.choice([0.3, 1.2])
        edges, size = (begin, begin + length), impulse / length
        channel, load, direction = drawn(seed, edges, size)
        share = np.subtract(*(np.clip(TIME + side * STEP / 2, *edges) for side in (1, -1))) / STEP
        load = load + size * direction * (share - ((edges[0] < TIME) & (edges[1] > TIME)))[:, None]
        prior = searched(channel)
        found, cov = load_under(channel, prior)
        spread, near = spread_of(channel, prior, TIME, ENGINE), np.abs(TIME - begin) < 5 * STEP
        error = (found + spread.mean[:, 3:] - load)[near]
        off.append((error**2).sum() / np.trace(spread.beside(cov)[near].sum(0)))
    assert 0.6 < np.sqrt(np.mean(off)) < 1.4


def test_slow_loads_have_no_edges():
    assert all(searched(drawn(seed)[0]).tuned.pieces is None for seed in range(20))


@pytest.mark.long
def test_a_contact_too_weak_to_be_found_whole_by_itself_is_where_another_load_has_its_edges():
    edges = np.array([0.5221, 0.5837])
    channel = drawn(6, edges, 2.0)[0]
    tune = partial(tune_channel, channel, (1.0, 1.0), (), engine=ENGINE)
    told = with_character(channel, tune(), ENGINE, tune, edges)
    assert told.tuned.pieces.edges == pytest.approx(edges, abs=STEP)
    alone = with_character(channel, tune(), ENGINE, tune)
    assert alone.tuned.pieces is None or len(alone.tuned.pieces.edges) < len(edges)


@pytest.mark.long
def test_near_an_edge_its_place_is_part_of_the_claim():
    edges = (0.5221, 0.5337)
    channel, load, _ = drawn(7, edges, 200.0)
    prior = searched(channel)
    found, cov = load_under(channel, prior)
    spread = spread_of(channel, prior, TIME, ENGINE)
    inside = (edges[0] < TIME) & (edges[1] > TIME)
    error = np.linalg.norm((found + spread.mean[:, 3:] - load)[inside], axis=1)
    claim = np.sqrt(np.trace(spread.beside(cov)[inside], axis1=1, axis2=2))
    assert (error < 3 * claim).all()
    far = np.abs(TIME - np.mean(edges)) > 0.3
    load_apart = spread.apart[:, far, 3:]
    assert (load_apart**2).sum((0, 2)).max() < 0.1 * np.trace(cov[far], axis1=1, axis2=2).max()


def test_the_change_of_momentum_has_the_covariance_of_all_samples_together():
    """Against the dense joint covariance of all states given all samples, of a short channel."""
    channel, _, _ = drawn(8)
    short = replace(channel, time=TIME[:12], z=channel.z[:12], noise_cov=channel.noise_cov[:12])
    prior = tune_channel(channel, (1.0, 1.0), (), (2,), engine=ENGINE)
    model = channel_model(short, prior)
    n, T = len(model.x0), 12
    joint = np.zeros((T * n, T * n))
    P = model.P0
    for k in range(T):
        joint[k * n : (k + 1) * n, k * n : (k + 1) * n] = P
        across = P
        for later in range(k + 1, T):
            across = across @ model.F[later - 1].T
            joint[k * n : (k + 1) * n, later * n : (later + 1) * n] = across
            joint[later * n : (later + 1) * n, k * n : (k + 1) * n] = across.T
        if k < T - 1:
            P = model.F[k] @ P @ model.F[k].T + model.Q[k]
    H = np.kron(np.eye(T), model.H)
    # the start is as good as unknown: in units of its own deviations
    scale = np.sqrt(np.diagonal(joint))
    scale = np.where(scale > 0, scale, 1.0)
    root = np.linalg.cholesky(joint / np.outer(scale, scale) + 1e-13 * np.eye(T * n))
    A = H @ (scale[:, None] * root) / NOISE
    change = np.zeros((3, T * n))
    change[:, 9 * n + 3 : 9 * n + 6], change[:, 4 * n + 3 : 4 * n + 6] = np.eye(3), -np.eye(3)
    w = change @ (scale[:, None] * root)
    left = w @ np.linalg.solve(np.eye(T * n) + A.T @ A, w.T)
    found = change_cov(model, short.moved, 4, 9, ENGINE)
    np.testing.assert_allclose(np.diagonal(found), np.diagonal(left), rtol=0.02)


@pytest.mark.long
def test_the_impulse_of_a_contact_is_as_far_off_as_claimed():
    """With what the places of its edges leave open, which is most of it for a short one."""
    rng, off = np.random.default_rng(17), []
    for seed in range(100, 116):
        begin, length, size = rng.uniform(0.5, 0.9), rng.uniform(0.012, 0.2), 10 ** rng.uniform(1.0, 2.0)
        channel, load, direction = drawn(seed, (begin, begin + length), size)
        prior = searched(channel)
        spread, model = spread_of(channel, prior, TIME, ENGINE), channel_model(channel, prior)
        first, last = prior.tuned.pieces.edges[[0, -1]]
        a, b = np.searchsorted(TIME, first, "right") - 1, np.searchsorted(TIME, last)
        x = ENGINE.smooth(model, channel.moved).x
        found = prior.axes @ (x[b] - x[a])[3:6] + (spread.mean[b] - spread.mean[a])[:3]
        cov = prior.axes @ change_cov(model, channel.moved, a, b, ENGINE) @ prior.axes.T
        slow = load - size * direction * ((begin < TIME) & (begin + length > TIME))[:, None]
        gone = found - size * length * direction - np.trapezoid(slow[a : b + 1], TIME[a : b + 1], axis=0)
        off.append(gone @ np.linalg.solve(cov + spread.of_change(a, b), gone) / 3)
    assert 0.6 < np.sqrt(np.mean(off)) < 1.4


def test_what_a_load_has_beside_its_channel_counts_by_the_share_of_its_piece():
    """A blow in a tenth of a cell, of which a channel sees 10 N and a flight 10.5 N, is 1.05 N of mean."""
    at, mean, alike = np.array([[0.2], [10.0], [0.2]]), np.array([[0.0], [-9.0], [0.0]]), np.zeros((3, 1))
    share = share_of_cells(np.arange(3.0), np.array([0.95, 1.05]))
    spread = Spread(np.hstack([alike] * 3 + [mean] * 3), alike, alike, alike > 0, alike, at, share)
    found = spread.of_cells(at + np.array([[0.1], [0.5], [0.1]]))
    np.testing.assert_allclose(found[:, 0], [0.3, 1.05, 0.3], rtol=1e-12)


@pytest.mark.long
def test_samples_of_a_blow_give_together_what_turns_the_body():
    """A blow of 1.4 ms that turns it so far within a step that no linear channel has it to a percent."""
    case = drawn_record(77030, 555, (100, 1500))
    found = attempt(case.recording, **case.settings).found
    hit = slice(80, 92)
    step, true = float(np.median(np.diff(found.time))), case.recording.truth["moment"][hit]
    gained = (found.moment[hit] - true).sum(0) * step
    assert np.linalg.norm(gained) < 0.012 * np.linalg.norm(true.sum(0) * step)


@pytest.mark.skipif(character.compiled is None, reason="no compiler was here")
@pytest.mark.parametrize("steady", [True, False])
def test_what_shocks_change_compiled_is_what_is_written_in_numpy(steady):
    rng, T, n, m = np.random.default_rng(8), 40, 15, 3
    F = 0.3 * rng.standard_normal((1 if steady else T - 1, n, n))
    H, run = rng.standard_normal((1 if steady else T, m, n)), np.minimum(np.arange(T), 5)
    K, W = 0.1 * rng.standard_normal((6, n, m)), rng.standard_normal((6, m, m))
    seen = rng.uniform(size=T) > 0.2
    v = np.where(seen[:, None], rng.standard_normal((T, m)), 0.0)
    given = F, H, run, K, W, v, seen, 6, 12
    for ours, plain in zip(character.compiled.shocks(*given), character.shocks_in_numpy(*given), strict=True):
        np.testing.assert_allclose(ours, plain, rtol=1e-9, atol=1e-9 * np.abs(plain).max())


@pytest.mark.long
def test_a_blow_that_one_prior_would_follow_is_a_piece_and_the_load_around_it_is_known():
    case = drawn_flight(52763, 27, "impact")
    recording, force, _ = case["with"]
    found = estimate_recording(recording, load_settings())
    assert np.abs(found.impulses.start[1:] - case["begin"]).min() * case["rate"] < 2
    away = np.abs(case["time"] - case["begin"]) > 0.05
    alone = estimate_recording(case["without"][0], load_settings())
    off, own = (np.sqrt(((e.force - force)[away] ** 2).mean()) for e in (found, alone))
    assert off < 2 * own
    assert off < 1.5 * np.sqrt((found.force_std[away] ** 2).mean())


@pytest.mark.long
def test_a_moment_is_cut_where_the_force_is_though_one_prior_would_follow_it():
    case = drawn_flight(52763, 25, "contact")
    recording, _, moment = case["with"]
    found = estimate_recording(recording, load_settings())
    near = (case["time"] > case["begin"] - 0.05) & (case["time"] < case["end"] + 0.05)
    off = np.sqrt(((found.moment - moment)[near] ** 2).mean() / (found.moment_std[near] ** 2).mean())
    assert off < 2
