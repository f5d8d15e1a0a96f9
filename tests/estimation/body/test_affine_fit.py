"""The affine map of a frame: its covariance, and what markers in a plane show of it."""

import numpy as np

from forceid.estimation.body.affine_fit import fit_affine
from forceid.scenes.flights.spinning_block import CORNERS

SIGMA, X = 3e-4, CORNERS * [0.24, 0.18, 0.14]


def test_covariance_of_the_map_is_the_scatter_of_many_fits():
    F = np.array([[1.1, 0.2, 0.0], [-0.1, 0.9, 0.3], [0.0, 0.1, 1.2]])
    rng, seen = np.random.default_rng(5), X[[0, 1, 2, 4, 7]] + 0.02
    x = np.tile(seen @ F.T, (4000, 1, 1)) + SIGMA * rng.standard_normal((4000, 5, 3))
    fit = fit_affine(x, seen, SIGMA**2)
    error = np.concatenate([fit.center[..., None], fit.F - F], 2)
    scatter = np.einsum("tab,tac->bc", error, error) / 12000
    np.testing.assert_allclose(scatter, fit.cov[0], atol=0.05 * np.diagonal(scatter).max())


def test_markers_in_a_plane_show_the_map_in_that_plane_only():
    flat = X * [1.0, 1.0, 0.0]
    F = np.array([[1.1, 0.2, 0.4], [-0.1, 0.9, 0.3], [0.0, 0.1, 1.2]])
    fit = fit_affine((flat @ F.T)[None], flat, SIGMA**2)
    assert fit.plane
    assert np.isnan(fit.F).all()
    np.testing.assert_allclose(fit.columns[0], F @ fit.span, atol=1e-12)
    assert np.isnan(fit_affine((flat @ F.T)[None], flat + np.array([0, 0, 0.1]), SIGMA**2).center).all()
