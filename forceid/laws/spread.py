"""How sure fitted coefficients are where the residuals are not what the fit takes them for.

A fit whose residuals are white and as large as stated claims C = (J^T J)^-1. Where a law leaves something
out, its residuals hang together, mostly at low frequencies, where the coefficients are read. Two tests look
for it, and what they find goes into the claim:

Within flights. The residuals' spectrum is averaged in bands, each over what the fit leaves of it: its power
over the sum of 1 - h, h the share of a line of the spectrum that the fitted numbers take up. By the influence
A = C J^T of the residuals on the coefficients, the claim becomes sum over lines of |A|^2 S (the sandwich with
a smoothed spectrum; White 1980, Newey and West 1987).

Between flights. Under one law the scores of G flights are apart by their information alone. Where they are
further apart, the coefficients differ from flight to flight, by as much as is likeliest (see `scatter`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from forceid.laws.fitting import START, Fit
from forceid.laws.scatter import scatter_between
from forceid.records import Array
from forceid.significance import DENIED

BANDS = 8  # of the spectrum, in equal shares of its logarithm from the lowest line on
LINES = 4  # of the spectrum that a band has at least: with six channels, known to a fifth
CLUSTERS = 3  # flights from which on their scatter tells anything
HALF = 0.975  # quantile of intervals of 95 %


@dataclass(frozen=True)
class Spread:
    """cov (term, term) of the coefficients; factor (term,): of deviations in an interval of 95 %; scatter
    (term,): standard deviations of the coefficients from flight to flight, NaN of few flights; within and
    between: chances that an honest law has residuals as far from white, and flights as far apart; bands
    (band,): power of the residuals, lowest frequencies first, over what was stated.
    """

    cov: Array
    factor: Array
    scatter: Array
    within: float
    between: float
    bands: Array


def spread_of(fit: Fit) -> Spread:
    """How sure the coefficients of a fit are, by its residuals too."""
    cov, factor = fit.cov, np.full(len(fit.value), norm.ppf(HALF))
    scatter = np.full(len(fit.value), np.nan)
    looks = [Bands(fit, g) for g in range(len(fit.residual))]
    power, left = (np.sum([getattr(look, n) for look in looks], 0) for n in ("power", "left"))
    there = left > 1  # a short record has fewer bands
    bands = np.where(there, power / np.maximum(left, 1), 1.0)
    chances = 2 * np.minimum(chi2.sf(power[there], left[there]), chi2.cdf(power[there], left[there]))
    within = float(min(1.0, BANDS * chances.min()))
    if within < DENIED:
        cov = np.sum([look.claimed(bands) for look in looks], 0)
    between = 1.0
    if len(fit.residual) >= CLUSTERS and len(fit.value):
        scores = np.stack([look.score for look in looks])
        own = np.stack([look.information for look in looks])
        level = float(np.trace(cov) / np.trace(fit.cov))
        square = sum(
            float(s @ np.linalg.pinv(J, hermitian=True) @ s) for s, J in zip(scores, own, strict=True)
        )
        freedoms = int(sum(np.linalg.matrix_rank(J, hermitian=True) for J in own)) - len(fit.value)
        between = float(chi2.sf(square / max(1.0, level), freedoms))
        found = scatter_between(scores, own, cov, HALF)
        cov, factor, scatter = found.cov, found.factor, found.std
    return Spread(cov, factor, scatter, within, between, bands)


class Bands:
    """The spectrum of the residuals of one flight in bands, and what the coefficients take of it.

    power (band,): of the residuals; left (band,): numbers in a band that no fitted one takes up; score and
    information: of the coefficients, those of the start taken out.
    """

    def __init__(self, fit: Fit, flight: int) -> None:
        J, r = fit.slopes[flight], fit.residual[flight]
        n = len(r)
        flat = J.reshape(-1, J.shape[2])
        own, shared = flat[:, :START], flat[:, START:]
        used = own[:, np.abs(own).any(0)]
        basis = np.linalg.qr(used / np.linalg.norm(used, axis=0))[0]
        shared = shared - basis @ (basis.T @ shared)
        self.score, self.information = shared.T @ r.ravel(), shared.T @ shared
        self.influence = (shared @ fit.cov).reshape(n, 6, -1)
        seen = np.abs(J).any(2)
        joint = np.concatenate([basis, shared @ np.linalg.cholesky(fit.cov)], 1) if len(fit.value) else basis
        lines = orthonormal_lines(n)
        which = band_of(n)
        r_lines, h_lines = lines @ r, np.einsum("fn,ncq->fcq", lines, joint.reshape(n, 6, -1))
        share = seen.mean(0)
        left = share - (h_lines**2).sum(2)
        self.power = np.array([(r_lines[which == b] ** 2).sum() for b in range(BANDS)])
        self.left = np.array([np.maximum(left[which == b], 0).sum() for b in range(BANDS)])
        self.lines, self.which = lines, which

    def claimed(self, bands: Array) -> Array:
        """Part of the covariance (term, term) that this flight brings, under such a spectrum."""
        A = np.einsum("fn,nck->fck", self.lines, self.influence)
        return np.asarray(np.einsum("f,fck,fcl->kl", bands[self.which], A, A))


def orthonormal_lines(n: int) -> Array:
    """Cosines (line, sample) of a record of n samples, orthonormal, from slow to fast."""
    k, s = np.arange(n)[:, None], np.arange(n) + 0.5
    lines = np.sqrt(2 / n) * np.cos(np.pi * k * s / n)
    lines[0] /= np.sqrt(2)
    return np.asarray(lines)


def band_of(n: int) -> Array:
    """The band of every line of a record of n samples."""
    edges = np.maximum(np.geomspace(LINES, n, BANDS)[:-1], LINES * np.arange(1, BANDS))
    return np.asarray(np.searchsorted(edges, np.arange(n), side="right"))
