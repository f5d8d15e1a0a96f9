"""A simply supported beam of 30 m, 100 elements and eight modes; what a force does to four channels of it."""

import numpy as np
from scipy.linalg import expm

LENGTH, STIFFNESS, DENSITY, STEP, DAMPING, MODES = 30.0, 210e9 * 1e-6, 50.0, 0.01, 0.02, 8
ACCELERATION, DISPLACEMENT, FORCE, AMBIENT = [10, 50], [15, 55], [30], [25, 45, 80]


def shape(nodes):
    """Mass-normalized mode shapes (node, mode)."""
    x = (np.asarray(nodes) - 1) * LENGTH / 100
    n = np.arange(1, MODES + 1)
    return np.sqrt(2 / (DENSITY * LENGTH)) * np.sin(np.outer(x, n) * np.pi / LENGTH)


def continuous():
    """A of the modal displacements, then velocities; C of accelerations, then displacements."""
    w = (np.arange(1, MODES + 1) * np.pi / LENGTH) ** 2 * np.sqrt(STIFFNESS / DENSITY)
    zero, one = np.zeros((MODES, MODES)), np.eye(MODES)
    A = np.block([[zero, one], [-np.diag(w**2), -np.diag(2 * DAMPING * w)]])
    return A, np.vstack([shape(ACCELERATION) @ A[MODES:], shape(DISPLACEMENT) @ np.eye(MODES, 2 * MODES)])


def inputs(nodes):
    """Discrete input (state, force) and feedthrough (channel, force) of forces held over a step."""
    A, _ = continuous()
    n, m = len(A), len(nodes)
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[MODES:n, n:] = A, shape(nodes).T
    through = np.vstack([shape(ACCELERATION) @ shape(nodes).T, np.zeros((len(DISPLACEMENT), m))])
    return expm(STEP * block)[:n, n:], through


def beam(ambient):
    """A, B, C, D, Q, R, S of the force, with white ambient forces of 1 N as noise or without them."""
    A, C = continuous()
    (B, D), (Be, Je) = inputs(FORCE), (float(ambient) * a for a in inputs(AMBIENT))
    Q, R = Be @ Be.T + 1e-16 * np.eye(2 * MODES), Je @ Je.T + 1e-8 * np.eye(4)
    return expm(STEP * A), B, C, D, Q, R, Be @ Je.T
