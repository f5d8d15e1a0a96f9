"""What shows one load of a flight: a body that tumbles, and errors that link mass center and rotation."""

from dataclasses import replace

import numpy as np
import pytest
from flight.flights import flight_of, prior
from scipy.spatial.transform import Rotation

from forceid.estimation.loads.lines import more_lines
from forceid.estimation.loads.one_load import OneLoad, errors_link
from forceid.flight.path.reference import Reference
from forceid.flight.smoother import smooth_flight
from forceid.kalman.building.line_candidates import line_candidates
from forceid.kalman.engines import engine

COUNT, STEP, AT = 800, 0.005, 20.0
TIME = STEP * np.arange(COUNT)
STILL = np.zeros((COUNT, 3)), np.tile(np.eye(3), (COUNT, 1, 1))


@pytest.mark.parametrize("seed", range(4))
def test_a_line_stands_at_its_own_frequency_in_what_a_slender_body_on_a_cone_makes_of_it(seed):
    """It answers a moment along z about its own axis, which goes round z: in x and y at other frequencies."""
    rng = np.random.default_rng(seed)
    about_z = Rotation.from_rotvec(np.outer(2 * np.pi * 3.0 * TIME, [0, 0, 1]))
    R = (about_z * Rotation.from_rotvec([0.0, -0.17, 0.0])).as_matrix()  # its own axis x, 10 degrees off x, y
    flight = replace(flight_of(TIME, *STILL), inertia=np.tile(np.diag([1e-6, 1e-3, 1e-3]), (COUNT, 1, 1)))
    flight = replace(flight, pose_cov=np.tile(np.eye(6), (COUNT, 1, 1)))
    along = R[:, :, 0]
    wave = 3.0 * along * (along[:, 2] * np.cos(2 * np.pi * AT * TIME))[:, None]
    moment = prior(std=1.0, rate=1.0)
    load = OneLoad("moment", flight, Reference(R, np.zeros((COUNT, moment.states)), moment), linked=False)
    told = load.told(wave + rng.standard_normal((COUNT, 3)))
    seen, pushed = (line_candidates(TIME, look, 0.0)[0].frequency for look in (told[:, :3], told[:, 3:]))
    assert abs(seen - AT) > 1.0
    assert pushed == pytest.approx(AT, abs=0.5 / TIME[-1])


def recorded(seed, correlation):
    """A body at rest but for a moment about y at AT; errors of center and rotation go together."""
    rng = np.random.default_rng(seed)
    flight = flight_of(TIME, *STILL)
    cov = flight.pose_cov[0].copy()
    std = np.sqrt(np.diag(cov))
    cov[:3, 3:] = np.diag(correlation * std[:3] * std[3:])
    cov[3:, :3] = cov[:3, 3:].T
    noise = rng.multivariate_normal(np.zeros(6), cov, COUNT)
    swing = np.outer(0.2 * std[4] * np.cos(2 * np.pi * AT * TIME), [0.0, 1.0, 0.0])
    turned = Rotation.from_rotvec(noise[:, 3:] + swing).as_matrix()
    return replace(flight, center=noise[:, :3], rotation=turned, pose_cov=np.tile(cov, (COUNT, 1, 1)),
                   gravity=np.zeros(3))  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_a_line_is_found_through_what_the_center_tells_of_the_errors_of_the_rotation(seed):
    priors = {"force": prior(std=1e-4, rate=1.0), "moment": prior(std=1e-6, rate=1.0)}
    for correlation, linked in ((0.99, True), (0.0, False)):
        flight = recorded(seed, correlation)
        state = smooth_flight(flight, priors["force"], priors["moment"], engine())
        lines = more_lines(flight, state, priors, engine())
        assert errors_link(flight) is linked
        assert lines is not None
        assert not lines.force
        assert [line.direction.tolist() for line in lines.moment] == linked * [[0.0, 1.0, 0.0]]
        assert all(line.frequency == pytest.approx(AT, abs=0.2 / TIME[-1]) for line in lines.moment)


def test_errors_that_are_one_and_the_same_or_none_are_looked_at_as_well():
    """Such a covariance has no root by Cholesky's recursion, or one of zeros."""
    flight, innovation = recorded(0, 1.0), np.random.default_rng(1).standard_normal((COUNT, 6))
    assert errors_link(flight)
    moment = prior(std=1.0, rate=1.0)
    about = Reference(flight.rotation, np.zeros((COUNT, moment.states)), moment)
    for cov, linked in ((flight.pose_cov, True), (0 * flight.pose_cov, False)):
        other = replace(flight, pose_cov=cov)
        assert errors_link(other) is linked
        assert np.isfinite(OneLoad("moment", other, about, linked=True).told(innovation)).all()
