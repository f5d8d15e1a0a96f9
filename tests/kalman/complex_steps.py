"""Loads about a mean, and derivatives by complex steps as `kalman.tune` takes them: exact to rounding."""

from types import SimpleNamespace

import numpy as np

from forceid.kalman import Process, discretize, random_walk, superpose

STEP = 1e-150  # so small that its square vanishes beside any number


def with_mean(load, var):
    """`load` about a constant mean of variance var (...), the first state."""
    return superpose(random_walk(0.0, var), load)


def sensitivity(process_of, theta, step):
    """F, Q and P0 of the process with parameters theta (parameter, ...), and dF, dQ, dP0 by each of them."""
    theta, step = np.asarray(theta, float), np.asarray(step, float)
    nudges = 1j * STEP * np.eye(len(theta)).reshape(len(theta), len(theta), *[1] * (theta.ndim - 1))
    each = [process_of(theta + nudge) for nudge in nudges]
    A, Qc, P0 = (np.stack([getattr(p, name) for p in each]) for name in ("A", "Qc", "P0"))
    # the axis of parameters before those of the step
    lead = (len(theta), *[1] * (step.ndim - A.ndim + 3))
    A, Qc = (a.reshape(*lead, *a.shape[1:]) for a in (A, Qc))
    F, Q = discretize(Process(A, Qc, P0, np.zeros(A.shape[-1])), step)
    dF, dQ, dP0 = (a.imag / STEP for a in (F, Q, P0))
    return SimpleNamespace(F=F[0].real, Q=Q[0].real, P0=P0[0].real, dF=dF, dQ=dQ, dP0=dP0)
