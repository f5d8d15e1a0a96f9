"""Laws of the ground: stiffness, damping, friction and resistance to rolling come back from motions."""

import json
import tomllib
from dataclasses import replace

import h5py
import numpy as np
import pytest
import tomli_w

from evidence.drawn.records.contacts import Ball, G, drawn_ball, drawn_block
from forceid.cli.app import main
from forceid.config import load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.run import estimate_recording
from forceid.files import write_motion
from forceid.laws.bounces import by_bounces, near
from forceid.laws.courses import course_of
from forceid.laws.flights import fit_flights
from forceid.laws.flying import fly
from forceid.laws.ground import GroundSetting, ground_of
from forceid.laws.law import law_of, law_setting

UP = np.array([0.0, 0.0, 1.0])
SPRING = {"contact": ["depth", "depth_rate"]}


def estimated(drawn, method="smoother"):
    return estimate_recording(drawn.recording, load_settings(model="rigid", method=method))


def found(estimate, drawn, law, **more):
    return fit_flights(
        [("m", estimate)], law_setting({"law": law, "ground": drawn.ground, **more}, "law"), "law"
    )


@pytest.fixture(scope="module")
def block():
    """A block on four mounts, and its estimate."""
    drawn = drawn_block(np.random.default_rng([2302, 0]))
    return drawn, estimated(drawn)


@pytest.mark.long
def test_a_block_gives_back_the_stiffness_and_damping_of_its_mounts(block):
    drawn, estimate = block
    law = found(estimate, drawn, SPRING)
    true = [drawn.true[n] for n in law.name]
    assert set(law.name) == set(drawn.true)
    assert (np.abs(law.value - true) < 4 * law.std).all()
    assert law.replays[0].misfit == pytest.approx(1.0, abs=0.1)


@pytest.mark.long
def test_terms_of_a_contact_that_are_not_there_are_left_out(block):
    drawn, estimate = block
    law = found(estimate, drawn, {"contact": ["depth", "depth_rate", "depth^2"]})
    assert set(law.name) == set(drawn.true)


@pytest.mark.long
def test_a_law_of_the_ground_goes_through_the_command_line_into_toml_and_hdf5(block, tmp_path, monkeypatch):
    drawn, _ = block
    monkeypatch.chdir(tmp_path)
    write_motion(tmp_path / "block.h5", drawn.recording)
    (tmp_path / "law.toml").write_text(
        tomli_w.dumps({"law": SPRING, "ground": drawn.ground, "keep": ["contact"]})
    )
    assert main(["-q", "estimate", "block.h5"]) == 0
    for model in ("model.toml", "model.h5"):
        assert main(["-q", "coefficients", "block.result.h5", "-c", "law.toml", "-o", model]) == 0
    table = tomllib.loads((tmp_path / "model.toml").read_text())
    with h5py.File(tmp_path / "model.h5") as groups:
        values = groups["coefficients/value"][:]
        assert json.loads(groups["coefficients"].attrs["ground"])["glued"]
    assert np.allclose(values, [one["value"] for one in table["coefficient"]], rtol=1e-12)
    assert values[0] == pytest.approx(drawn.true["contact.depth"], rel=0.01)


@pytest.mark.long
@pytest.mark.parametrize("k", [0, 1, 2])
def test_a_bounce_gives_back_stiffness_damping_and_friction(k):
    drawn = drawn_ball(np.random.default_rng([2303, k]), rolls=False)
    terms = {}
    for component, term in (n.split(".", 1) for n in drawn.true if n != "contact.height"):
        terms.setdefault(component, []).append(term)
    law = found(estimated(drawn), drawn, terms)
    assert (np.abs(law.value - [drawn.true[n] for n in law.name]) < 4 * law.std).all()


@pytest.mark.long
def test_a_ball_that_ends_up_rolling_gives_back_friction_and_resistance_on_a_hard_ground():
    drawn = drawn_ball(np.random.default_rng([2304, 0]), rolls=True)
    law = found(estimated(drawn), drawn, {"friction": ["1"], "rolling": ["1"]})
    assert law.name == ("friction.1", "rolling.1")
    assert (np.abs(law.value - [drawn.true[n] for n in law.name]) < 4 * law.std).all()


