"""Scenes of another simulator: the truth is what acted, and silently wrong is what the page says it is."""

from dataclasses import replace

import numpy as np
import pytest

from evidence.strangers.beside_peers import OURS, Met, over_best
from evidence.strangers.bodies import Solid, flung, world
from evidence.strangers.outcome import StrangerOutcome, counted
from evidence.strangers.rigid import satellite
from evidence.strangers.simulated import WATCHED_BODY, Camera, Scene, recorded

CAMERA = Camera(rate=200.0, samples=60, noise=0.0, stated=False, lost=0.0)
PUSH, TWIST = np.array([1.0, -2.0, 0.5]), np.array([0.01, 0.02, -0.03])


@pytest.fixture
def rng():
    pytest.importorskip("mujoco")
    return np.random.default_rng(7)


def test_the_truth_is_what_acted_without_the_weight(rng):
    body = Solid.drawn(rng, np.array([0.1, 0.15, 0.2]), 1.3)

    def drive(data):
        data.xfrc_applied[WATCHED_BODY] = np.concatenate([PUSH, TWIST])

    start = flung(rng, 3.0, np.array([2.0, -4.0, 3.0]))
    made = recorded(Scene(world(body.inertial + body.sites(rng, face=0.0)), start, drive), CAMERA, rng)
    told = made.body
    assert np.allclose(made.truth["force"], PUSH, atol=1e-6)
    assert np.allclose(made.truth["moment"], TWIST, atol=1e-6)
    assert told.total_mass == pytest.approx(body.mass)
    assert np.allclose(told.mass_center, body.center)
    assert np.allclose(told.inertia, body.inertia)
    # what the markers show obeys the same force
    path = np.stack([center_of(x, told) for x in made.motion.position])
    bent = path[2:] - 2 * path[1:-1] + path[:-2]
    assert np.allclose(
        bent * 200.0**2 * told.total_mass, PUSH + told.total_mass * made.motion.gravity, atol=1e-4
    )


def center_of(x, body):
    """Mass center of a rigid body by an affine map of its markers."""
    A = np.column_stack([body.position, np.ones(len(x))])
    return np.append(body.mass_center, 1.0) @ np.linalg.lstsq(A, x, rcond=None)[0]


def test_of_a_wheel_only_what_spins_it_up_counts(rng):
    scene = satellite(rng, CAMERA)

    def spin_up(data):
        data.qfrc_applied[-1] = 0.3

    still = recorded(replace(scene, drive=lambda data: None), CAMERA, rng).truth
    driven = recorded(replace(scene, drive=spin_up), CAMERA, rng).truth
    # a wheel that coasts changes its rate as the body around it does, if little
    assert np.linalg.norm(still["moment"], axis=1).max() < 0.05
    assert np.linalg.norm(driven["moment"], axis=1) == pytest.approx(0.3, rel=0.2)
    assert max(np.abs(still["force"]).max(), np.abs(driven["force"]).max()) < 1e-5


def test_only_an_ok_off_by_more_than_two_claims_or_witnesses_is_silent():
    def made(verdict, *over):
        return StrangerOutcome("box", 1, verdict, (), over)

    all_of_them = [
        made("ok", 1.9, 1.0), made("ok", 1.0, 2.1), made("ok", np.nan, 0.5), made("degraded", 1.4, 0.1),
        made("degraded", 3.5, 0.2), made("degraded", 2.0, 0.2), made("refused"), made("crashed"),
    ]  # fmt: skip
    assert [j.silent for j in all_of_them] == [False, True] + 6 * [False]
    assert replace(made("ok", 1.0, 1.0), beside=(0.5, 2.1)).silent
    # records, ok and right, degraded within 1.5 and beyond 3, silent, refused or crashed
    known = [replace(j, over=j.over or (np.nan, np.nan)) for j in all_of_them]
    assert counted("box", known)[1:7] == [*"821112"]
    several = [*known[:-1], replace(known[-1], kind="ball")]
    assert counted("all", several)[1:7] == [*"8211", "1/8 (0.3–52.7 %)", "2"]


def test_the_best_peer_is_that_of_least_geometric_mean_by_load():
    of = [
        Met("box", {OURS: (1.0, 3.0), "a": (2.0, np.nan), "b": (4.0, 1.0)}),
        Met("box", {OURS: (4.0, 3.0), "a": (8.0, 1.0), "b": (1.0, 9.0)}),
    ]
    # 2 over b's 2, and 3 over b's 3: a has no moment in one
    assert over_best(of) == [(pytest.approx(1.0), "b"), (pytest.approx(1.0), "b")]
