"""The peers, each used as its own documentation says: functions of a model and z that return what is timed.

Every function takes (model, z, smooth) with z (time, channel), or (time, signal, channel) where it says so,
and returns a job; `read_*` takes x (time, state) and P (time, state, state) out of what the job returned.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from forceid import kalman

LinearModel = kalman.StateSpace
PeerJob = Callable[[], Any]
PeerAnswer = dict[str, np.ndarray]


def our_engine(
    model: LinearModel, z: np.ndarray, smooth: bool, engine: str, expanded: bool = False
) -> PeerJob:
    """Ours; `expanded` asks for every covariance by itself."""
    kalman.engine(engine)  # not there: say so before anything runs
    work = kalman.smooth if smooth else kalman.filter

    def job() -> Any:
        found = work(model, z, engine=engine)
        return (found.x, found.P) if expanded else found

    return job


def read_forceid(found: Any) -> PeerAnswer:
    x, P = found if isinstance(found, tuple) else (found.x, found.P)
    return {"x": np.asarray(x), "P": np.asarray(P)}


def filterpy(model: LinearModel, z: np.ndarray, smooth: bool) -> PeerJob:
    """filterpy's KalmanFilter.batch_filter, then rts_smoother on what it returned."""
    from filterpy.kalman import KalmanFilter

    def job() -> Any:
        kf = KalmanFilter(dim_x=len(model.x0), dim_z=len(model.H))
        kf.x, kf.P = model.x0.copy(), model.P0.copy()
        kf.F, kf.Q, kf.H, kf.R = model.F, model.Q, model.H, model.R
        x, P, _, _ = kf.batch_filter(z, update_first=True)  # the first sample belongs to the start
        if smooth:
            x, P, _, _ = kf.rts_smoother(x, P)
        return x, P

    return job


def read_pair(found: Any) -> PeerAnswer:
    return {"x": np.asarray(found[0]), "P": np.asarray(found[1])}


def statsmodels(model: LinearModel, z: np.ndarray, smooth: bool) -> PeerJob:
    """A new object every time: one that is bound to new data returns the old answer."""
    from statsmodels.tsa.statespace.kalman_filter import KalmanFilter
    from statsmodels.tsa.statespace.kalman_smoother import SMOOTHER_STATE, SMOOTHER_STATE_COV, KalmanSmoother

    m, n = model.H.shape

    def job() -> Any:
        if smooth:
            ks = KalmanSmoother(k_endog=m, k_states=n, smoother_output=SMOOTHER_STATE | SMOOTHER_STATE_COV)
        else:
            ks = KalmanFilter(k_endog=m, k_states=n)
        ks["design"], ks["obs_cov"] = model.H, model.R
        ks["transition"], ks["selection"], ks["state_cov"] = model.F, np.eye(n), model.Q
        ks.bind(z)
        ks.initialize_known(model.x0, model.P0)
        if not smooth:
            found = ks.filter()
            return found.filtered_state, found.filtered_state_cov
        found = ks.smooth()
        return found.smoothed_state, found.smoothed_state_cov

    return job


def read_statsmodels(found: Any) -> PeerAnswer:
    return {"x": np.asarray(found[0]).T, "P": np.asarray(found[1]).transpose(2, 0, 1)}


def pykalman(model: LinearModel, z: np.ndarray, smooth: bool) -> PeerJob:
    from pykalman import KalmanFilter

    kf = KalmanFilter(
        transition_matrices=model.F, observation_matrices=model.H, transition_covariance=model.Q,
        observation_covariance=model.R, initial_state_mean=model.x0, initial_state_covariance=model.P0,
    )  # fmt: skip
    return lambda: kf.smooth(z) if smooth else kf.filter(z)


def simdkalman(model: LinearModel, z: np.ndarray, smooth: bool) -> PeerJob:
    """Many signals at once; z (time, channel) or (time, signal, channel)."""
    from simdkalman import KalmanFilter

    kf = KalmanFilter(model.F, model.Q, model.H, model.R)
    data = np.ascontiguousarray((z[:, None] if z.ndim == 2 else z).swapaxes(0, 1))
    start = {"initial_value": model.x0, "initial_covariance": model.P0}

    def job() -> Any:
        found = kf.compute(data, 0, **start, smoothed=smooth, filtered=not smooth, observations=False)
        return (found.smoothed if smooth else found.filtered).states

    return job


def read_simdkalman(found: Any) -> PeerAnswer:
    """Of one signal."""
    return {"x": found.mean[0], "P": found.cov[0]}


def read_simdkalman_many(found: Any) -> PeerAnswer:
    """x (time, signal, state), P (time, signal, state, state)."""
    return {"x": found.mean.swapaxes(0, 1), "P": found.cov.swapaxes(0, 1)}


def dynamax(model: LinearModel, z: np.ndarray, smooth: bool) -> PeerJob:
    """Compiled by jax, vmapped over signals where z is (time, signal, channel), float64, waited for."""
    import jax
    import jax.numpy as jnp
    from dynamax.linear_gaussian_ssm.inference import lgssm_filter, lgssm_smoother, make_lgssm_params

    parts = (model.x0, model.P0, model.F, model.Q, model.H, model.R)
    params = make_lgssm_params(*(jnp.asarray(a) for a in parts))
    many = z.ndim == 3
    data = jnp.asarray(np.ascontiguousarray(z.swapaxes(0, 1)) if many else z)

    def one(y: Any) -> Any:
        if smooth:
            found = lgssm_smoother(params, y)
            return found.smoothed_means, found.smoothed_covariances
        found = lgssm_filter(params, y)
        return found.filtered_means, found.filtered_covariances

    compiled = jax.jit(jax.vmap(one) if many else one)
    return lambda: jax.block_until_ready(compiled(data))


def read_pair_many(found: Any) -> PeerAnswer:
    """x (time, signal, state), P (time, signal, state, state)."""
    return {"x": np.asarray(found[0]).swapaxes(0, 1), "P": np.asarray(found[1]).swapaxes(0, 1)}
