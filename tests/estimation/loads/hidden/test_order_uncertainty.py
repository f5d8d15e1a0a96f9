"""Claims that allow for the priors that a record does not tell apart, on loads drawn from known ones."""

import numpy as np

from forceid.estimation.loads.channels import tune_channel
from forceid.estimation.loads.hidden.left_out import densities
from forceid.estimation.loads.hidden.order_uncertainty import Rivals, growth_of, shares_lost
from forceid.estimation.loads.hidden.patterns import patterns_held, under_smaller
from forceid.estimation.loads.hidden.whitened import whitened
from forceid.flight.channels import CHANNEL_SAMPLES, Channel
from forceid.flight.priors.protocol import channel_model
from forceid.kalman.building.process import discretize, integrate, matern
from forceid.kalman.engines import engine

STEP, SIGMA, MASS = 2e-3, 3e-4, 0.5
INNER = slice(75, -75)


def drawn(order, seed, samples=600, step=STEP, rate=30.0, mass=MASS, sigma=SIGMA):
    """A channel that a Matern load of that order drives, and the load (time, 3)."""
    rng = np.random.default_rng(seed)
    process = integrate(integrate(matern(order, 1.0, rate), 0.0), 0.0)
    F, Q = discretize(process, step)
    F, root = np.squeeze(F), np.linalg.cholesky(np.squeeze(Q) + 1e-18 * np.eye(order + 2))
    start = np.zeros((order + 2, 3))
    start[2:] = np.linalg.cholesky(np.squeeze(process.P0)[2:, 2:]) @ rng.standard_normal((order, 3))
    states = [start]
    for _ in range(samples - 1):
        states.append(F @ states[-1] + root @ rng.standard_normal((order + 2, 3)))
    states = np.array(states)
    z = states[:, 0] / mass + sigma * rng.standard_normal((samples, 3))
    cov = np.broadcast_to(sigma**2 * np.eye(3), (samples, 3, 3))
    return Channel(step * np.arange(samples), z, 1 / mass, cov, np.zeros((3, 3))), states[:, 2]


def with_load(times, seed=0, samples=600, frequency=1.5):
    """A channel of noise beside a slow wave of so many standard deviations of the noise."""
    rng, t = np.random.default_rng(seed), STEP * np.arange(samples)
    wave = np.sin(2 * np.pi * frequency * t)
    z = SIGMA * (rng.standard_normal((samples, 3)) + times * wave[:, None] * [1, 0, 0])
    cov = np.broadcast_to(SIGMA**2 * np.eye(3), (samples, 3, 3))
    return Channel(t, z, 1 / MASS, cov, np.zeros((3, 3)))


def smoothed(channel, prior):
    """The load (time, 3), what its prior claims of it, and what is claimed for all that are likely."""
    model = channel_model(channel, prior)
    path = engine().smooth(model, channel.moved)
    rows = prior.rows
    along = prior.axes.T @ rows
    var = np.einsum("as,tsr,ar->ta", along, path.P, along)
    grown = var * growth_of(whitened(channel, prior, engine()), var[INNER].mean(0)) ** 2
    return path.x @ rows.T, *(np.sqrt(v @ (prior.axes**2).T) for v in (var, grown))


def test_loads_of_any_order_lie_within_claims_that_allow_for_other_ones():
    alone, allowed, score = {}, {}, []
    for order in (2, 3, 4):
        inside, grown_inside = [], []
        for seed in range(4):
            channel, load = drawn(order, seed)
            found, std, grown = smoothed(channel, tune_channel(channel, (1.0, 1.0), ()))
            for share, claim in ((inside, std), (grown_inside, grown)):
                share.append((np.abs(found - load) <= 1.959964 * claim)[INNER].mean())
            score.append(np.mean(((found - load) / grown)[INNER] ** 2))
        alone[order], allowed[order] = np.mean(inside), np.mean(grown_inside)
    assert alone[2] < 0.88  # the smoothest likely order is smoother than this load
    assert 0.92 <= np.mean(list(allowed.values())) <= 0.98
    assert min(allowed.values()) > 0.89
    assert 0.8 < np.sqrt(np.mean(score)) < 1.2


