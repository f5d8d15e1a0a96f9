"""Bodies that bend so far that their mean shape loses the rotation: it is fitted to a shape that holds it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.judged import judged_part, rms
from forceid.config import load_settings
from forceid.estimation.body.deforming.gauge import slip, well_held
from forceid.estimation.body.deforming.modes import mean_shape
from forceid.estimation.run import estimate_recording
from forceid.motion import ReadingCov, fit_rotation, log, pose
from forceid.motion.pose import fitted, frame_fit
from forceid.records import Body, Motion, Recording

RATE, FRAMES, NOISE, LINK = 150.0, 225, 3e-4, 4  # Hz, frames, m, markers on a link
STEP = 1e-3  # s, of differences of the fourth order: off by 1e-8 of the accelerations


class Linked:
    """Two links of mass points on a ball joint: both tumble, and one turns once about the other."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.of = rng.uniform(-0.05, 0.05, (2, LINK, 3)) + np.array([[[-0.15, 0, 0]], [[0.15, 0, 0]]])
        self.mass = rng.uniform(0.02, 0.1, 2 * LINK)
        self.axis, self.spin = rng.standard_normal((2, 3))
        self.axis /= np.linalg.norm(self.axis)
        self.swing, self.phase = 0.5 * rng.standard_normal(3), rng.uniform(0, 6, 3)
        self.pushed, self.pace = 0.1 * rng.standard_normal(3), rng.uniform(4, 8, 3)

    def at(self, t):
        """Places (time, node, 3) m at times (time,) s."""
        t = np.asarray(t)[:, None]
        one = Rotation.from_rotvec(self.spin * t + self.swing * np.sin(5 * t + self.phase))
        bent = Rotation.from_rotvec(2 * np.pi * np.sin(np.pi * t / t.max() / 2) ** 2 * self.axis)
        turns = one, one * bent
        x = np.concatenate(
            [np.einsum("tab,nb->tna", r.as_matrix(), X) for r, X in zip(turns, self.of, strict=True)], 1
        )
        share = self.mass / self.mass.sum()
        center = self.pushed * np.sin(self.pace * t)
        return x - np.einsum("n,tna->ta", share, x)[:, None] + center[:, None]

    def recording(self, seed):
        """The recording, with noise; truth: force and moment about the mass center, by differences."""
        t = np.arange(FRAMES) / RATE
        whole = np.append(t, t[-1] + 1)  # so that shifted times keep the pace of the fold
        x = self.at(whole)[:-1]
        weights = np.array([-1, 16, -30, 16, -1]) / (12 * STEP**2)
        moved = [self.at(np.append(t + k * STEP, whole[-1]))[:-1] for k in (-2, -1, 0, 1, 2)]
        a = np.einsum("k,ktna->tna", weights, moved)
        share = self.mass / self.mass.sum()
        rho = x - np.einsum("n,tna->ta", share, x)[:, None]
        truth = {
            "force": np.einsum("n,tna->ta", self.mass, a),
            "moment": np.einsum("n,tna->ta", self.mass, np.cross(rho, a)),
        }
        y = x + NOISE * np.random.default_rng(seed).standard_normal(x.shape)
        body = Body(
            node=tuple(f"m{k}" for k in range(2 * LINK)), position=y[0] - y[0].mean(0), mass=self.mass
        )
        motion = Motion(t, y, gravity=np.zeros(3), noise_std={"position": NOISE})
        return Recording(body, motion, truth=truth)


def turned(x, shape, mass):
    """The largest turn (rad) of the axes from one frame to the next."""
    R = fit_rotation(x, shape, mass)[1]
    return np.linalg.norm(log(R[:-1].mT @ R[1:]), axis=1).max()


