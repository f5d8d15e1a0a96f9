"""The plain route beside an estimate: what it says by itself, when the two differ, and what follows."""

from dataclasses import replace

import closed_forms as cf
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.drawn.edges import flown as flown_states
from evidence.subjects.flights.drawn_loads import draw_matern
from evidence.vectors import GRAVITY
from forceid.config import load_settings
from forceid.errors import EstimationError
from forceid.estimation import routes, run
from forceid.estimation.loads.plain_cut import apiece
from forceid.estimation.witness.plain_route import plain_route
from forceid.estimation.witness.witness import (
    apart_in_bands,
    differs,
    judge_witness,
    low_passed,
    spectrum_and_cuts,
    witness_of,
    yielding,
)
from forceid.files.result import read_result, write_result
from forceid.records import Body, Motion


def pushed(seed, frames=200, rate=100.0):
    """Markers of a body that does not turn, of which the force is drawn, and the force."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames) / rate
    load = draw_matern(10 ** rng.uniform(-1, 1), rng.uniform(3, 40), t[-1], rng)
    still = cf.toss(t, spin=(1e-9, 0.0), noise=0.0)
    path = still.motion.position + ((load.second(t) - cf.FORCE * t[:, None] ** 2 / 2) / cf.MASS)[:, None]
    noise = 10 ** rng.uniform(-4, -2.5)
    return cf.seen_as(still, path + noise * rng.standard_normal(path.shape)), load.at(t)


def stretching(offset, seed=0, frames=150):
    """Free flight of a body known as a whole, stretched at 6 Hz, its markers `offset` m off the center."""
    t = np.arange(frames) / 150.0
    body = cf.star()
    X = np.vstack([body.position, [[0.05, 0.08, 0.04]]]) + offset * np.array([1.0, 0.6, -0.3])
    strain = np.array([[1.0, 0.3, 0.0], [0.3, -0.8, 0.2], [0.0, 0.2, 0.5]])
    F = np.eye(3) + 0.08 * np.sin(2 * np.pi * 6 * t)[:, None, None] * strain
    R = Rotation.from_rotvec(np.outer(t, [1.0, 2.0, 3.0])).as_matrix()
    center = t[:, None] * [1.0, 2.0, 5.0] + 0.5 * t[:, None] ** 2 * cf.GRAVITY
    x = center[:, None] + np.einsum("tab,tbc,nc->tna", R, F, X)
    x += 3e-4 * np.random.default_rng(seed).standard_normal(x.shape)
    whole = {"total_mass": cf.MASS, "mass_center": np.zeros(3), "inertia": cf.INERTIA}
    known = Body(node=(*cf.NAMES, "tip"), position=X, **whole)
    flown = cf.toss(t)
    return replace(flown, body=known, motion=replace(flown.motion, position=x), truth={})


def compared(time, channel, load, claim):
    """The load of a channel with its deviation, and its numbers beside a load."""
    spectrum, cuts = spectrum_and_cuts(channel)
    numbers = {"cutoff": np.array([cut.frequency for cut in cuts])}
    return low_passed(time, channel, cuts), numbers | apart_in_bands(
        channel, spectrum, cuts, time, load, claim
    )


def off_in(result, name):
    witness = result.witness
    return getattr(witness, f"difference_{name}") / getattr(witness, f"limit_{name}")


def test_true_load_differs_by_more_than_chance_in_none_of_thirty_recordings():
    worst = []
    for seed in range(30):
        recording, force = pushed(seed)
        channel = plain_route(recording.body, recording.motion).force
        _, numbers = compared(recording.motion.time, channel, force, np.zeros_like(force))
        worst.append((numbers["difference"] / numbers["limit"]).max())
        assert (numbers["difference"] > 0.3).all()  # the noise is there to be seen
    assert max(worst) < 1  # three in ten thousand by chance


def test_load_that_is_off_by_a_few_of_its_errors_is_found_out():
    found = []
    for seed in range(10):
        recording, force = pushed(seed)
        t = recording.motion.time
        channel = plain_route(recording.body, recording.motion).force
        (_, std), numbers = compared(t, channel, force, np.zeros_like(force))
        wrong = force + 4 * np.median(std, 0) * np.sin(2 * np.pi * 0.7 * numbers["cutoff"] * t[:, None])
        _, numbers = compared(t, channel, wrong, np.zeros_like(force))
        found += list(numbers["difference"] > numbers["limit"])
    assert np.mean(found) > 0.9


def test_estimate_within_its_claim_stays_ok_and_shows_both(flown):
    recording, result = flown
    assert result.verdict.level == "ok"
    assert max(off_in(result, "force").max(), off_in(result, "moment").max()) < 1
    witness = result.witness
    for name in ("force", "moment"):
        values, std = getattr(witness, name), getattr(witness, f"{name}_std")
        score = cf.rms(((values - recording.truth[name]) / std)[15:-15])
        assert 0.2 < score < 2.5
        assert (getattr(witness, f"cutoff_{name}") > 0).all()


@pytest.mark.parametrize("method", ["savgol", "spline", "difference"])
def test_classic_methods_have_the_witness_too(estimated, method):
    result = estimated(cf.toss(), method=method)
    assert max(off_in(result, "force").max(), off_in(result, "moment").max()) < 1


def test_estimate_that_is_wrong_on_one_axis_is_said_to_be_and_its_claim_covers_it():
    recording = cf.toss()
    _, solution = run.estimate_whole(recording, load_settings(method="savgol", model="rigid"))
    wrong = np.outer(0.5 * np.sin(2 * np.pi * 4 * recording.motion.time), [1.0, 0.0, 0.0])  # N
    state = replace(solution.state, force=solution.state.force + wrong)
    witness = witness_of(recording.body, recording.motion, state)
    assert differs(witness, "force").tolist() == [True, False, False]
    assert not differs(witness, "moment").any()
    (finding,) = judge_witness(witness, state)
    assert "the force along x is" in finding.text
    assert "by the plain route" in finding.text
    cov = yielding(state, witness).wrench_cov
    std = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))[:, :3]
    score = (state.force - recording.truth["force"]) / std
    assert 0.5 < cf.rms(score[15:-15, 0]) < 1.5
    np.testing.assert_array_equal(cov[:, 1:, 1:], state.wrench_cov[:, 1:, 1:])


@pytest.mark.long
def test_deformation_off_the_markers_leaks_into_neither_route_and_comes_back_from_a_file(estimated, tmp_path):
    recording = stretching(0.05)
    result = estimated(recording, model="rigid")
    assert cf.rms(result.witness.force[20:-20]) < 0.01  # free flight, whatever the stretch
    assert np.isnan(result.witness.moment).all()  # of a rigid fit, while the body deforms
    assert cf.rms(result.force[20:-20] / result.force_std[20:-20]) < 2
    write_result(tmp_path / "a.h5", result, recording)
    back = read_result(tmp_path / "a.h5").witness
    for name, value in vars(result.witness).items():
        np.testing.assert_array_equal(getattr(back, name), value)


def test_moment_of_a_body_whose_mass_is_all_seen_follows_the_deformation(breathing):
    recording, result = breathing
    error = result.witness.moment - recording.truth["moment"]
    assert cf.rms(error[15:-15]) < 0.15 * cf.rms(recording.truth["moment"])
    assert off_in(result, "moment").max() < 1


def test_a_marker_lost_for_a_while_leaves_the_mass_center_where_it_is():
    recording = cf.toss(noise=0.0, stated=False)
    whole = plain_route(recording.body, recording.motion)
    x = recording.motion.position.copy()
    x[30:60, 2] = x[50:70, 4] = np.nan
    gappy = plain_route(recording.body, cf.seen_as(recording, x).motion)
    np.testing.assert_allclose(gappy.force.z, whole.force.z, atol=1e-9)
    np.testing.assert_allclose(gappy.moment.z, whole.moment.z, atol=1e-9)
    assert not gappy.force.whole[30:70].any()
    assert gappy.force.whole[:30].all()


def test_twice_the_mass_takes_twice_the_force():
    recording = cf.toss()
    heavy = cf.star(mass=np.full(6, cf.MASS / 3))
    one, two = (plain_route(body, recording.motion) for body in (recording.body, heavy))
    nothing, claim = np.zeros((2, 120, 3))
    for name in ("force", "moment"):
        (load, std), numbers = compared(recording.motion.time, getattr(one, name), nothing, claim)
        (double, wide), same = compared(recording.motion.time, getattr(two, name), nothing, claim)
        np.testing.assert_allclose(double, 2 * load, rtol=1e-6, atol=1e-9 * np.abs(load).max())
        np.testing.assert_allclose(wide, 2 * std, rtol=1e-6)
        np.testing.assert_allclose(same["cutoff"], numbers["cutoff"])


def test_smoother_that_fails_leaves_the_plain_route_as_the_estimate(estimated, monkeypatch):
    def fails(*args):
        raise EstimationError("does not settle", "the smoother on rotations", "add a gyro")

    monkeypatch.setattr(routes, "estimate_flight", fails)
    recording = cf.toss()
    result = estimated(recording, model="rigid")
    assert result.verdict.level == "degraded"
    assert any(
        "does not settle: force and moment are those of the plain route" in r for r in result.verdict.reasons
    )
    for name in ("force", "moment"):
        np.testing.assert_array_equal(getattr(result, name), getattr(result.witness, name))
        score = (getattr(result, name) - recording.truth[name]) / getattr(result, f"{name}_std")
        assert 0.2 < cf.rms(score[15:-15]) < 2.5


def test_what_a_load_gave_in_a_long_gap_is_not_held_against_it():
    time = np.r_[:40, 60:100] / 100
    wave, jump = np.sin(33 * time), np.where(time < 0.5, 0.0, 2.0 + 5.0 * time)
    lost = np.where(time < 0.5, 0, 20)
    np.testing.assert_allclose(apiece(time, wave + jump, lost), apiece(time, wave, lost), atol=1e-12)
    np.testing.assert_array_equal(apiece(time, jump, lost // 5), jump)


@pytest.mark.long
def test_a_gap_in_all_markers_is_no_difference_of_the_moment():
    t, off = np.arange(400) / 200.0, []
    J = np.diag([2e-3, 3e-3, 4e-3])
    for seed in range(6):
        rng = np.random.default_rng([611, seed])
        w, phase = 2 * np.pi * rng.uniform(1, 12, (4, 3)), rng.uniform(0, 2 * np.pi, (4, 3))
        size = 0.1 * rng.standard_normal((4, 3))

        def load(at, _, size=size, w=w, phase=phase):
            return np.zeros(3), (size * np.sin(w * at + phase)).sum(0)

        start = np.concatenate([np.zeros(6), Rotation.random(rng=rng).as_quat(), J @ rng.normal(0, 8, 3)])
        path = flown_states(t, start, 0.5, J, load, [])
        place = rng.uniform(-0.1, 0.1, (8, 3))
        R = Rotation.from_quat(path[:, 6:10]).as_matrix()
        x = path[:, None, :3] + np.einsum("tab,nb->tna", R, place) + 2e-4 * rng.standard_normal((400, 8, 3))
        x[130:165] = np.nan
        names = tuple(f"m{k}" for k in range(8))
        body = Body(names, place, total_mass=0.5, mass_center=np.zeros(3), inertia=J)
        channel = plain_route(body, Motion(t, x, gravity=GRAVITY)).moment
        moment = np.array([load(at, None)[1] for at in t])
        _, numbers = compared(t, channel, moment, np.full((400, 3), 0.01))
        off.append((numbers["difference"] / numbers["limit"]).max())
    assert max(off) < 1
