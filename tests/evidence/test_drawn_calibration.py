"""Drawn records: seeds reproduce, the truth is what moved the body, and the judge says what the page says."""

from dataclasses import replace

import numpy as np
import pytest

from evidence.calibration import distributions, record
from evidence.calibration.distributions import ERRORS, LOADS, PLACES, STATED, TOLD, drawn_kinds
from evidence.calibration.judged import Outcome
from evidence.calibration.page import page
from evidence.calibration.record import GRAVITY, drawn_record

STENCIL = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])  # of a first derivative, to order 8


def rate(values, step):
    """First derivative (time - 8, ...) of values by differences, without four samples at either end."""
    n = len(values)
    parts = (c * (values[4 + k : n - 4 + k] - values[4 - k : n - 4 - k]) for k, c in enumerate(STENCIL, 1))
    return sum(parts) / step


def of_kind(monkeypatch, **kinds):
    """A drawn record of certain kinds, short and seldom."""
    short = {"rate": 200.0, "samples": 120, "held": False}
    monkeypatch.setattr(record, "drawn_kinds", lambda rng, _: replace(drawn_kinds(rng), **short | kinds))
    return drawn_record(5, list(LOADS).index(kinds.get("load", "none")))


def test_each_distribution_adds_up():
    for shares in (LOADS, ERRORS, PLACES, STATED, TOLD):
        assert sum(shares.values()) == pytest.approx(1.0)


def test_a_record_is_that_of_its_seed_and_number():
    one, same, other, number = (drawn_record(*at) for at in ((3, 8), (3, 8), (4, 8), (3, 9)))
    assert np.array_equal(one.recording.motion.position, same.recording.motion.position, equal_nan=True)
    assert np.array_equal(one.recording.truth["moment"], same.recording.truth["moment"])
    assert one.drawn == same.drawn
    assert one.drawn not in (other.drawn, number.drawn)


@pytest.mark.parametrize("soft", [False, pytest.param(True, marks=pytest.mark.long)])
@pytest.mark.parametrize("load", LOADS)
def test_momenta_change_as_force_and_moment_say(monkeypatch, load, soft):
    case = of_kind(monkeypatch, load=load, soft=soft, place="anywhere", markers=7, weight=True)
    time = np.arange(1200) * 1e-4 + 0.2  # s, apart from the samples of the record
    body, flight = case.body, case.again(np.concatenate([[0.0, 1e-4], time]))
    center, F, force, moment = (a[2:] for a in (flight.center, flight.F, flight.force, flight.moment))
    momentum = body.mass * rate(center, 1e-4)
    spun = np.einsum("tij,jk,tlk->til", rate(F, 1e-4), body.second, F[4:-4])  # velocity along i, arm along l
    turn = np.stack(
        [spun[:, 2, 1] - spun[:, 1, 2], spun[:, 0, 2] - spun[:, 2, 0], spun[:, 1, 0] - spun[:, 0, 1]], 1
    )
    # integrals, which steps leave continuous: what the loads gave is what the momenta gained
    for gained, acts, size in (
        (momentum, force + body.mass * GRAVITY, body.mass),
        (turn, moment, np.trace(body.inertia)),
    ):
        gave = np.cumsum((acts[4:-5] + acts[5:-4]) / 2 * 1e-4, axis=0)
        off = gained[1:] - gained[0] - gave
        # sums in place of integrals: of a blow of 2 ms in steps of 0.1 ms, 2 pi / 8 * (0.1 / 2)^2 of it
        assert np.abs(off).max() < 2.5e-3 * np.abs(gave).max() + 1e-6 * size


@pytest.mark.long
def test_of_a_load_that_jumps_the_truth_is_the_mean_over_a_sample(monkeypatch):
    monkeypatch.setattr(distributions, "BESIDE", 0.0)  # nothing smooth acts beside the jumps
    case = of_kind(monkeypatch, load="steps", soft=False, place="anywhere", markers=7, weight=True)
    coarse, finer = case.recording.truth["force"], 50  # of a sample
    count = len(coarse)
    fine = case.again(np.arange((count - 1) * finer + 1) / (200.0 * finer)).force
    cells = fine[finer // 2 + 1 : -finer // 2].reshape(count - 2, finer, 3)
    jump = np.abs(np.diff(fine, axis=0)).max()
    assert np.abs(np.diff(coarse, axis=0)).max() > 0.1 * jump
    assert np.abs(cells.mean(1) - coarse[1:-1]).max() < jump / finer


def outcome(verdict, over=(1.0, 1.0), beside=(1.0, 1.0), **more):
    kinds = {
        "load": "none",
        "error": "white",
        "told": "wrong",
        "place": "anywhere",
        "stated": "right",
        "soft": False,
    }
    return Outcome(0, kinds, verdict, (), 1.0, over=over, beside=beside, **more)


def test_silent_is_an_ok_beyond_twice_its_claim_or_twice_the_plain_route():
    assert outcome("ok", over=(0.5, 2.1)).silent
    assert outcome("ok", beside=(2.1, 0.2)).silent
    assert not outcome("ok", over=(1.9, np.nan), beside=(np.nan, 1.9)).silent
    assert not outcome("degraded", over=(9.0, 9.0)).silent


def test_caution_is_needless_where_both_are_within_their_claims():
    assert outcome("degraded", over=(1.4, 0.1)).needless
    assert not outcome("degraded", over=(0.1, 1.6)).needless
    assert not outcome("ok").needless


def test_the_page_counts_a_made_up_silent_record_once_with_an_exact_interval():
    rows = [
        outcome("ok"),
        outcome("ok", over=(3.0, 3.0), beside=(5.0, 5.0)),
        outcome("degraded", degrading=("wild",)),
    ]
    text = "\n".join(page(rows, 1, "command"))
    assert "| silently wrong | 1 of 3 | 33.3 % (0.8–90.6) |" in text
    assert "| `wild` | 1 | 1 | 1 |" in text


@pytest.mark.long
def test_stated_noise_is_the_deviation_of_the_readings(monkeypatch):
    for error in ("white", "colored", "low-passed", "shared"):
        case = of_kind(
            monkeypatch, error=error, stated="right", load="none", soft=False, markers=20, samples=1500
        )
        places = case.flight.center[:, None] + np.einsum("tab,nb->tna", case.flight.F, case.body.markers)
        told = case.recording.motion.noise_std["position"]
        inner = slice(200, -200)  # a low-pass bends the places at the ends
        assert (case.recording.motion.position - places)[inner].std() == pytest.approx(told, rel=0.1)