def test_an_order_that_short_records_share_makes_their_claims_grow_less_and_hold():
    for order in (3, 4):
        looks, records = [], [drawn(order, seed, samples=200) for seed in range(20, 28)]
        for channel, load in records:
            prior = tune_channel(channel, (1.0, 1.0), (), (order,))
            looks.append((whitened(channel, prior, engine()), load))
        orders = sum(Rivals({"force": look}, None).orders for look, _ in looks)
        assert orders[0] < orders.max() - 10  # ORDERS[0] is the roughest
        score, growth = [], []
        for look, load in looks:
            path = engine().smooth(channel_model(look.channel, look.prior), look.channel.moved)
            along = look.prior.axes.T @ look.prior.rows
            claimed = np.einsum("as,tsr,ar->ta", along, path.P, along)[INNER].mean(0)
            growth.append([growth_of(look, claimed), growth_of(look, claimed, orders)])
            off = (path.x @ along.T - load @ look.prior.axes)[INNER]
            score.append(np.mean(off**2 / claimed / growth[-1][1] ** 2))
        alone, shared = np.mean(growth, axis=(0, 2))
        assert 1.0 <= shared < alone
        assert 0.8 < np.sqrt(np.mean(score)) < 1.2


def test_of_a_constant_load_the_claim_allows_for_what_would_not_show_and_grows_as_evidence_comes_near():
    grown = []
    for times in (0.0, 0.1, 0.2):
        channel = with_load(times, seed=3)
        prior = tune_channel(channel, (1.0, 1.0), ())
        assert not prior.kernel.std.max() > 1e-3
        _, std, claim = smoothed(channel, prior)
        grown.append(float((claim / std)[INNER].max()))
    assert 1.1 < grown[0] < 3.0
    assert grown[1] > grown[0]
    assert grown[2] > 3.0


def test_likelihoods_in_the_frequency_domain_differ_as_exact_ones_do():
    channel, _ = drawn(3, 5)
    own = tune_channel(channel, (1.0, 1.0), (), (3,))
    look = whitened(channel, own, engine())
    frequency, _, count = look.groups
    noise, smooth, _ = densities(channel, own, frequency)

    def told(prior):
        other = densities(channel, prior, frequency)[1]
        ratio = (other + noise) / (smooth + noise)
        return float(-(count @ np.log(ratio) + (look.powers(look.innovation) / ratio).sum(0)).sum())

    exact = {o: tune_channel(channel, (1.0, 1.0), (), (o,)) for o in (2, 4)}
    for prior in exact.values():
        a, b = (
            float(engine().log_likelihood(channel_model(channel, p), channel.moved)) for p in (prior, own)
        )
        turned = np.abs(prior.axes.T @ own.axes).max(0).min()
        assert turned > 0.999  # the axes are those of the channel, whatever the order
        assert abs((told(prior) - told(own)) - (a - b)) < 2.5


def test_evidence_gains_by_what_explains_the_channel():
    t = STEP * np.arange(600)
    wave = np.sin(2 * np.pi * 1.5 * t)[:, None, None] * np.array([1.0, 0.0, 0.0])[:, None]
    channel = with_load(3.0)
    prior = tune_channel(channel, (1.0, 1.0), ())
    right, wrong = (whitened(channel, prior, engine(), w) for w in (wave, np.roll(wave, 1, axis=1)))
    (held,), (other,) = (
        patterns_held(look, under_smaller(look, 0.0), [(slice(None), 1.0)]) for look in (right, wrong)
    )
    assert held.gained > 5
    assert other.gained < 0  # for nothing, what is not told beforehand costs


def test_long_records_are_looked_at_in_their_middle():
    channel, _ = drawn(2, 1, CHANNEL_SAMPLES + 400)
    prior = tune_channel(channel, (1.0, 1.0), ())
    growth = growth_of(whitened(channel, prior, engine()), np.ones(3))
    assert np.isfinite(growth).all()
    assert (growth >= 1.0).all()


def test_a_search_that_misses_the_peak_of_one_order_hides_no_rougher_one():
    for seed in (0, 2, 4, 13):
        channel, _ = drawn(2, seed, samples=480, step=1 / 120, rate=20.0, mass=0.1, sigma=1.5e-4)
        assert tune_channel(channel, (1.0, 1.0), ()).kernel.order <= 3


def test_what_a_smoother_misses_follows_from_its_claim_whatever_else_it_reads():
    """Readings between frames make the noise so many times as large: the claim alone tells how many."""
    frequency, times = np.geomspace(0.1, 80.0, 96), np.array([1.0, 0.1, 3.0])
    seen, width = frequency < 20.0, 2 * np.gradient(frequency)
    load = 1 / (1 + (frequency[:, None] / np.array([1.0, 3.0, 9.0])) ** 6)
    noise = np.tile(1e-4 * frequency[:, None] ** 4, 3)
    share = np.where(seen[:, None], times * noise / (times * noise + load), 1.0)
    found = shares_lost(frequency, 20.0, noise, load, width @ (share * load))
    np.testing.assert_allclose(found, share, rtol=1e-9)
