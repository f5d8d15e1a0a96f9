"""Quiet pieces beside a contact, in closed form: what noise hides there is claimed."""

from functools import partial

import numpy as np
import pytest

from forceid.estimation.loads.channels import tune_channel
from forceid.estimation.loads.pieces.cells import cells_beside, load_in
from forceid.estimation.loads.pieces.character import with_character
from forceid.estimation.loads.pieces.evidence import Evidence, as_large_as_may_be, hiding
from forceid.flight.channels import Channel
from forceid.kalman.engines import engine

STEP, NOISE, COUNT = 0.004, 2e-4, 300
TIME = STEP * np.arange(COUNT)
ENGINE = engine()


def between_contacts(seed, faint):
    """A channel of unit mass: a contact between two flights, in which a faint wave of force acts on it."""
    rng = np.random.default_rng(seed)
    w, phase = 2 * np.pi * rng.uniform(0.5, 2.0, 3), rng.uniform(0, 2 * np.pi, 3)
    load = faint * np.sin(w * TIME[:, None] + phase)
    path = -load / w**2
    direction = rng.normal(size=3)
    for edge, sign in ((rng.uniform(0.3, 0.4), 20.0), (rng.uniform(0.5, 0.6), -20.0)):
        late = np.maximum(TIME - edge, 0.0)[:, None]
        load = load + sign * direction * (late > 0)
        path = path + 0.5 * sign * direction * late**2
    z = path + NOISE * rng.normal(size=(COUNT, 3))
    return Channel(TIME, z, 1.0, np.tile(NOISE**2 * np.eye(3), (COUNT, 1, 1)), np.zeros((3, 3))), load


def found_in(channel):
    tune = partial(tune_channel, channel, (1.0, 1.0), (), engine=ENGINE)
    prior = with_character(channel, tune(), ENGINE, tune)
    pieces = prior.tuned.pieces
    return Evidence(channel, prior, ENGINE, pieces.edges), pieces


@pytest.mark.parametrize("seed", [3, pytest.param(7, marks=pytest.mark.long)])
def test_a_flight_that_shows_no_load_claims_the_load_that_noise_hides_there(seed):
    channel, load = between_contacts(seed, 0.03)
    evidence, pieces = found_in(channel)
    cells = cells_beside(channel, (), TIME)
    estimate, _ = load_in(cells, evidence.prior, pieces, ENGINE)
    after = (TIME > 0.7) & (TIME < 1.1)
    var, more = (np.diagonal(one, axis1=1, axis2=2) for one in hiding(evidence, cells, pieces))
    square = ((estimate - load)[after] ** 2).mean()
    assert square < 4 * (var + more)[after].mean()


@pytest.mark.long
def test_no_size_in_a_piece_is_claimed_that_the_record_excludes():
    evidence, pieces = found_in(between_contacts(5, 0.03)[0])
    larger = as_large_as_may_be(evidence, pieces)
    assert (larger.size >= pieces.size).all()
    each = [
        pieces.size + (larger.size - pieces.size) * (np.arange(len(pieces.size))[:, None] == k)
        for k in range(len(pieces.size))
    ]
    lost = evidence.likelihood([pieces]) - evidence.likelihood(
        [type(pieces)(pieces.edges, size, pieces.haste) for size in each]
    )
    assert (lost < 0.5).all()
