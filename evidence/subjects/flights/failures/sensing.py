"""Failures of what is seen and when: spin, markers on a line, few or lost markers, gaps, clocks, clipping."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.stress.failure import Failure
from evidence.subjects.flights.bodies import INERTIA, INERTIA_INVERSE, MASS, PLACE, Setup, fly
from evidence.subjects.flights.failures.record import Faulty, measured, unseen
from forceid.records import Body, Motion


def fast_spin(level: float, rng: np.random.Generator) -> Faulty:
    """Degrees turned per frame."""
    return measured(Setup(frames=160, spin=level / 360 * 200, wobble=0.2), rng)


def on_a_line(level: float, rng: np.random.Generator) -> Faulty:
    """Width of the marker set over its length."""
    return measured(Setup(), rng, place=PLACE * [1.0, level, level])


def few_markers(level: float, rng: np.random.Generator) -> Faulty:
    """Number of markers, on a body known as a whole."""
    return measured(Setup(), rng, place=PLACE[: int(level)])


def frames_lost(level: float, rng: np.random.Generator) -> Faulty:
    """Share of frames in which nothing is seen."""
    case = measured(Setup(), rng)
    return unseen(case, np.repeat(rng.random((len(case.seen), 1)) < level, case.seen.shape[1], 1))


def markers_lost(level: float, rng: np.random.Generator) -> Faulty:
    """Share of marker samples lost, each by itself."""
    case = measured(Setup(), rng)
    return unseen(case, rng.random(case.seen.shape) < level)


def long_gap(level: float, rng: np.random.Generator) -> Faulty:
    """One gap of so many frames in the middle of 240."""
    case = measured(Setup(), rng)
    lost = np.zeros_like(case.seen)
    first = (len(lost) - int(level)) // 2
    lost[first : first + int(level)] = True
    return unseen(case, lost)


def jittered(level: float, rng: np.random.Generator) -> Faulty:
    """Frames come late by up to this share of a step, and the file does not say so."""
    setup = Setup(speed=2.0)
    regular = np.arange(setup.frames) / setup.rate
    late = level / setup.rate * np.random.default_rng(int(rng.integers(2**32))).random(setup.frames)
    return retimed(measured(setup, rng, time=regular + late), regular)


def slow_clock(level: float, rng: np.random.Generator) -> Faulty:
    """The clock of the file is slow by this share."""
    setup = Setup()
    regular = np.arange(setup.frames) / setup.rate
    case = retimed(measured(setup, rng, time=regular * (1 + level)), regular)
    return replace(case, misstated=("clock", 100 * level))


def retimed(case: Faulty, time: np.ndarray) -> Faulty:
    """The case with the times that the file claims."""
    recording = case.recording
    truth = recording.truth | {"time": time}
    return replace(
        case, recording=replace(recording, motion=replace(recording.motion, time=time), truth=truth)
    )


def coarse_sampling(level: float, rng: np.random.Generator) -> Faulty:
    """Frames a second, under a load whose own time is a twentieth of a second."""
    return measured(Setup(frames=120, rate=level, spin=0.2, wobble=0.3, gravity=0.0), rng)


def record_length(level: float, rng: np.random.Generator) -> Faulty:
    """Number of frames."""
    return measured(Setup(frames=int(level), gravity=0.0, hovers=True), rng)


def clipped(level: float, rng: np.random.Generator) -> Faulty:
    """Share of the frames in which the tracks stick to the edge of the volume."""
    case = measured(Setup(), rng)
    x = case.recording.motion.position
    assert x is not None
    edge = np.quantile(x[..., 0].max(1), 1 - level)
    return case.with_position(np.concatenate([np.minimum(x[..., :1], edge), x[..., 1:]], -1))


def sensors_alone(level: float, rng: np.random.Generator) -> Faulty:
    """Bias (m/s2) of two accelerometers, with two gyros and no marker; loads along the first body axes."""
    flight = fly(Setup(), rng)
    place = np.array([[0.04, 0.01, 0.01], [-0.03, 0.02, -0.02]])
    turn = Rotation.from_matrix(flight.rotation)
    names = ("angular_velocity", "moment", "force")
    w, T, f = (turn.inv().apply(flight.truth[name]) for name in names)
    rate = (T - np.cross(w, w @ INERTIA)) @ INERTIA_INVERSE
    read = [f / MASS.sum() + np.cross(rate, r) + np.cross(w, np.cross(w, r)) for r in place]
    force = np.stack(read, 1) + level * np.array([0.6, -0.5, 0.6]) + 0.1 * rng.standard_normal((len(w), 2, 3))
    gyro = np.repeat(w[:, None], 2, 1) + 0.02 * rng.standard_normal((len(w), 2, 3))
    body = Body(
        total_mass=float(MASS.sum()), mass_center=np.zeros(3), inertia=INERTIA, sensor_position=place,
        sensor_rotation=np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)),
    )  # fmt: skip
    noise = {"angular_velocity": 0.02, "specific_force": 0.1}
    motion = Motion(
        flight.time, specific_force=force, angular_velocity=gyro, gravity=flight.gravity, noise_std=noise
    )
    first = turn[0].inv()
    truth = flight.truth | {name: first.apply(flight.truth[name]) for name in ("force", "moment")}
    case = measured(Setup(), rng)
    return replace(
        case, flight=flight, recording=replace(case.recording, body=body, motion=motion, truth=truth),
        seen=np.zeros_like(case.seen),
    )  # fmt: skip


FAILURES = (
    Failure(
        "spin_per_frame", "sensing", "Spin per frame", "degrees", (4, 30, 90, 130, 160, 175, 185, 240),
        "past half a turn a frame the sense and number of turns are lost", fast_spin,
    ),
    Failure(
        "collinear", "sensing", "Markers on a line", "width / length",
        (1, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 0),
        "the turn about the line moves no marker", on_a_line,
    ),
    Failure(
        "few_markers", "sensing", "Few markers", "markers", (8, 7, 6, 5, 4, 3, 2, 1),
        "two markers do not show the turn about their line, one shows none", few_markers,
    ),
    Failure(
        "frames_lost", "sensing", "Frames lost", "share", (0, 0.1, 0.3, 0.5, 0.7, 0.85, 0.93, 0.97),
        "fewer samples than the load has changes", frames_lost,
    ),
    Failure(
        "markers_lost", "sensing", "Markers lost", "share", (0, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.96),
        "frames with fewer than three markers show no pose", markers_lost,
    ),
    Failure(
        "long_gap", "sensing", "Long gap", "frames of 240", (0, 4, 10, 20, 40, 80, 140, 200),
        "nothing is seen for longer than the load remembers", long_gap,
    ),
    Failure(
        "jitter", "clock", "Jitter not stated", "share of a step",
        (1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 0.6, 0.95),
        "a late frame is off by speed times delay, all markers alike", jittered,
    ),
    Failure(
        "slow_clock", "clock", "Slow clock", "share", (0, 1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3),
        "accelerations scale with the square of the clock, and weight does not cancel", slow_clock,
    ),
    Failure(
        "sample_rate", "clock", "Sample rate", "Hz", (400, 200, 100, 50, 25, 12, 8, 5),
        "the load changes from one frame to the next", coarse_sampling,
    ),
    Failure(
        "short_record", "clock", "Short record", "frames", (480, 240, 120, 60, 40, 30, 20, 12),
        "too few frames to tell noise from load", record_length,
    ),
    Failure(
        "clipping", "sensing", "Clipping", "share of frames", (0, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.9),
        "a track at the edge of its volume stands still", clipped,
    ),
    Failure(
        "sensors_alone", "sensing", "Sensors alone, bias", "m/s2", (0, 0.01, 0.03, 0.1, 0.3, 1, 3, 10),
        "a bias that all accelerometers share is a force that turns with the body", sensors_alone,
    ),
)  # fmt: skip
