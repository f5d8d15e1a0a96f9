"""The centripetal trap, the load at twice the spin, and the particle, in closed form."""

import numpy as np

from forceid.scenes.flights import particle
from forceid.scenes.flights.spinner import Parameters, fly

RATE = 2000.0
TIME = np.arange(2001) / RATE


def node_forces(flight, differentiate):
    """Mass share times (acceleration - gravity) of every node (time, node, 3)."""
    acceleration = differentiate(differentiate(flight.position, 1.0 / RATE), 1.0 / RATE)
    return 0.13 / 6.0 * (acceleration - flight.gravity)


def test_nodal_inertia_forces_add_up_to_the_applied_force(differentiate):
    flight = fly(Parameters(), TIME)
    total = node_forces(flight, differentiate).sum(1)
    assert np.abs(total - flight.truth["force"][8:-8]).max() < 1e-5


def test_average_over_five_of_six_markers_shows_a_false_force_of_thirty_newtons(differentiate):
    flight = fly(Parameters(), TIME)
    naive = 6.0 / 5.0 * node_forces(flight, differentiate)[:, 1:].sum(1)
    false = np.linalg.norm(naive - flight.truth["force"][8:-8], axis=1).max()
    assert abs(false - 0.13 * 0.3 * (20.0 * np.pi) ** 2 / 5.0) < 0.1


def test_load_at_twice_the_spin_is_a_line_of_the_stated_amplitude():
    force = fly(Parameters(load=(0, 0, 0), harmonic_load=(0.2, 0, 0)), TIME[:-1]).truth["force"]
    line = 2.0 * np.abs(np.fft.rfft(force, axis=0)) / len(force)
    assert abs(line[20, 0] - 0.2) < 1e-12
    assert np.delete(line, 20, 0).max() < 1e-12
    assert line[:, 1:].max() < 1e-12


def test_axial_moment_changes_the_angular_momentum(differentiate):
    truth = fly(Parameters(axial_moment=0.05), TIME).truth
    rate = differentiate(truth["angular_momentum"], 1.0 / RATE)
    assert np.abs(rate - truth["moment"][4:-4]).max() < 1e-9
    assert np.abs(truth["moment"][:, 2]).max() > 0.04


def test_particle_accelerates_by_force_over_mass(differentiate):
    flight = particle.fly(particle.Parameters(), TIME)
    acceleration = differentiate(flight.truth["velocity"], 1.0 / RATE)
    assert np.abs(0.1 * (acceleration - flight.gravity) - flight.truth["force"][4:-4]).max() < 1e-9
    velocity = differentiate(flight.truth["center"], 1.0 / RATE)
    assert np.abs(velocity - flight.truth["velocity"][4:-4]).max() < 1e-9
