"""Very long recordings, a stretch at a time: what comes out is what the whole says, without seams."""

from dataclasses import fields, is_dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from forceid import __version__, records
from forceid.config import load_settings
from forceid.estimation.long import windows as stretches
from forceid.estimation.long.joined import RECORDS, between_edges
from forceid.estimation.long.windows import estimate_of_any_length
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Estimate, Impulses, Motion, Recording


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(stretches, "LONG", 270)
    monkeypatch.setattr(stretches, "MARGIN", 60)


def flight(frames=400, lost=None):
    """A mass center under a slow force, the body without turning."""
    rng, t = np.random.default_rng(0), np.arange(frames) / 100
    center = np.stack([np.sin(t), t, -4.905 * t**2], 1) + 1e-4 * rng.standard_normal((frames, 3))
    orientation = np.concatenate([1e-4 * rng.standard_normal((frames, 3)), np.ones((frames, 1))], 1)
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    if lost:
        center[lost], orientation[lost] = np.nan, np.nan
    body = Body(total_mass=2.0, mass_center=np.zeros(3), inertia=np.diag([0.1, 0.2, 0.25]))
    noise = {"center": 1e-4, "orientation": 1e-4}
    gravity = np.array([0.0, 0.0, -9.81])
    return Recording(
        body, Motion(t, center=center, orientation=orientation, gravity=gravity, noise_std=noise)
    )


def test_a_short_recording_is_estimated_at_once():
    recording, settings = flight(120), load_settings(method="difference")
    assert np.array_equal(
        estimate_of_any_length(recording, settings).force, estimate_recording(recording, settings).force
    )


@pytest.mark.long
def test_joined_stretches_hold_what_they_claim_at_the_seams_too():
    recording, settings = flight(), load_settings(lines="none")
    whole, pieces = estimate_recording(recording, settings), estimate_of_any_length(recording, settings)
    for name, value in vars(whole).items():
        if isinstance(value, np.ndarray):
            assert getattr(pieces, name).shape == value.shape
    assert np.array_equal(pieces.time, whole.time)
    truth = np.stack([-2 * np.sin(whole.time), 0 * whole.time, 0 * whole.time], 1)
    score = ((pieces.force - truth) / pieces.force_std)[30:-30]
    assert np.sqrt((score**2).mean(0)).max() < 1.5
    assert np.abs(score[80:290]).max() < 4.0  # the seams lie in there
    assert pieces.log_likelihood > whole.log_likelihood  # margins count twice
    assert pieces.verdict.level in ("ok", "degraded")


def test_a_stretch_that_shows_nothing_is_unknown_and_the_others_stay():
    settings = load_settings(method="difference")
    found = estimate_of_any_length(flight(lost=slice(140, 400)), settings)
    assert np.isfinite(found.force[20:100]).all()
    assert np.isnan(found.force[270:]).all()
    assert found.verdict.level == "degraded"
    assert any(reason.startswith("from ") for reason in found.verdict.reasons)
    nothing = flight(lost=slice(0, 400))
    assert estimate_of_any_length(nothing, settings).verdict.level == "refused"


def test_a_reason_of_several_stretches_is_told_once():
    found = estimate_of_any_length(flight(), load_settings(method="difference", noise_std={"center": 1e-3}))
    masked = [reason.split(", ", 1)[1] for reason in found.verdict.reasons]
    assert len(masked) == len(set(masked))
    assert any("more of 3 stretches" in reason for reason in found.verdict.reasons)


