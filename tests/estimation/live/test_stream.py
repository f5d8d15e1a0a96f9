"""Force and moment while the motion goes on."""

import numpy as np
import pytest
from shaken import BODY, NOISE, RATE, WEIGHT, body_file, followed, frames, off

from forceid.config import load_settings
from forceid.errors import ConfigError, DataError, EstimationError
from forceid.estimation.live import loads, sight, stream, turning
from forceid.estimation.live.flight import begun, behind, told
from forceid.estimation.live.model import tuned_on
from forceid.estimation.live.run import followed_live, live_pace
from forceid.flight import attitude
from forceid.kalman.recursions import fixed_lag
from forceid.motion import pose
from forceid.records import Frame, Motion, Recording


def rms(error):
    return float(np.sqrt((error**2).mean()))


def test_every_frame_has_a_wrench_in_its_order():
    t, x = frames(400)
    assert [w.time for w in followed(t, x)] == t.tolist()
    assert [w.time for w in followed(t, x, on_file=False)] == t.tolist()


def test_a_wrench_comes_when_the_frame_a_lag_behind_it_has_come():
    t, x = frames(200)
    fed = []

    def stream_of():
        for time, position in zip(t.tolist(), x, strict=True):
            fed.append(time)
            yield time, position

    pace = live_pace(0.05, None, np.inf)
    for wrench in followed_live(stream_of(), body_file(), load_settings(), pace, True, lambda _: None):
        assert fed[-1] - wrench.time == pytest.approx(0.05) or fed[-1] == t[-1]


def test_the_force_is_the_true_one_within_what_is_claimed():
    error, claim = off(followed(*frames(1000))[100:-20])
    assert 0.6 < np.sqrt(np.mean((error / claim) ** 2)) < 1.5
    assert rms(error) < 0.05 * rms(error * 0 + 0.5)


@pytest.mark.long
def test_a_longer_lag_errs_less():
    t, x = frames(800)
    errors = [rms(off(followed(t, x, lag=lag)[100:-60])[0]) for lag in (0.01, 0.05, 0.2)]
    assert errors[0] > errors[1] > errors[2]


@pytest.mark.long
def test_the_same_frames_make_the_same_wrenches_tuned_anew_or_not():
    t, x = frames(900)
    one, other = (followed(t, x, on_file=False, retune=1.0) for _ in range(2))
    assert all((a.force == b.force).all() for a, b in zip(one, other, strict=True))


@pytest.mark.long
def test_it_is_tuned_anew_as_it_goes_and_says_so(monkeypatch):
    monkeypatch.setattr(stream, "TUNING_TIME", 0.5)
    monkeypatch.setattr(stream, "MOST_FRAMES", 256)
    said = []
    t, x = frames(900)
    found = followed(t, x, said.append, on_file=False, retune=1.0)
    assert sum("tuned on 256 frames" in text for text in said) == 3
    assert [w.time for w in found] == t.tolist()
    error, claim = off(found[300:-20])
    assert np.sqrt(np.mean((error / claim) ** 2)) < 1.5


@pytest.mark.long
def test_it_is_tuned_anew_when_frames_have_doubled_unless_it_never_is(monkeypatch):
    monkeypatch.setattr(stream, "TUNING_TIME", 0.2)
    t, x = frames(700)
    said = []
    followed(t, x, said.append, on_file=False)
    assert sum("tuned on" in text for text in said) == 1
    said = []
    followed(t, x, said.append, on_file=False, retune=60.0)
    assert [int(text.split()[2]) for text in said if "tuned on" in text] == [256, 511]


def test_a_tuning_that_fails_is_said_and_the_results_go_on(monkeypatch):
    monkeypatch.setattr(stream, "TUNING_TIME", 0.2)
    t, x = frames(700)
    honest, calls, said = stream.tuned_on, [], []

    def failing(*given, **named):
        calls.append(1)
        if len(calls) > 1:
            raise EstimationError("shows nothing")
        return honest(*given, **named)

    monkeypatch.setattr(stream, "tuned_on", failing)
    found = followed(t, x, said.append, on_file=False, retune=0.5)
    assert len(found) == len(t)
    assert any("not tuned anew" in text and "shows nothing" in text for text in said)


