"""What an estimate leaves out, against what the search finds in records with a known line."""

from pathlib import Path

import numpy as np
import pytest

from forceid.config import load_settings
from forceid.estimation.loads.channels import tune_channel
from forceid.estimation.loads.hidden.left_out import (
    beside_parabola,
    densities,
    hidden_load,
)
from forceid.estimation.long.joined import widest
from forceid.estimation.run import estimate_recording
from forceid.files.result import read_result, write_result
from forceid.flight.channels import Channel
from forceid.flight.priors.protocol import channel_model
from forceid.kalman.building.line_candidates import line_candidates
from forceid.kalman.building.line_search import find_line
from forceid.kalman.engines import engine
from forceid.records import HiddenLoad
from forceid.scenes.recipe import SceneRecipe, simulate

MASS, RATE, NOISE, SAMPLES = 0.13, 200.0, 1e-3, 160  # kg, Hz, m
TIME = np.arange(SAMPLES) / RATE


def channel_with(amplitude: float, frequency: float, seed: int, slow: float = 1.0) -> Channel:
    """A mass under a slow force and a line along x, written down as its exact path, with noise."""
    pushed = -slow * np.stack([np.sin(3 * TIME) / 9, np.cos(2 * TIME) / 4, 0.5 * np.sin(2 * TIME + 1) / 4], 1)
    w = 2 * np.pi * frequency
    line = -amplitude * np.cos(w * TIME + seed)[:, None] / w**2 * [1.0, 0.0, 0.0]
    z = (pushed + line) / MASS + NOISE * np.random.default_rng(seed).standard_normal((SAMPLES, 3))
    return Channel(TIME, z, 1 / MASS, np.tile(NOISE**2 * np.eye(3), (SAMPLES, 1, 1)), np.zeros((3, 3)))


QUIET = channel_with(0.0, 20.0, 1)
PRIOR = tune_channel(QUIET, (1.0, 1.0), ())
CURVE = hidden_load({"force": QUIET}, {"force": PRIOR})


def found(channel: Channel, frequency: float) -> bool:
    """Whether the search that a flight runs finds the line, of which nobody named the frequency."""
    model = channel_model(channel, PRIOR)
    filtered = engine().filter(model, channel.moved)
    tried = line_candidates(TIME, filtered.innovation, 0.0, [])[:2]
    lines = [line for c in tried for line in find_line(model, filtered, TIME, PRIOR.axes, c)]
    return any(abs(line.frequency - frequency) * TIME[-1] < 1 for line in lines)


def number_found(times: float, lines: int) -> int:
    """How many lines of so many times the hidden load are found, at frequencies up to 0.48 of the rate."""
    frequency = RATE * np.random.default_rng(7).uniform(0.05, 0.48, lines)
    least = np.exp(np.interp(np.log(frequency), np.log(CURVE.frequency), np.log(CURVE.amplitude[:, 0])))
    each = zip(times * least, frequency, strict=True)
    return sum(found(channel_with(a, f, k), f) for k, (a, f) in enumerate(each))


def test_about_half_of_the_lines_as_large_as_the_hidden_load_are_found() -> None:
    assert 4 <= number_found(1.0, 14) <= 10  # of a fair coin, 94 % of all trials lie within


def test_lines_of_twice_the_hidden_load_are_found_and_those_of_half_of_it_are_not() -> None:
    assert number_found(2.0, 6) == 6
    assert number_found(0.5, 6) == 0


def test_beyond_the_band_the_hidden_load_grows_with_the_square_of_the_frequency() -> None:
    clear = CURVE.frequency > 10 * CURVE.band[0]
    slope = np.diff(np.log(CURVE.amplitude[clear, 0])) / np.diff(np.log(CURVE.frequency[clear]))
    np.testing.assert_allclose(slope, 2.0, atol=0.05)


def test_a_load_is_followed_up_to_where_it_equals_the_noise_and_a_constant_one_nowhere() -> None:
    noise, smooth, axes = densities(QUIET, PRIOR, CURVE.band[:1])
    share = (smooth / (noise + smooth) @ axes.T**2)[0, 0]
    assert 0.48 < share < 0.52
    still = channel_with(0.0, 20.0, 1, slow=0.0)
    assert (
        hidden_load({"force": still}, {"force": tune_channel(still, (1.0, 1.0), ())}).band[:3].tolist()
        == [0] * 3
    )
    assert np.isnan(CURVE.band[3:]).all()
    assert np.isnan(CURVE.amplitude[:, 3:]).all()


def test_of_few_cycles_what_a_parabola_explains_shows_no_load() -> None:
    t = np.linspace(-1.0, 1.0, 2000)
    known = np.linalg.qr(np.vander(t, 3))[0]
    for cycles in (1.0, 2.5, 9.0, 60.0):
        left = [
            np.sum((x - known @ (known.T @ x)) ** 2) / np.sum(x**2)
            for x in (
                np.sin(np.pi * cycles * t + phase) for phase in np.linspace(0.0, np.pi, 16, endpoint=False)
            )
        ]
        np.testing.assert_allclose(beside_parabola(np.array([cycles]))[0], np.mean(left), atol=0.01)


def test_of_several_stretches_the_narrowest_band_and_the_largest_load_are_told() -> None:
    wider = HiddenLoad(CURVE.frequency, 3 * CURVE.amplitude, 0.5 * CURVE.band)
    both = widest([CURVE, None, wider])
    np.testing.assert_allclose(both.amplitude, 3 * CURVE.amplitude)
    np.testing.assert_allclose(both.band, 0.5 * CURVE.band)
    assert widest([None]) is None


@pytest.mark.long
def test_a_load_at_twice_the_spin_that_a_record_cannot_show_is_told() -> None:
    ring = SceneRecipe(
        scene="spinner", duration=1.0, sample_rate=250.0, noise_std=1e-3, seed=1,
        parameters={"harmonic_load": [0.2, 0.0, 0.0], "harmonic": 2.0},
    )  # fmt: skip
    found = estimate_recording(simulate(ring), load_settings(model="rigid"))
    assert not any("line" in name for name in found.tuned)
    (said,) = [r for r in found.verdict.reasons if "would hide in the noise" in r]
    assert "at twice the spin" in said
    quiet = estimate_recording(
        simulate(ring.model_copy(update={"noise_std": 1e-4})), load_settings(model="rigid")
    )
    assert "line-at-spin" not in quiet.verdict.codes


def test_a_result_file_keeps_what_may_hide(tmp_path: Path) -> None:
    top = SceneRecipe(scene="top", duration=0.3, sample_rate=200.0, noise_std=3e-4, seed=2)
    recording = simulate(top)
    found = estimate_recording(recording, load_settings(model="rigid"))
    assert found.hidden is not None
    write_result(tmp_path / "top.h5", found, recording)
    kept = read_result(tmp_path / "top.h5").hidden
    assert kept is not None
    for name in ("frequency", "amplitude", "band"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(found.hidden, name))
    rough = estimate_recording(recording, load_settings(method="savgol"))
    assert rough.hidden is None