def test_the_slope_of_the_slip_is_that_of_differences():
    rng = np.random.default_rng(1)
    X, m = rng.standard_normal((6, 3)), rng.uniform(1, 2, 6)
    rho = X + 0.5 * rng.standard_normal((20, 6, 3))
    m /= m.sum()
    X, rho = X - m @ X, rho - np.einsum("n,tna->ta", m, rho)[:, None]
    least, way = rng.uniform(1, 2, 20), rng.standard_normal(X.shape)
    ahead, behind = (slip(X + by * way, rho, m, least)[0] for by in (1e-5, -1e-5))
    slope = (slip(X, rho, m, least)[1] * way).sum()
    assert (ahead - behind) / 2e-5 == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_a_body_that_hardly_bends_keeps_its_mean_shape(seed):
    rng = np.random.default_rng(seed)
    X, mass = rng.uniform(-1, 1, (8, 3)), rng.uniform(1, 3, 8)
    bent = X + 0.05 * rng.standard_normal((50, 8, 3))
    assert well_held(bent, X, mass) is X


def test_frames_that_hold_no_rotation_to_the_last_digit_are_passed_over():
    X = np.concatenate([np.eye(3), -np.eye(3)])
    x = np.stack([X] * 20)
    x[7:9] *= [1, 1, -1]
    assert np.isfinite(well_held(x, X, np.ones(6))).all()


def test_axes_that_slip_are_held():
    """Of twenty drawn bodies that bend by a turn: from frame to frame, beside the faster link."""
    slipped, held = [], []
    for seed in range(20):
        linked = Linked(seed)
        x = linked.at(np.arange(FRAMES) / RATE)
        own = max(turned(x[:, part], x[0, part], np.ones(LINK)) for part in (slice(LINK), slice(LINK, None)))
        mean = mean_shape(x, x[0], linked.mass)
        slipped.append(turned(x, mean, linked.mass) / own)
        held.append(turned(x, well_held(x, mean, linked.mass), linked.mass) / own)
    assert np.max(slipped) > 10
    assert np.max(held) < 4


@pytest.mark.parametrize("seed", [14, *(pytest.param(k, marks=pytest.mark.long) for k in (4, 7, 8, 18))])
def test_the_moment_on_a_body_that_bends_by_a_turn_is_found(seed):
    """Of those of the twenty whose mean shape slips fastest."""
    recording = Linked(seed).recording(seed)
    found = estimate_recording(recording, load_settings())
    assert found.verdict.level == "ok"
    for name in ("force", "moment"):
        off = rms(judged_part(getattr(found, name) - recording.truth[name]))
        claimed = rms(judged_part(getattr(found, f"{name}_std")))
        assert off < 1.5 * claimed
        assert off < 0.02 * rms(judged_part(recording.truth[name]))


def test_fits_of_bent_frames_begin_alike_with_and_without_a_compiler(monkeypatch):
    linked = Linked(14)
    x = linked.at(np.arange(FRAMES) / RATE)
    mean = mean_shape(x, x[0], linked.mass)
    gauge = well_held(x, mean, linked.mass)
    local = np.einsum("tab,tna->tnb", fit_rotation(x, gauge, linked.mass)[1], x - x.mean(1, keepdims=True))
    shape = local.mean(0)
    u, s, _ = np.linalg.svd((local - shape).reshape(FRAMES, -1).T, full_matrices=False)
    bent = u * s / np.sqrt(FRAMES)
    cov = ReadingCov.of(NOISE**2 * np.eye(len(u)) + bent @ bent.T)
    fit = frame_fit(shape, linked.mass, np.ones(2 * LINK, bool), cov, begin=gauge)
    one = fitted(fit, x, np.arange(FRAMES))
    monkeypatch.setattr(pose, "compiled", None)
    other = fitted(fit, x, np.arange(FRAMES))
    for ours, plain in zip(one[:2], other[:2], strict=True):
        np.testing.assert_allclose(ours, plain, atol=1e-6)
    assert np.linalg.norm(log(one[1][:-1].mT @ one[1][1:]), axis=1).max() < 0.5  # rad: none begins beside