@pytest.mark.parametrize("rolls", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_motion_on_the_ground_is_that_of_another_integrator_and_comes_nearer_with_the_square_of_the_step(
    rolls,
):
    drawn = drawn_ball(np.random.default_rng([2305, 1]), rolls)
    told = (
        drawn.ground
        if rolls
        else {**drawn.ground, "height": drawn.true.get("contact.height", drawn.ground.get("height"))}
    )
    terms = {}
    for component, term in (n.split(".", 1) for n in drawn.true if n != "contact.height"):
        if not (rolls and component == "contact"):
            terms.setdefault(component, []).append(term)
    estimate = estimated(drawn, "savgol")
    law = law_of(law_setting({"law": terms, "ground": told}, "law"), None, estimate.mean_shape, "law")
    value = np.array([[drawn.true[n] for n in law.names]])
    course = course_of(estimate, "m")
    course = replace(course, near=near(course, law.ground, told.get("height", 0.0)))
    course = by_bounces(course)[0]
    ends = [
        fly(replace(course, substeps=np.where(course.near, n, 1)), law, course.start[None], value)
        for n in (4, 8, 16, 64)
    ]
    off = [np.abs(e.center - ends[-1].center).max() for e in ends[:-1]]
    assert off[2] < 2e-5
    assert off[2] < off[0] / 4


@pytest.mark.long
def test_a_ball_slides_and_then_rolls_as_closed_forms_say():
    m, r, mu, c = 0.3, 0.05, 0.2, 0.01
    J, v0, h = 0.4 * m * r**2, 3.0, 1e-3
    ball = Ball(m, r, J, lambda d, s: m * G, mu, 0.0, -G * UP)
    still = np.concatenate([[0, 0, r - 1e-6], [v0, 0, 0], [0, 0, 0, 1], np.zeros(3)])
    time = np.arange(1200) * h
    slides = 2 * v0 / (7 * mu * G)
    y = ball.path(still, time)
    assert y[-1, 3] == pytest.approx(5 / 7 * v0, rel=1e-6)
    assert y[int(0.5 * slides / h), 3] == pytest.approx(v0 - mu * G * int(0.5 * slides / h) * h, rel=1e-9)
    again = replace(ball, rolling=c).path(still, time)
    slows = c * G / (1 + J / (m * r**2))
    assert (again[-1, 3] - again[-201, 3]) / (200 * h) == pytest.approx(-slows, rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize(("table", "error", "said"), [
    ({"law": SPRING}, ConfigError, "'ground' is missing"),
    ({"law": SPRING, "ground": {}}, ConfigError, "points, or the radius"),
    ({"law": SPRING, "ground": {"radius": 0.1, "normal": [0, 0, 0]}}, ConfigError, "normal is zero"),
    ({"law": {"rolling": ["1"]}, "ground": {"points": [[0, 0, 0]]}}, ConfigError, "ground.radius' is"),
    ({"law": {"friction": ["1"]}, "ground": {"radius": 0.1, "glued": True}}, ConfigError, "glued"),
    ({"law": {"contact": ["alpha"]}, "ground": {"radius": 0.1}}, ConfigError, "expected factors of depth"),
    ({"law": SPRING, "ground": {"radius": 0.1, "height": -9.0}}, DataError, "never comes to the ground"),
])  # fmt: skip
def test_grounds_that_cannot_be_are_one_line(block, table, error, said):
    with pytest.raises(error, match=said) as caught:
        fit_flights([("m", block[1])], law_setting(table, "LAW.toml"), "LAW.toml")
    assert "\n" not in str(caught.value)


def test_a_ground_holds_no_more_than_friction_allows():
    below = ground_of(GroundSetting(radius=0.1), {"friction"})
    assert below.kind == "hard"
    assert ground_of(GroundSetting(radius=0.1), {"contact"}).kind == "soft"
    assert ground_of(GroundSetting(radius=0.1, glued=True), {"contact"}).kind == "glued"