def test_lost_frames_are_flagged_on_both_sides_and_the_error_stays_within_its_claim():
    t, x = frames(500)
    kept = np.ones(500, bool)
    kept[250:280] = False
    found = followed(t[kept], x[kept])
    flagged = [w.time for w in found if w.flag == "degraded"]
    edge = t[[249, 280]]
    assert flagged[0] == pytest.approx(edge[0] - 0.05, abs=1.5 / RATE)
    assert flagged[-1] == pytest.approx(edge[1] + 0.05, abs=1.5 / RATE)
    assert all("no frames for 0.155 s" in w.reasons for w in found if w.reasons)
    error, claim = off(found[100:-20])
    assert (np.abs(error) < 6 * claim).all()
    beside = np.array([w.force_std[0] for w in found])
    assert beside[250] > 1.2 * beside[150]


def test_a_marker_that_is_lost_is_said_and_costs_accuracy_not_truth():
    t, x = frames(500)
    x[200:300, 1] = np.nan
    found = followed(t, x)
    assert {w.reasons for w in found[200:300]} == {("1 of 4 markers missing",)}
    assert not any(w.reasons for w in found[:200])
    error, claim = off(found[100:-20])
    assert 0.5 < np.sqrt(np.mean((error / claim) ** 2)) < 1.5


def test_frames_without_a_pose_are_bridged_and_flagged():
    t, x = frames(500)
    x[200:220, 1:] = np.nan
    found = followed(t, x)
    assert any("no pose" in reason for reason in found[210].reasons)
    assert all(np.isfinite(w.force).all() for w in found)
    assert found[210].force_std[0] > found[150].force_std[0]
    error, claim = off(found[100:-20])
    assert (np.abs(error) < 6 * claim).all()


def test_before_the_first_pose_nothing_is_told():
    t, x = frames(300)
    x[:20] = np.nan
    found = followed(t, x)
    assert all(np.isnan(w.force).all() and w.flag == "degraded" for w in found[:20])
    assert np.isfinite(found[25].force).all()


def test_a_long_gap_begins_a_new_flight_and_ends_the_old_one():
    t, x = frames(1600)
    kept = np.ones(1600, bool)
    kept[400:1200] = False
    found = followed(t[kept], x[kept])
    assert len(found) == kept.sum()
    assert all(w.flag == "degraded" for w in found[395:405])
    error, claim = off(found)
    assert (np.abs(error[50:]) < 6 * claim[50:]).all()
    assert found[-50].flag == "ok"


def test_a_single_wild_frame_is_left_out_and_said():
    t, x = frames(400)
    x[200] += 0.05
    found = followed(t, x)
    assert any("left out" in reason for reason in found[200].reasons)
    error, claim = off(found[100:-20])
    assert (np.abs(error) < 6 * claim).all()


def test_a_blow_that_the_tuning_does_not_foresee_is_flagged():
    t, x = frames(500)
    x[250:] += (3.0 * (t[250:] - t[250]))[:, None, None]  # a speed of 3 m/s from one frame to the next
    found = followed(t, x)
    assert any(w.flag == "degraded" for w in found[250:300])


def test_frames_out_of_order_are_left_out_and_said():
    t, x = frames(300)
    t[150] = t[149]
    said = []
    found = followed(t, x, said.append)
    assert len(found) == 299
    assert any("is left out: the one before" in text for text in said)


def test_a_clock_that_is_not_regular_is_followed():
    t, x = frames(900)
    kept = np.random.default_rng(0).random(900) > 0.1
    error, claim = off(followed(t[kept], x[kept])[100:-20])
    assert np.sqrt(np.mean((error / claim) ** 2)) < 1.5


