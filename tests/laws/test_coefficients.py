"""Coefficients of the air from flights: what is put in comes out, and what is not there is left out."""

import json
import tomllib
from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.drawn.records.aircraft import frisbee, glider, thrown_ball
from forceid.cli.app import main
from forceid.config import AeroSetting, load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.run import estimate_recording
from forceid.files import read_result, write_motion
from forceid.laws.choosing import choose, of_other_terms
from forceid.laws.courses import course_of
from forceid.laws.flights import fit_flights
from forceid.laws.flying import fly
from forceid.laws.law import LawSetting, law_of, law_setting
from forceid.laws.spread import band_of, orthonormal_lines
from forceid.laws.terms import term_of

BALL = {"drag": ["1", "spin"], "lift": ["1", "spin"], "side": ["1"]}


def flown(drawn, **more):
    settings = load_settings(model="rigid", **more).model_copy(update={"aero": drawn.aero})
    return estimate_recording(drawn.recording, settings)


@pytest.fixture(scope="module")
def thrown():
    """A ball, and its estimate."""
    drawn = thrown_ball(np.random.default_rng(11))
    return drawn, flown(drawn)


@pytest.mark.long
def test_a_ball_gives_back_its_drag_and_its_magnus_force(thrown):
    """Its spin hardly changes, so that a lift without spin is possible beside, at odds of one in five."""
    drawn, found = thrown
    law = fit_flights([("ball", found)], LawSetting(law=BALL), "law")
    assert law.name == ("drag.1", "lift.spin")
    assert (np.abs(law.value - [drawn.true[n] for n in law.name]) < 3 * law.std).all()
    assert (law.std < [0.02, 0.06] * np.abs(law.value)).all()
    assert law.replays[0].misfit == pytest.approx(1.0, abs=0.1)


@pytest.mark.long
def test_terms_stay_that_are_to_be_kept_or_where_none_are_chosen(thrown):
    setting = LawSetting(law=BALL, keep=("side",))
    assert "side.1" in fit_flights([("ball", thrown[1])], setting, "law").name
    assert len(fit_flights([("ball", thrown[1])], LawSetting(law=BALL, choose=False), "law").name) == 5


@pytest.mark.long
def test_flights_are_fitted_together_and_told_apart_where_they_differ():
    throws = [thrown_ball(np.random.default_rng(k)) for k in (1, 2, 3)]  # with coefficients of their own each
    aero = throws[0].aero
    terms = LawSetting(law={"drag": ("1",), "lift": ("spin",)}, choose=False, aero=aero)
    law = fit_flights([(str(k), flown(t)) for k, t in enumerate(throws)], terms, "law")
    assert law.spread.between < 1e-4
    assert "scatter" in " ".join(law.notes)
    spread = np.std([t.true["drag.1"] for t in throws])
    assert law.factor[0] * law.std[0] > 0.3 * spread
    assert 0.3 * spread < law.spread.scatter[0] < 3 * spread


def test_a_law_that_leaves_something_out_claims_less(thrown):
    few = LawSetting(law={"drag": ("1",)}, choose=False)
    law = fit_flights([("ball", thrown[1])], few, "law")
    assert law.spread.within < 1e-4
    assert law.spread.bands[0] > 100
    assert "hang together" in law.notes[0]


@pytest.mark.long
@pytest.mark.parametrize(("draw", "law"), [
    (glider, {"lift": ["1", "alpha", "q"], "drag": ["1", "alpha", "alpha^2"], "side": ["beta"],
              "roll": ["beta", "p", "r"], "pitch": ["1", "alpha", "q"], "yaw": ["beta", "p", "r"]}),
    (frisbee, {"lift": ["1", "alpha"], "drag": ["1", "alpha", "alpha^2"], "roll": ["roll_rate", "spin_rate"],
               "pitch": ["1", "alpha", "pitch_rate"], "yaw": ["spin_rate"]}),
])  # fmt: skip
def test_a_flight_under_its_own_law_is_that_of_another_integrator(draw, law):
    drawn = draw(np.random.default_rng(4))
    time = drawn.recording.motion.time
    found = flown(drawn, method="savgol")
    c = course_of(found, "flight")
    own = law_of(law_setting({"law": law}, "law"), drawn.aero, found.mean_shape, "law")
    value = np.array([drawn.true.get(n, 0.0) for n in own.names])
    start = drawn.start
    turn = Rotation.from_matrix(start[2].as_matrix() @ c.start_rotation.T).as_rotvec()
    path = fly(
        replace(c, time=time, substeps=np.full(len(time) - 1, 16), near=np.zeros(len(time) - 1, bool)),
        own,
        np.concatenate([*start[:2], turn, start[3]])[None],
        value[None],
    )
    assert np.abs(path.center[:, 0] - drawn.center).max() < 2e-6
    assert np.abs(path.rotation[:, 0] - drawn.rotation).max() < 2e-6


def test_terms_are_read_and_what_is_none_is_said():
    assert float(term_of("spline(alpha,0.1)", "x").value({"alpha": np.array(0.3)}, 0.0)) == pytest.approx(
        0.04
    )
    assert float(term_of("sin(2)*1", "x").value({}, 0.125)) == pytest.approx(1.0)
    for text in ("aplha", "alpha^x", "spline(alpha)", "tan(1)", "alpha**2", ""):
        with pytest.raises(ConfigError, match="expected factors"):
            term_of(text, "AERO.toml law.lift")


