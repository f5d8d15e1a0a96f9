import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from forceid.kalman.tuning.search import uphill


@settings(deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), dims=st.integers(1, 5), stretch=st.floats(0, 6))
def test_a_step_between_bounds_never_promises_less_than_to_stay(seed, dims, stretch):
    """On quadratics of any curvature, hills and saddles, however unlike their coordinates."""
    rng = np.random.default_rng(seed)
    unit = 10 ** rng.uniform(-stretch / 2, stretch / 2, dims)
    bend = rng.normal(size=(dims, dims)) * unit * unit[:, None]
    bend, slope = bend + bend.T, rng.normal(size=dims) * unit
    least, most = -rng.exponential(size=dims) / unit, rng.exponential(size=dims) / unit
    least[rng.random(dims) < 0.3] = 0.0
    step = uphill(slope, bend, least, most)
    assert np.all(step >= least)
    assert np.all(step <= most)
    rise = slope @ step + 0.5 * step @ bend @ step
    assert rise >= 0
    free = (np.where(slope > 0, most, least) != 0) & (slope != 0)
    assert rise > 0 or not free.any()
