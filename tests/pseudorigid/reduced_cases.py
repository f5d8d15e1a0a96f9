"""Bodies for the reduced forms, and the master system F'' E = -dW/dF to judge them by, integrated here."""

import numpy as np
from scipy.integrate import solve_ivp

from evidence.subjects.affine.reduced import general_reduced, left_reduced, two_sided

BALL, BLOCK = 1.7 * np.eye(3), np.array([[1.0, 0.2, 0], [0.2, 1.5, -0.1], [0, -0.1, 2.2]])
EVERY = [(left_reduced, BLOCK), (two_sided, BALL), (general_reduced, BLOCK)]
IDS = ["left", "two-sided", "general"]
TIME = np.linspace(0.0, 1.0, 6)


class Springs:
    """W = a |F|^2 + c J^2 - d log J: isotropic. With fiber: + f |F e_1|^4, only frame indifferent."""

    def __init__(self, a=1.0, c=0.5, d=3.0, fiber=0.0):
        self.a, self.c, self.d, self.fiber = a, c, d, fiber

    def energy(self, F):
        J = np.linalg.det(F)
        stretch = (F[..., 0] ** 2).sum(-1)
        return self.a * (F * F).sum((-1, -2)) + self.c * J**2 - self.d * np.log(J) + self.fiber * stretch**2

    def gradient(self, F):
        J = np.linalg.det(F)[..., None, None]
        out = 2 * self.a * F + (2 * self.c * J**2 - self.d) * np.swapaxes(np.linalg.inv(F), -1, -2)
        out[..., 0] += 4 * self.fiber * (F[..., 0] ** 2).sum(-1)[..., None] * F[..., 0]
        return out


def master(E, W, F0, dF0, t, held=False):
    inverse = np.linalg.inv(E)

    def rates(_, y):
        F, dF = y.reshape(2, 3, 3)
        ddF = -W.gradient(F) @ inverse
        if held:
            Y, Fi = np.linalg.solve(F, dF), np.linalg.inv(F)
            push = Fi.T @ inverse
            ddF = ddF + push * (np.trace(Y @ Y) - np.trace(Fi @ ddF)) / np.trace(Fi @ push)
        return np.concatenate([dF.ravel(), ddF.ravel()])

    start = np.concatenate([F0.ravel(), dF0.ravel()])
    run = solve_ivp(rates, (t[0], t[-1]), start, "DOP853", t, rtol=3e-14, atol=1e-15)
    return run.y[:9].T.reshape(-1, 3, 3), run.y[9:].T.reshape(-1, 3, 3)


def near_crossing(E, W, least):
    """A start whose first axes come as near as `least`, at half the time."""
    B = np.array([[0.2, 0.5, -0.3], [-0.1, 0.2, 0.4], [0.3, 0.1, -0.2]])
    F, dF = master(E, W, np.diag([1 + least / 2, 1 - least / 2, 0.8]), -B, np.array([0, 0.5]))
    return F[-1], -dF[-1]


def random_start(seed):
    rng = np.random.default_rng(seed)
    return np.diag([1.3, 1.0, 0.8]) + 0.1 * rng.standard_normal((3, 3)), 0.5 * rng.standard_normal((3, 3))