def test_an_estimate_that_was_stopped_goes_on_from_its_stretches_to_the_same_bits(tmp_path, monkeypatch):
    recording, settings = replace(flight(), sha256="a"), load_settings(method="difference")
    at_once = estimate_of_any_length(recording, settings)
    calls = []

    def stopped(part, settings):
        calls.append(part.motion.time[0])
        if len(calls) == 2:
            raise KeyboardInterrupt
        return estimate_recording(part, settings)

    monkeypatch.setattr(stretches, "estimate_recording", stopped)
    with pytest.raises(KeyboardInterrupt):
        estimate_of_any_length(recording, settings, tmp_path)
    later = estimate_of_any_length(recording, settings, tmp_path)
    assert calls[2] == calls[1]  # the stretch that was not finished
    assert len(calls) == 4
    assert later.verdict == at_once.verdict
    assert later.tuned == at_once.tuned
    for name, value in vars(at_once).items():
        if isinstance(value, np.ndarray):
            assert np.array_equal(getattr(later, name), value, equal_nan=True), name


@pytest.mark.parametrize(
    "other",
    [{"sha256": "b"}, {"settings": load_settings(method="savgol")}, {"version": "another"}, {"torn": True}],
    ids=lambda other: next(iter(other)),
)
def test_stretches_of_another_input_settings_or_version_are_not_used(tmp_path, monkeypatch, other):
    recording, settings = replace(flight(), sha256="a"), load_settings(method="difference")
    estimate_of_any_length(recording, settings, tmp_path)
    assert len(list(tmp_path.iterdir())) == 3
    calls = []

    def counted(part, settings):
        calls.append(part)
        return estimate_recording(part, settings)

    monkeypatch.setattr(stretches, "estimate_recording", counted)
    estimate_of_any_length(recording, settings, tmp_path)
    assert not calls
    monkeypatch.setattr(stretches, "__version__", other.get("version", __version__))
    for path in tmp_path.iterdir():
        path.write_bytes(b"torn" if "torn" in other else path.read_bytes())
    asked = replace(recording, sha256=other.get("sha256", "a")), other.get("settings", settings)
    estimate_of_any_length(*asked, tmp_path)
    assert len(calls) == 3


def test_forces_on_modes_that_the_file_names_go_through_all_stretches():
    rng, t = np.random.default_rng(1), np.arange(400) / 100
    place = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    bend = np.zeros((6, 3))
    bend[:2, 2], bend[2:4, 2] = 1.0, -1.0
    names = tuple(f"n{k}" for k in range(6))
    body = Body(names, place, np.full(6, 0.1), mode_shape=bend[None], mode_frequency=np.array([5.0]))
    x = place + 0.01 * np.sin(9 * t)[:, None, None] * bend + 1e-4 * rng.standard_normal((400, 6, 3))
    found = estimate_of_any_length(
        Recording(body, Motion(t, x, noise_std={"position": 1e-4})),
        load_settings(lines="none", model="modal"),
    )
    assert found.modal is not None
    assert found.modal.force.shape == (400, 1)
    assert np.isfinite(found.modal.force).all()


def test_impulses_are_those_between_edges_that_a_stretch_shows_each_once():
    def stretch(first, last, edges):
        edges = np.array(edges, float)
        count = len(edges) - 1
        found = Impulses(edges[:-1], edges[1:], np.arange(6 * count).reshape(-1, 6), np.zeros((count, 6, 6)))
        return SimpleNamespace(time=np.arange(first, last), impulses=found)

    parts = [stretch(0, 100, [0, 40, 90, 110, 150]), stretch(100, 200, [50, 90, 110, 250]),
             SimpleNamespace(time=np.arange(200, 300), impulses=None),
             stretch(300, 400, [250, 320, 400])]  # fmt: skip
    found = between_edges(parts)
    assert found.start.tolist() == [0, 40, 90, 320]
    assert found.stop.tolist() == [40, 90, 110, 400]
    assert between_edges(parts[2:3]) is None


def test_every_record_of_an_estimate_is_joined():
    whole = {
        "verdict",
        "hidden",
        "impulses",
        "interface",
    }  # joined in ways of their own, or of bodies that go at once
    kinds = {
        f.name for f in fields(Estimate) if is_dataclass(getattr(records, str(f.type).split(" ")[0], None))
    }
    assert kinds == whole | {*RECORDS}
