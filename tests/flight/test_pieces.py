import numpy as np
import pytest

from forceid.flight.channels import Channel, driven, load_chain, model_in_pieces, start_of
from forceid.flight.pieces import WHOLE, Pieces, split_in_a_row
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned, channel_model
from forceid.kalman import log_likelihood
from forceid.kalman.building.process import matern

STEP, GAIN = 0.01, 2.0
TIME = STEP * np.arange(60)
EDGES = np.array([0.1373, 0.30, 0.3021])  # within a step, at a sample, and a second one within a step
SIZE = np.array([[0.1, 1.0, 0.3], [1.0, 0.2, 1.0], [0.5, 0.5, 0.0], [0.2, 1.0, 0.7]])

HASTE = np.array([1.0, 5.0, 2.0, 1.0])


def channel_of(seed):
    rng = np.random.default_rng(seed)
    z = np.cumsum(np.cumsum(rng.normal(size=(len(TIME), 3)), 0), 0) * 1e-4
    return Channel(TIME, z, GAIN, np.tile(1e-8 * np.eye(3), (len(TIME), 1, 1)), 1e-9 * np.eye(3))


def prior_of(channel, order, pieces):
    kernel = Matern(order, np.array([3.0, 1.0, 2.0]), np.array([20.0, 5.0, 60.0]))
    return LoadPrior(Tuned(kernel, pieces=pieces), np.eye(3), start_of(TIME, channel.moved, GAIN))


def by_axes(channel, prior, pieces):
    kernel = prior.kernel

    def chain(haste):
        return load_chain(matern(kernel.order, kernel.std, haste * kernel.rate), prior.start)

    var, drift = channel.var(np.eye(3)), np.diagonal(channel.drift)
    model = model_in_pieces(chain, GAIN, var, drift, TIME, kernel.order, None)([pieces])
    return float(log_likelihood(model, channel.moved[:, :, None]).sum())


@pytest.mark.parametrize("order", [1, 2, 4])
def test_three_axes_together_and_each_by_itself_are_as_likely(order):
    channel, pieces = channel_of(1), Pieces(EDGES, SIZE, HASTE)
    prior = prior_of(channel, order, pieces)
    together = float(log_likelihood(channel_model(channel, prior), channel.moved))
    assert by_axes(channel, prior, pieces) == pytest.approx(together, rel=1e-9)


def test_one_piece_of_size_one_is_a_load_without_pieces():
    channel, whole = channel_of(2), WHOLE
    prior = prior_of(channel, 3, None)
    plain = float(log_likelihood(channel_model(channel, prior), channel.moved))
    assert by_axes(channel, prior, whole) == pytest.approx(plain, rel=1e-12)


def test_a_piece_is_scaled_as_a_load_of_that_size():
    """In one piece throughout, half the size is half the deviation."""
    channel, half = channel_of(3), Pieces(np.zeros(0), np.full((1, 3), 0.5), np.ones(1))
    prior = prior_of(channel, 2, None)
    chain = load_chain(matern(2, 0.5 * prior.kernel.std, prior.kernel.rate), prior.start)
    model = driven(chain, GAIN, channel.var(np.eye(3)), np.diagonal(channel.drift), np.diff(TIME))
    told = float(log_likelihood(model, channel.moved[:, :, None]).sum())
    assert by_axes(channel, prior, half) == pytest.approx(told, rel=1e-12)


@pytest.mark.parametrize("edges", [EDGES, EDGES[:2], np.array([0.2])])
def test_momentum_of_independent_pieces_has_the_sum_of_their_variances(edges):
    """Closed form of an exponential memory: 2 s^2 (k t - 1 + exp(-k t)) / k^2 over a piece of length t.

    The mean is drawn anew with each piece, and adds its variance times t^2.
    """
    std, rate = 3.0, 20.0
    pieces = Pieces(edges, SIZE[: len(edges) + 1], HASTE[: len(edges) + 1])
    channel = channel_of(4)
    prior = prior_of(channel, 1, pieces)
    F, Q, P = prior.chain(np.diff(TIME), None, 0.0)
    P[:6] = P[:, :6] = 0.0  # position and momentum known at the start
    for step_F, step_Q in zip(F, Q, strict=True):
        P = step_F @ P @ step_F.T + step_Q
    length = np.diff([0.0, *edges, TIME[-1]])
    rate = rate * pieces.haste
    each = 2 * (pieces.size[:, 0] * std) ** 2 * (rate * length - 1 + np.exp(-rate * length)) / rate**2
    each += prior.start.mean * length**2
    assert P[3, 3] == pytest.approx(each.sum(), rel=1e-9)


def test_cut_steps_join_to_those_of_the_clock():
    step = np.diff(TIME)
    split = split_in_a_row([WHOLE, Pieces(EDGES, SIZE, HASTE)], step, 0.0)
    tries, steps = np.divmod(split.cut, len(step))
    assert set(tries) == {1}
    np.testing.assert_allclose(np.bincount(split.of, split.length), step[steps], rtol=1e-9)
    for k, at in enumerate(steps):
        length = split.length[split.of == k]
        middle = TIME[at] + np.cumsum(length) - 0.5 * length
        np.testing.assert_array_equal(split.inside[split.of == k] - 1, np.searchsorted(EDGES, middle))
    uncut = np.setdiff1d(np.arange(len(step)), steps)
    middle = 0.5 * (TIME[1:] + TIME[:-1])
    np.testing.assert_array_equal(split.piece[1, uncut] - 1, np.searchsorted(EDGES, middle[uncut]))


def test_a_load_is_drawn_anew_once_at_each_edge():
    edges = np.array([TIME[0] + 1e-12, *EDGES, TIME[40] - 1e-11, TIME[41], TIME[-1] - 1e-12])
    pieces = Pieces(edges, np.ones((len(edges) + 1, 3)), np.ones(len(edges) + 1))
    split = split_in_a_row([pieces], np.diff(TIME), float(TIME[0]))
    # those at the ends begin nothing
    assert split.inside[split.anew].tolist() == [2, 3, 4, 5, 6]


def test_edges_outside_of_a_stretch_leave_it_in_the_piece_it_is_in():
    behind = split_in_a_row([Pieces(EDGES, SIZE, HASTE)], np.diff(TIME[:5]), 1.0)
    assert behind.piece.tolist() == [[3, 3, 3, 3]]
    assert not len(behind.cut)