@pytest.mark.parametrize(("table", "said"), [
    ({"law": {}}, "holds no term"), ({"law": {"lfit": ["1"]}}, "unknown component 'lfit'"),
    ({"law": {"lift": ["1", "1"]}}, "twice"), ({"law": {"strip_lift": ["1"]}}, "strips"),
    ({"law": {"lift": ["1"]}, "keep": ["drag"]}, "no term of law"), ({"lwa": {"lift": ["1"]}}, "lwa"),
    ({"law": {"lift": ["1"]}, "aero": {"area": -1.0}}, "area"),
    ({"law": {"strip_lift": ["1"]}, "strips": {"area": [1.0], "position": [[0, 0, 0]] * 2}}, "1 areas for 2"),
])  # fmt: skip
def test_laws_that_cannot_be_are_one_line(thrown, table, said):
    with pytest.raises(ConfigError, match=said) as caught:
        fit_flights([("ball", thrown[1])], law_setting(table, "AERO.toml"), "AERO.toml")
    assert "\n" not in str(caught.value)


def test_a_wind_that_no_flight_measured_is_missing(thrown):
    aero = AeroSetting(area=0.004, wind="measured", axes="ball")
    with pytest.raises(DataError, match="/flown/wind holds no measured wind"):
        fit_flights([("ball", thrown[1])], LawSetting(law=BALL, aero=aero), "law")


@pytest.mark.long
def test_a_measured_wind_is_as_good_as_a_stated_one(thrown):
    drawn, _ = thrown
    stated, measured = ((4.0, -2.0, 0.5), "measured")
    wind = np.tile(stated, (len(drawn.recording.motion.time), 1))
    recording = replace(drawn.recording, motion=replace(drawn.recording.motion, wind=wind))
    two = [
        flown(replace(drawn, recording=recording, aero=drawn.aero.model_copy(update={"wind": told})))
        for told in (stated, measured)
    ]
    assert np.allclose(two[0].aero.value, two[1].aero.value, rtol=1e-9, atol=1e-12, equal_nan=True)
    terms = LawSetting(law={"lift": ("spin",), "drag": ("1",)}, choose=False)
    a, b = (fit_flights([("ball", found)], terms, "law").value for found in two)
    assert np.allclose(a, b, rtol=1e-6)


def test_evidence_takes_one_of_two_that_say_the_same():
    cov = np.array([[1.0, -0.999], [-0.999, 1.0]])
    assert len(choose(np.array([2.0, 2.0]), cov, (), 1000)) == 1


def test_bands_hold_every_line_once_and_lines_are_orthonormal():
    lines = orthonormal_lines(50)
    assert np.allclose(lines @ lines.T, np.eye(50))
    which = band_of(50)
    assert (np.diff(which) >= 0).all()
    assert (np.bincount(which) >= 4).all()
    assert (np.bincount(band_of(20)) >= 4).all()


@pytest.mark.long
def test_the_command_writes_a_model_and_flies_it_again(tmp_path, capsys):
    drawn = thrown_ball(np.random.default_rng(12))
    motion, result, config = (tmp_path / n for n in ("ball.h5", "ball.result.h5", "aero.toml"))
    write_motion(motion, drawn.recording)
    air = drawn.aero
    config.write_text(
        f'[aero]\narea = {air.area}\nspan = {air.span}\ndensity = {air.density}\naxes = "ball"\n'
    )
    assert main(["estimate", str(motion), "-c", str(config), "-o", str(result)]) == 0
    assert read_result(result).aero is not None
    law = tmp_path / "law.toml"
    law.write_text('[law]\ndrag = ["1"]\nlift = ["spin", "1"]\n')
    capsys.readouterr()
    for suffix in ("toml", "h5"):
        assert main(["coefficients", str(result), "-c", str(law), "-o", str(tmp_path / f"m.{suffix}")]) == 0
    said = capsys.readouterr().out
    assert "flown" in said
    assert "left out lift.1" in said
    model = tomllib.loads((tmp_path / "m.toml").read_text())
    assert [c["name"] for c in model["coefficient"]] == ["drag.1", "lift.spin"]
    with h5py.File(tmp_path / "m.h5") as f:
        assert f["coefficients/value"][:].tolist() == [c["value"] for c in model["coefficient"]]
        assert json.loads(f["coefficients"].attrs["fit"])["freedoms"] > 0
    assert main(["coefficients", str(motion), "-c", str(law)]) == 3
    assert main(["coefficients", str(result), "-c", str(law), "-o", str(tmp_path / "m.csv")]) == 2


def test_claims_allow_for_terms_that_are_nearly_as_likely():
    """A polynomial over a short range, its middle term none or of any size that is worth one number seen."""
    rng, a, beside, alone = np.random.default_rng(5), np.linspace(0.1, 0.25, 60), [], []
    X = np.stack([np.ones_like(a), a, a**2], 1)
    cov = 2e-3**2 * np.linalg.inv(X.T @ X)
    told = np.linalg.inv(cov)
    for k in range(400):
        middle = (k % 2) * np.sqrt(len(a) * cov[1, 1]) * rng.standard_normal()
        true = np.array([0.18, middle, 1.1])
        value = rng.multivariate_normal(true, cov)
        which = list(choose(value, cov, (0, 2), len(a)))
        own = np.linalg.inv(told[np.ix_(which, which)])
        off = (own @ (told @ value)[which] - true[which]) ** 2
        alone.append(np.mean(off / np.diag(own)))
        beside.append(np.mean(off / np.diag(own + of_other_terms(value, cov, which, (0, 2), len(a)))))
    assert np.sqrt(np.mean(alone)) > 2.0
    assert 0.8 < np.sqrt(np.mean(beside)) < 1.2
