"""Lines of a load: found where they are, at their size, on their axis, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from linear_models import draw
from scipy.spatial.transform import Rotation

from forceid.flight.channels import Channel, Start, driven, load_chain
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned, channel_model
from forceid.flight.tuning import tune_loads
from forceid.kalman import filter as kalman_filter
from forceid.kalman import log_likelihood, smooth
from forceid.kalman.building import line_search
from forceid.kalman.building.line_candidates import Candidate, is_white, line_candidates
from forceid.kalman.building.line_search import (
    find_line,
    let_drift,
    line_evidence,
    missed_lines,
    pushes,
    whitened_lines,
)
from forceid.kalman.building.lines import PER_CYCLE, Line
from forceid.kalman.building.process import discretize
from forceid.kalman.engines import engine

MASS, STEP, COUNT, NOISE = 0.13, 2e-3, 400, 1e-4
TIME = STEP * np.arange(COUNT)
SPAN = TIME[-1]
TURN = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]


def prior(lines=(), axes=TURN, order=3):
    kernel = Matern(order, np.array([1.0, 2.0, 0.5]), np.array([6.0, 4.0, 8.0]))
    return LoadPrior(Tuned(kernel), axes, Start(1e-4, 1e-2, 1e-2), lines)


def channel(z, noise=NOISE):
    return Channel(TIME, z, 1 / MASS, np.tile(noise**2 * np.eye(3), (COUNT, 1, 1)), np.zeros((3, 3)))


def model_of(lines=(), **more):
    return channel_model(channel(np.zeros((COUNT, 3))), prior(lines, **more))


def recorded(seed, lines=()):
    """Measured positions under loads drawn from the prior, and the true load (time, 3)."""
    x, z = draw(model_of(lines), COUNT, np.random.default_rng(seed))
    return z, x @ prior(lines).rows.T


def line(frequency=20.0, std=0.3, bandwidth=1e-4, axis=0, driven=False):
    return Line(frequency, std, bandwidth, np.eye(3)[axis], driven)


def excite(model, root):
    """What channels see of unit lines from rest, open loop: (time, channel, direction, root, 2)."""
    F, H = np.broadcast_to(model.F, (COUNT - 1, *model.F.shape[-2:]))[:, :6, :6], model.H[..., :6]
    move, moved, pushed = pushes(F, np.diff(TIME), TIME, TURN, root)
    x = np.zeros((COUNT, 6, 3 * moved.shape[1]))
    x[1:, :3] = np.einsum("kij,kq->kijq", move, moved).reshape(len(moved), 3, -1)
    x[1:, 3:] = np.einsum("ij,kq->kijq", TURN.T, pushed).reshape(len(moved), 3, -1)
    for F_k, now, then in zip(F, x[:-1], x[1:], strict=True):
        then += F_k @ now
    return (H @ x).reshape(COUNT, -1, 3, len(root), 2)


def leaving_model():
    """A body that leaves its path by itself, e^50 times over the record, as a turn about the middle axis."""
    model, step = model_of(), np.diff(TIME)
    F = np.broadcast_to(model.F, (len(step), *model.F.shape[-2:])).copy()
    F[:, :3, :3] *= np.exp(50.0 * step / TIME[-1])[:, None, None]
    return replace(model, F=F, Q=np.broadcast_to(model.Q, F.shape))


def missed_by(model, z, root):
    """The filter of a record, and what it misses of lines as signals (time, signal, channel)."""
    filtered = kalman_filter(model, z)
    missed = missed_lines(model, filtered, TIME, TURN, root, np.broadcast_to(np.eye(3), (COUNT, 3, 3)))
    signals = np.moveaxis(missed, 1, -1).reshape(COUNT, -1, 3)
    return filtered, np.where(np.isfinite(z)[:, None], signals, np.nan)


def found_in(z, candidate=20.0, named=True):
    model = model_of()
    return find_line(model, kalman_filter(model, z), TIME, TURN, Candidate(candidate, named))


def test_chain_with_lines_is_that_of_each_axis_by_itself_when_axes_and_directions_agree():
    """Three scalar channels with their own lines, against the chain in space."""
    wave = line(axis=1, bandwidth=2.0, driven=True)
    space = channel_model(channel(np.zeros((COUNT, 3))), prior((wave,), axes=np.eye(3)))
    z = draw(space, COUNT, np.random.default_rng(0))[1]
    kernel, start, total = prior().kernel, prior().start, 0.0
    for axis in range(3):
        beside = [wave.process] if axis == 1 else []
        chain = load_chain(kernel.of(np.array([axis])).process, start, beside)
        var = np.full((COUNT, 1), NOISE**2)
        model = driven(chain, 1 / MASS, var, np.zeros(1), np.diff(TIME)).one(0)
        total += float(log_likelihood(model, z[:, axis]))
    assert float(log_likelihood(space, z)) == pytest.approx(total, abs=1e-6)


def test_chain_with_lines_keeps_a_covariance_that_is_symmetric_and_positive():
    _, Q, P0 = prior((line(), line(axis=1, bandwidth=3.0, driven=True))).chain(np.array([1e-3, 0.5]))
    for cov in (*Q, P0):
        np.testing.assert_allclose(cov, cov.T, atol=1e-12 * cov.max())
        size = np.sqrt(np.maximum(np.diag(cov), 1e-300))
        assert np.linalg.eigvalsh(cov / size / size[:, None])[0] > -1e-9


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("body_axes", [None, TURN])
def test_a_unit_of_any_line_is_read_as_its_direction_wherever_it_stands(body_axes, turns):
    lines = tuple(replace(line(20.0 + i, axis=i), turns=turns) for i in range(3))
    load = replace(prior(lines, axes=np.eye(3)), body_axes=body_axes)
    R = Rotation.from_rotvec(np.outer(9.0 * TIME, [0.2, 0.4, 1.0])).as_matrix()
    model = channel_model(channel(np.zeros((COUNT, 3))), load, R)
    rows = np.broadcast_to(load.rows_along(R), (COUNT, 3, len(model.x0)))
    for i in range(3):
        unit = np.eye(len(model.x0))[len(model.x0) - 6 + 2 * i]
        wanted = R[:, :, i] if turns else np.tile(np.eye(3)[i], (COUNT, 1))
        np.testing.assert_allclose(rows @ unit, wanted, atol=1e-15)
        # what it drives over a step is the mean of its direction there, to second order of the turn
        gained = model.F[40, 3:6] @ unit / STEP
        middle = Rotation.from_rotvec(9.0 * (TIME[40] + 0.5 * STEP) * np.array([0.2, 0.4, 1.0])).as_matrix()
        np.testing.assert_allclose(gained, middle[:, i] if turns else wanted[0], atol=0.02)


@pytest.mark.parametrize("off", [-0.05, 0.08])  # cycles over the record
def test_line_of_loose_frequency_holds_one_a_little_off_to_second_order(off):
    """Of a phasor that keeps its phase in the middle, by closed form."""
    load = replace(line(bandwidth=0.0), loose=1 / PER_CYCLE / SPAN).process
    middle, beside = TIME - 0.5 * SPAN, 2 * np.pi * off / SPAN
    wanted = np.exp(2j * np.pi * 20.0 * TIME + 1j * beside * middle)
    x = np.array([1.0, 0.0, 0.0, beside])  # the phasor and its derivative, as at the start
    x[:2] += -0.5 * SPAN * x[2:]
    F, _ = discretize(load, STEP)
    path = np.empty(COUNT)
    for k in range(COUNT):
        path[k], x = load.output @ x, F @ x
    assert np.abs(path - wanted.real).max() < 0.6 * (np.pi * off) ** 2
    assert np.abs(path - np.cos(2 * np.pi * 20.0 * TIME)).max() > 3 * (np.pi * off) ** 2


def test_size_of_a_line_of_loose_frequency_is_stated_in_the_middle_of_the_record():
    load = replace(line(bandwidth=0.0), loose=1 / PER_CYCLE / SPAN).process
    F, _ = discretize(load, 0.5 * SPAN)
    np.testing.assert_allclose((F @ load.P0 @ F.T)[:2, :2], 0.3**2 * np.eye(2), atol=1e-12)
    assert np.linalg.eigvalsh(load.P0).min() > 0


def test_ring_down_is_driven_by_nothing_and_a_driven_line_keeps_its_size():
    for driven_on in (False, True):
        load = line(bandwidth=5.0, driven=driven_on).process
        growth = load.A @ load.P0 + load.P0 @ load.A.T + load.Qc
        expected = 0.0 if driven_on else -2 * 5.0 * 0.3**2
        np.testing.assert_allclose(growth, expected * np.eye(2), atol=1e-12)


def test_response_to_a_unit_line_is_that_of_the_chain_that_holds_it():
    wave = line(frequency=17.0, bandwidth=3.0, axis=2)
    model = model_of((wave,))
    root = np.array([2j * np.pi * 17.0 - 3.0])
    seen = excite(model_of(), root)[:, :, 2, 0]
    for state in (0, 1):
        x = np.zeros(len(model.x0))
        x[-2 + state] = 1.0
        for k in range(COUNT):
            np.testing.assert_allclose(seen[k, :, state], model.H @ x, atol=1e-12)
            x = model.at("F", min(k, COUNT - 2)) @ x


ROOT = np.array([2j * np.pi * 20.0 - 1e-4, 2j * np.pi * 7.0 - 3.0])


def test_lines_whitened_are_what_they_add_to_the_innovations():
    model, (z, _) = model_of(), recorded(1)
    z[100:120] = np.nan
    z[200, 1] = np.nan
    before, more = kalman_filter(model, z), excite(model, ROOT)
    white = whitened_lines(model, before, TIME, TURN, ROOT)
    for line_ in np.ndindex(3, 2, 2):
        added = white[(..., *line_)]
        after = kalman_filter(model, z + more[(..., *line_)])
        difference = np.nan_to_num(after.innovation - before.innovation)
        np.testing.assert_allclose(added[np.isfinite(z)], difference[np.isfinite(z)], atol=1e-8)


def test_compiled_lines_are_those_of_numpy(monkeypatch):
    model, (z, _) = model_of(), recorded(1)
    filtered = kalman_filter(model, z)
    found = whitened_lines(model, filtered, TIME, TURN, ROOT)
    monkeypatch.setattr(line_search, "compiled", None)
    np.testing.assert_allclose(whitened_lines(model, filtered, TIME, TURN, ROOT), found, atol=1e-11)


def test_lines_on_a_flight_that_leaves_its_path_by_itself_keep_their_digits():
    """The motion of a line grows by e^50, what a filter misses does not."""
    leaving, (z, _) = leaving_model(), recorded(1)
    white = whitened_lines(leaving, kalman_filter(leaving, z), TIME, TURN, ROOT[:1])
    assert np.abs(excite(leaving, ROOT[:1])[-1]).max() > 1e12 * np.abs(white).max()
    late = np.abs(white[-50:]).max() / np.abs(white[100:150]).max()
    assert 0.5 < late < 2.0


@pytest.mark.parametrize("name", ["auto", "numpy", "filterpy"])
def test_what_a_smoother_follows_of_lines_is_told_by_what_its_filter_misses_of_them(name):
    model, (z, _) = model_of(), recorded(1)
    z[100:120] = np.nan
    z[200, 1] = np.nan
    filtered, missed = missed_by(model, z, ROOT)
    signals = np.moveaxis(excite(model, ROOT), 1, -1).reshape(COUNT, -1, 3)
    still = replace(model, x0=0 * model.x0)
    signals = np.where(np.isfinite(z)[:, None], signals, np.nan)
    expected = engine().filter_and_smooth_states(still, signals)[1][:, :, 6:]
    np.testing.assert_allclose(engine(name).followed(filtered, missed, 6), expected, atol=1e-7)


def test_a_load_that_a_smoother_follows_on_a_flight_that_leaves_its_path_keeps_its_size():
    leaving, (z, _) = leaving_model(), recorded(1)
    load = engine().followed(*missed_by(leaving, z, ROOT[:1]), 6) @ prior().rows[:, 6:].T
    assert np.abs(load).max() < 2.0  # of a line of size one
    late = np.abs(load[-100:-50]).max() / np.abs(load[50:100]).max()
    assert 0.5 < late < 2.0


def test_evidence_is_the_likelihood_that_the_model_with_the_line_gains():
    """In closed form from one filter pass, against two passes."""
    z, _ = recorded(2, (line(),))
    model = model_of()
    filtered = kalman_filter(model, z)
    white = whitened_lines(model, filtered, TIME, TURN, np.array([2j * np.pi * 20.0 - 1e-4]))
    information = np.einsum("tcafi,tcbfj->faibj", white, white)[0]
    told = np.einsum("tcafi,tc->fai", white, filtered.innovation)[0]
    for axes in ((0,), (0, 2)):
        gained, std = line_evidence(information, told, axes)
        lines = tuple(line(std=std, axis=a) for a in axes)
        expected = float(log_likelihood(model_of(lines), z)) - float(log_likelihood(model, z))
        assert gained == pytest.approx(expected, abs=1e-5)
        for factor in (0.8, 1.25):  # no other size gains more
            other = model_of(tuple(replace(one, std=factor * std) for one in lines))
            assert float(log_likelihood(other, z)) - float(log_likelihood(model, z)) < gained


@pytest.mark.parametrize("seed", range(4))
def test_line_on_one_axis_is_found_on_that_axis_alone(seed):
    z, _ = recorded(10 + seed, (line(),))
    (one,) = found_in(z)
    assert one.direction.tolist() == [1.0, 0.0, 0.0]
    assert one.frequency == 20.0  # the harmonic's own


def test_no_line_is_found_where_there_is_none():
    for seed in range(8):
        assert found_in(recorded(20 + seed)[0]) == ()


def test_line_beside_the_frequency_looked_at_is_found_at_its_own():
    z, _ = recorded(31, (line(frequency=20.7, std=0.6),))
    (one,) = found_in(z, candidate=20.0, named=False)
    assert one.frequency == pytest.approx(20.7, abs=0.1 / SPAN)


def test_ring_down_is_found_with_its_rate():
    z, _ = recorded(32, (line(std=3.0, bandwidth=12.0, axis=1),))
    (one,) = found_in(z)
    assert one.direction.tolist() == [0.0, 1.0, 0.0]
    assert one.bandwidth == pytest.approx(12.0, rel=0.4)
    assert not one.driven


def test_line_whose_phase_drifts_is_let_drift_and_a_steady_one_is_not():
    for bandwidth, drifts in ((12.0, True), (1e-4, False)):
        true = line(std=0.5, bandwidth=bandwidth, driven=bandwidth > 1)
        z, _ = recorded(33, (true,))

        def likely(lines, z=z):
            return float(log_likelihood(model_of(lines), z))

        (found,) = let_drift(likely, (line(std=0.5),), SPAN)
        assert found.driven is drifts


def test_innovations_name_the_harmonic_and_any_other_line_and_are_quiet_where_white():
    rng = np.random.default_rng(40)
    white = rng.standard_normal((COUNT, 3))
    white[:, 1] += 0.8 * np.sin(2 * np.pi * 20.2 * TIME)
    assert line_candidates(TIME, white, 10.0) == [Candidate(20.0, named=True, known=True)]
    (other,) = line_candidates(TIME, white, 0.0)
    assert other.frequency == pytest.approx(20.2, abs=0.6 / SPAN)
    assert not other.named
    assert line_candidates(TIME, white, 10.0, looked=[20.2]) == []
    held = [line(20.2, axis=0), line(20.2, axis=2)]
    (named,) = line_candidates(TIME, white, 0.0, held)  # along y, on which none is held
    assert named == Candidate(20.2, named=True)
    assert line_candidates(TIME, white, 0.0, [line(20.2, axis=1)]) == []
    quiet = [line_candidates(TIME, rng.standard_normal((COUNT, 3)), 0.0) for _ in range(50)]
    assert sum(map(len, quiet)) <= 1


def test_a_band_that_a_prior_falls_short_of_holds_no_line_but_those_that_stand_out_of_it():
    rng, span = np.random.default_rng(9), 100.0
    time = np.arange(20_000) * span / 20_000
    v = rng.standard_normal((len(time), 3))
    spectrum, f = np.fft.rfft(v, axis=0), np.fft.rfftfreq(len(time), time[1])
    spectrum[(f > 1) & (f < 2)] *= 2.0
    v = np.fft.irfft(spectrum, len(time), axis=0)
    assert line_candidates(time, v, 0.0) == []
    v[:, 1] += 0.2 * np.cos(2 * np.pi * 1.5 * time)
    (found,) = line_candidates(time, v, 0.0)
    assert abs(found.frequency - 1.5) < 0.5 / span


def test_innovations_are_white_unless_a_frequency_stands_out_however_slow():
    rng = np.random.default_rng(41)
    white = [rng.standard_normal((COUNT, 3)) for _ in range(50)]
    assert sum(map(is_white, white)) >= 49
    for cycles in (0.5, 20.0):
        swing = 0.5 * np.cos(2 * np.pi * cycles * TIME / SPAN)[:, None] * [0.0, 1.0, 0.0]
        assert not any(is_white(v + swing) for v in white[:10])


def test_load_with_its_line_is_recovered_within_its_claims_and_the_other_axes_lose_nothing():
    ratio, error, beside = [], [], []
    inner = slice(COUNT // 8, -COUNT // 8)
    for seed in range(50, 62):
        z, truth = recorded(seed, (line(),))
        lines = found_in(z)
        for kept, some in ((ratio, lines), (beside, ())):
            model = model_of(some)
            rows = prior(some).rows
            path = smooth(model, z)
            off = (path.x @ rows.T - truth)[inner]
            var = np.einsum("as,tsr,ar->ta", rows, path.P, rows)[inner]
            kept.append((off**2).mean(0))
            if kept is ratio:
                error.append((off**2 / var).mean(0))
    with_line, without = np.sqrt(np.mean(ratio, 0)), np.sqrt(np.mean(beside, 0))
    assert with_line[0] < 0.3 * without[0]
    assert (with_line[1:] < 1.1 * without[1:]).all()
    assert (np.abs(np.mean(error, 0) - 1) < 3 * np.std(error, 0) / np.sqrt(len(error)) + 0.05).all()


def test_smooth_load_is_tuned_beside_a_line_as_if_the_line_were_not_there():
    quiet, _ = recorded(70)
    wave = excite(model_of(), np.array([2j * np.pi * 20.0]))[:, :, 0, 0] @ [1.0, 0.5]
    noise, still, share = np.full(quiet.shape, NOISE**2), np.zeros(3), (line(std=1.0).along(TURN),)
    plain = tune_loads(TIME, quiet @ TURN, 1 / MASS, noise, still, orders=(3,))
    beside = tune_loads(TIME, (quiet + wave) @ TURN, 1 / MASS, noise, still, orders=(3,), lines=share)
    blind = tune_loads(TIME, (quiet + wave) @ TURN, 1 / MASS, noise, still, orders=(3,))
    off, wrong = (np.abs(np.log(t.kernel.rate / plain.kernel.rate)).max() for t in (beside, blind))
    assert off < 0.15
    assert wrong > 2 * off
