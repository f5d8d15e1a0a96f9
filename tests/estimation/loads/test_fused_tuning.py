"""Fast spins under weak loads: their first moment shows little, and the flight itself tunes their priors."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

J = 2e-2 * np.diag([0.128, 0.099, 0.139])  # kg m2
RATE, SAMPLES = 65.0, 435  # Hz


def damped_spin(seed, noise):
    """A recording of a body that tumbles at 13 rad/s against a drag on its spin, and the moment (time, 3)."""
    rng = np.random.default_rng(seed)
    X, drag = 0.15 * rng.standard_normal((6, 3)), rng.uniform(0.02, 0.06) * np.trace(J) / 3
    spin, t = rng.standard_normal(3), np.arange(SAMPLES) / RATE

    def rates(_, y):
        R, w = y[:9].reshape(3, 3), y[9:]
        W = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([(R @ W).ravel(), np.linalg.solve(J, -drag * w - np.cross(w, J @ w))])

    y0 = np.concatenate([np.eye(3).ravel(), 13 * spin / np.linalg.norm(spin)])
    y = solve_ivp(rates, (0, t[-1]), y0, "DOP853", t, rtol=1e-10, atol=1e-12).y.T
    R = y[:, :9].reshape(-1, 3, 3)
    x = np.einsum("tab,nb->tna", R, X) + noise * rng.standard_normal((SAMPLES, 6, 3))
    body = Body(tuple("abcdef"), X, total_mass=1.0, mass_center=np.zeros(3), inertia=J)
    return Recording(body, Motion(t, x, gravity=np.zeros(3))), -drag * np.einsum("tab,tb->ta", R, y[:, 9:])


@pytest.mark.long
@pytest.mark.parametrize(("seeds", "noise", "most"), [(range(20, 30), 4e-4, 1), (range(3, 5), 1e-4, 0)])
def test_the_drag_on_a_fast_tumble_lies_within_twice_its_claim_but_for_one_in_ten(seeds, noise, most):
    """Its harmonics may pass for lines that stay as they are: then the claim is short by a little."""
    over = []
    for seed in seeds:
        recording, moment = damped_spin(seed, noise)
        found = estimate_recording(recording, load_settings(model="rigid"))
        score = ((found.moment - moment) / found.moment_std)[40:-40]
        over.append(float(np.sqrt(np.mean(score**2))))
        assert np.nanmean(found.nis) < 1.3
    assert sum(one > 2.0 for one in over) <= most
    assert max(over) < 3.0
