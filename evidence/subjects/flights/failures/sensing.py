"""Failures of what is seen and when: spin, markers on a line, few or lost markers, gaps, clocks, clipping."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.stress.failure import failure
from evidence.subjects.flights.bodies import INERTIA, INERTIA_INVERSE, MASS, PLACE, Setup, fly
from evidence.subjects.flights.failures.record import Faulty, measured, unseen
from forceid.records import Body, Motion


@failure("sensing", "Spin per frame", "degrees", (4, 30, 90, 130, 160, 175, 185, 240))
def spin_per_frame(level: float, rng: np.random.Generator) -> Faulty:
    """Past half a turn a frame the sense and number of turns are lost."""
    return measured(Setup(frames=160, spin=level / 360 * 200, wobble=0.2), rng)


@failure("sensing", "Markers on a line", "width / length", (1, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 0))
def collinear(level: float, rng: np.random.Generator) -> Faulty:
    """The turn about the line moves no marker."""
    return measured(Setup(), rng, place=PLACE * [1.0, level, level])


@failure("sensing", "Few markers", "markers", (8, 7, 6, 5, 4, 3, 2, 1))
def few_markers(level: float, rng: np.random.Generator) -> Faulty:
    """Two markers do not show the turn about their line, one shows none."""
    return measured(Setup(), rng, place=PLACE[: int(level)])


@failure("sensing", "Frames lost", "share", (0, 0.1, 0.3, 0.5, 0.7, 0.85, 0.93, 0.97))
def frames_lost(level: float, rng: np.random.Generator) -> Faulty:
    """Fewer samples than the load has changes."""
    case = measured(Setup(), rng)
    return unseen(case, np.repeat(rng.random((len(case.seen), 1)) < level, case.seen.shape[1], 1))


@failure("sensing", "Markers lost", "share", (0, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.96))
def markers_lost(level: float, rng: np.random.Generator) -> Faulty:
    """Frames with fewer than three markers show no pose."""
    case = measured(Setup(), rng)
    return unseen(case, rng.random(case.seen.shape) < level)


@failure("sensing", "Long gap", "frames of 240", (0, 4, 10, 20, 40, 80, 140, 200))
def long_gap(level: float, rng: np.random.Generator) -> Faulty:
    """Nothing is seen for longer than the load remembers."""
    case = measured(Setup(), rng)
    lost = np.zeros_like(case.seen)
    first = (len(lost) - int(level)) // 2
    lost[first : first + int(level)] = True
    return unseen(case, lost)


@failure("clock", "Jitter not stated", "share of a step", (1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 0.6, 0.95))
def jitter(level: float, rng: np.random.Generator) -> Faulty:
    """A late frame is off by speed times delay, all markers alike."""
    setup = Setup(speed=2.0)
    regular = np.arange(setup.frames) / setup.rate
    late = level / setup.rate * np.random.default_rng(int(rng.integers(2**32))).random(setup.frames)
    return retimed(measured(setup, rng, time=regular + late), regular)


@failure("clock", "Slow clock", "share", (0, 1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3))
def slow_clock(level: float, rng: np.random.Generator) -> Faulty:
    """Accelerations scale with the square of the clock, and weight does not cancel."""
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


@failure("clock", "Sample rate", "Hz", (400, 200, 100, 50, 25, 12, 8, 5))
def sample_rate(level: float, rng: np.random.Generator) -> Faulty:
    """The load changes from one frame to the next."""
    return measured(Setup(frames=120, rate=level, spin=0.2, wobble=0.3, gravity=0.0), rng)


@failure(
    "length", "Long record", "frames", (300, 600, 1000, 3000, 6000, 10000, 30000, 100000),
    name="long_record", breaks="rounding adds up, and the prior is tuned on a part of the record",
)  # fmt: skip
@failure("clock", "Short record", "frames", (480, 240, 120, 60, 40, 30, 20, 12))
def short_record(level: float, rng: np.random.Generator) -> Faulty:
    """Too few frames to tell noise from load."""
    return measured(Setup(frames=int(level), gravity=0.0, hovers=True), rng)


@failure("sensing", "Clipping", "share of frames", (0, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.9))
def clipping(level: float, rng: np.random.Generator) -> Faulty:
    """A track at the edge of its volume stands still."""
    case = measured(Setup(), rng)
    x = case.recording.motion.position
    assert x is not None
    edge = np.quantile(x[..., 0].max(1), 1 - level)
    return case.with_position(np.concatenate([np.minimum(x[..., :1], edge), x[..., 1:]], -1))


@failure("sensing", "Sensors alone, bias", "m/s2", (0, 0.01, 0.03, 0.1, 0.3, 1, 3, 10))
def sensors_alone(level: float, rng: np.random.Generator) -> Faulty:
    """A bias that all accelerometers share is a force that turns with the body."""
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
