"""Loads that modes show beside the noise of their smoother, and what claims make of them."""

from dataclasses import dataclass

import numpy as np
import pytest

from evidence.drawn.plate_face import plate_flight
from evidence.drawn.records.scored import FORCE, estimated_score
from forceid.estimation.loads.hidden.loads_on_modes import (
    ShownLoads,
    as_fast_as_on_modes,
    loads_shown,
    noise_of_smoothed,
)
from forceid.flight.channels import Channel, Start
from forceid.flight.elastic import seen_modes
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.flight.vibration import ModeState, Vibration
from forceid.kalman.engines import engine

MODES = np.array([40.0, 57.0, 71.0])  # Hz
TIME = np.arange(400) / 250
SIZE = np.array([1.0, 2.0, 0.5])  # 1/sqrt(kg)
PRIOR = Vibration(2 * np.pi * MODES, np.full(3, 3.0), 1e-3 * SIZE, np.full(3, 15.0))
SHOWN = np.random.default_rng(8).standard_normal((4, 3)) / 1e-5  # 1/m: four numbers a frame, noise 1e-5 m


def smoothed(amplitude: np.ndarray, seed: int) -> np.ndarray:
    """Smoothed loads (time, mode) of amplitudes (time, mode) m seen with noise."""
    rows = np.tile(SHOWN, (len(TIME), 1, 1))
    y = amplitude @ SHOWN.T + np.random.default_rng(seed).standard_normal((len(TIME), 4))
    return engine().smooth(seen_modes(TIME, rows, PRIOR), y).x[:, ModeState.LOAD :: PRIOR.states]


def shown(amplitude: np.ndarray, seed: int) -> ShownLoads:
    """What such amplitudes show of loads."""
    return loads_shown(TIME, smoothed(amplitude, seed), SHOWN.T @ SHOWN, PRIOR, SIZE)


def test_the_noise_of_smoothed_loads_is_what_the_smoother_makes_of_noise_up_to_the_last_frequency() -> None:
    taper, still = np.hanning(len(TIME))[:, None], np.zeros((len(TIME), 3))
    waves = [np.fft.rfft(taper * smoothed(still, seed), axis=0)[1:] for seed in range(60)]
    power = np.mean(np.abs(waves) ** 2, axis=0) / (250 * (taper**2).sum())
    frequency = np.fft.rfftfreq(len(TIME), 1 / 250)[1:]
    expected = noise_of_smoothed(frequency, 1 / 250, SHOWN.T @ SHOWN, PRIOR)
    for band in np.split(np.arange(4, 196), 8):
        np.testing.assert_allclose(power[band].sum(0), expected[band].sum(0), rtol=0.15)


def test_noise_alone_shows_no_loads_nor_does_ringing_of_another_damping() -> None:
    for seed in range(20):
        start = np.random.default_rng(seed).uniform(-1e-3, 1e-3, 3)
        ringing = start * np.exp(-1.5 * TIME[:, None]) * np.cos(2 * np.pi * MODES * TIME[:, None])
        assert not shown(np.zeros((len(TIME), 3)), seed).density.any()
        above = shown(ringing, seed)
        # what a taper leaves of so large a line is no load either
        assert 2 * above.density.sum() * above.frequency[0] < 1e-3 * np.mean((PRIOR.load / SIZE) ** 2)


def test_a_load_on_modes_is_shown_at_its_frequency_and_size() -> None:
    w, load = 2 * np.pi * 20.0, 30.0  # N/sqrt(kg)
    q = load * SIZE * np.sin(w * TIME)[:, None] / (PRIOR.frequency**2 - w**2)
    found = shown(q, 3)
    near = np.abs(found.frequency - 20.0) < 2.0
    assert 2 * found.density[near].sum() * found.frequency[0] == pytest.approx(0.5 * load**2, rel=0.1)
    assert found.density[~near].sum() < 0.01 * found.density[near].sum()


@pytest.mark.long
def test_a_plate_whose_modes_are_told_is_claimed_as_well_as_it_is_known() -> None:
    each = [estimated_score(plate_flight(seed, 8, "modes"), model="modal", lines="none") for seed in range(4)]
    assert [one.verdict for one in each] == 4 * ["ok"]
    assert max(max(one.over) for one in each) < 1.3  # within the band
    assert np.median([one.plain for one in each]) > 0.5  # claims a hundred times too wide were honest as well
    assert max(one.error(FORCE) for one in each) < 0.02  # N; rigid 20 times that


@dataclass(frozen=True)
class Wrench:
    """What of the state of a flight the loads on its modes are held beside."""

    force: np.ndarray
    moment: np.ndarray
    wrench_cov: np.ndarray


def added_beside_modes(followed: float) -> float:
    """Variance that claims of a moment gain beside loads on modes at 3 and 30 Hz, each of one N/kg^1/2.

    followed: amplitude of the moment at 3 Hz, N m, of a body of inertia 1 kg m2; noise hides it at 30 Hz.
    """
    time = np.arange(1000) / 250
    slow = np.sin(2 * np.pi * 3.0 * time)
    noise = np.broadcast_to(1e-4 * np.eye(3), (len(time), 3, 3))
    channel = Channel(time, np.zeros((len(time), 3)), 1.0, noise, np.zeros((3, 3)))
    prior = LoadPrior(Tuned(Matern(6, np.ones(3), np.full(3, 40.0))), np.eye(3), Start(1.0, 1.0, 1.0))
    moment = np.tile(followed * slow[:, None], (1, 3))
    state = Wrench(moment, moment, np.broadcast_to(1e-4 * np.eye(6), (len(time), 6, 6)))
    frequency = np.fft.rfftfreq(len(time), 1 / 250)[1:]
    density = np.where(np.isin(np.round(frequency, 6), (3.0, 30.0)), 0.25 / frequency[0], 0.0)
    found, said = as_fast_as_on_modes(
        {"moment": channel},
        {"moment": prior},
        state,
        ShownLoads(frequency, density),
        {"moment": np.eye(3)},
        np.tile(np.eye(3), (len(time), 1, 1)),
    )
    assert [(finding.code, finding.values["load"]) for finding in said] == [("faster-on-modes", "moment")]
    assert (found.wrench_cov[:, :3, :3] == state.wrench_cov[:, :3, :3]).all()
    return float(found.wrench_cov[0, 3, 3])


def test_a_moment_that_noise_hides_may_be_as_strong_as_loads_on_modes_however_weak_where_it_shows() -> None:
    whole = added_beside_modes(1.0)
    assert whole == pytest.approx(1e-4 + 0.5, rel=0.05)  # half the square of an amplitude
    assert added_beside_modes(0.1) == pytest.approx(whole)