def test_what_is_kept_does_not_grow_with_the_number_of_frames():

    recording = body_file()
    motion = recording.motion
    some = [Frame(float(t), p) for t, p in zip(motion.time, motion.position, strict=True)]
    model = tuned_on(some, recording.body, motion.gravity, motion.noise_std, load_settings())
    t, x = frames(1500)
    flight, sizes = begun(model, Frame(0.0, x[0]), 0.05, model.momentum), []
    for time, position in zip(t[1:].tolist(), x[1:], strict=True):
        flight = behind(model, flight, Frame(time, position), 0.05)
        flight, _ = told(model, flight, time - 0.05)
        sizes.append(
            sum(a.nbytes for part in (flight.force, flight.moment) for a in part) + len(flight.pending)
        )
    assert len(set(sizes[50:])) == 1


def test_a_record_shorter_than_the_first_stretch_is_tuned_on_as_a_whole():
    t, x = frames(120)
    said = []
    found = followed(t, x, said.append, on_file=False)
    assert len(found) == 120
    assert "tuned on 120 frames" in said[0]


def test_no_frames_make_no_wrenches():
    assert followed([], np.zeros((0, 4, 3)), on_file=False) == []


def test_frames_of_another_body_are_refused():
    t, x = frames(10)
    with pytest.raises(DataError, match=r"frame 1 has the shape \(3, 3\), expected \(4, 3\)"):
        followed(t, x[:, :3])


@pytest.mark.parametrize(
    ("name", "value"), [("lag", 0.0), ("lag", 11.0), ("first", -1.0), ("retune", np.nan)]
)
def test_a_pace_that_cannot_be_is_refused(name, value):
    with pytest.raises(ConfigError, match=name):
        followed(*frames(3), **{name: value})


def test_settings_that_a_live_estimate_does_not_follow_are_refused():
    pace = live_pace(None, None, None)
    with pytest.raises(ConfigError, match="load_prior"):
        followed_live(iter([]), body_file(), load_settings(load_prior="periodic"), pace, False, print)


def test_positions_in_millimeters_are_refused():
    t, x = frames(300)
    with pytest.raises(DataError, match="times what the reference shape does"):
        followed(t, 1e3 * x, on_file=False)


def test_the_noise_that_is_claimed_follows_from_that_of_the_markers():
    t, x = frames(300)
    _, claim = off(followed(t, x)[100:200])
    assert 1e-2 * NOISE < np.median(claim) < 1.0


@pytest.mark.long
def test_a_tuning_that_does_not_fit_is_replaced_before_its_time(monkeypatch):
    monkeypatch.setattr(stream, "TUNING_TIME", 0.3)
    monkeypatch.setattr(stream, "MOST_FRAMES", 256)
    t, x = frames(900)
    x[400:] += (0.02 * np.sin(40 * (t[400:] - t[400])))[:, None, None]  # 2.6 N that nothing foretold
    said = []
    found = followed(t, x, said.append, on_file=False, retune=1e6)
    assert any("does not fit" in reason for w in found[400:460] for reason in w.reasons)
    assert sum("tuned on 256 frames" in text for text in said) > 1
    assert not found[-30].reasons


def test_nodes_without_a_marker_are_not_missing():
    t, x = frames(300)
    x[:, 3] = np.nan
    recording = Recording(BODY, Motion(t, x, gravity=WEIGHT, noise_std={"position": NOISE}))
    pace = live_pace(None, None, np.inf)
    stream_of = zip(t.tolist(), x, strict=True)
    found = list(followed_live(stream_of, recording, load_settings(), pace, True, lambda _: None))
    assert not any(w.reasons for w in found)


def test_without_a_compiler_the_wrenches_are_the_same(monkeypatch):
    t, x = frames(150)
    compiled = followed(t, x)
    monkeypatch.setattr(fixed_lag, "FOLLOW", None)
    monkeypatch.setattr(loads, "ONWARD", None)
    monkeypatch.setattr(sight, "SEE", None)
    monkeypatch.setattr(turning, "ALONG", None)
    for module in (attitude, pose):
        monkeypatch.setattr(module, "compiled", None)
    plain = followed(t, x)
    for name in ("force", "moment", "force_std", "moment_std"):
        one, other = (np.array([getattr(w, name) for w in found[20:]]) for found in (compiled, plain))
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6 * np.abs(other).max())
