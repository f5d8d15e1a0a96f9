"""What markers may be off by together: noise of every reading, and what moves many of them at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from forceid.records import Array, Flags


@dataclass(frozen=True)
class ReadingCov:
    """Covariance diag(white) + together together^T of the coordinates (channel,) of markers, body axes.

    white (channel,) m2, above zero; together (channel, k) m: one standard deviation each of what moves many
    coordinates at once. So it takes room and time as there are markers, not as their square.

    >>> cov = ReadingCov(np.ones(3), np.ones((3, 1)))
    >>> np.allclose(cov.reading(cov.whitened(np.eye(3))), np.linalg.inv(np.eye(3) + 1))
    True
    """

    white: Array
    together: Array

    @classmethod
    def of(cls, cov: Array | ReadingCov) -> ReadingCov:
        """The covariance itself, or that of a matrix (channel, channel)."""
        if isinstance(cov, ReadingCov):
            return cov
        own = np.diagonal(cov)
        if not (cov - np.diag(own)).any():
            return cls(np.array(own), np.zeros((len(own), 0)))
        size, axes = np.linalg.eigh(cov)
        return cls(np.full(len(own), size[0]), axes * np.sqrt(size - size[0]))

    def beside(self, together: Array) -> ReadingCov:
        """The same with more (channel, k) m that moves many coordinates at once."""
        return ReadingCov(self.white, np.concatenate([self.together, together], 1))

    def seen(self, markers: Flags, own: Array | None = None) -> ReadingCov:
        """That of some markers (node,); own (node,) m2: variance that their readings have beside."""
        rows = np.repeat(markers, 3)
        white = self.white if own is None else self.white + np.repeat(own, 3)
        return ReadingCov(white[rows], self.together[rows])

    @cached_property
    def parts(self) -> tuple[Array, Array, Array]:
        """Standard deviation (channel,) of the white part; in units of it the directions (channel, k) of the
        other, and by what whitening multiplies each, less one.
        """
        std = np.sqrt(self.white)
        directions, size, _ = np.linalg.svd(self.together / std[:, None], full_matrices=False)
        return std, directions, 1 / np.sqrt(1 + size**2) - 1

    def whitened(self, a: Array) -> Array:
        """Errors a (..., channel) as unit ones, W a, where W^T W is the inverse of this covariance."""
        return self.turned(a / self.parts[0])

    def reading(self, z: Array) -> Array:
        """Rows z (..., channel) that read whitened errors, as rows that read the errors themselves: z W."""
        return np.asarray(self.turned(z) / self.parts[0])

    def turned(self, a: Array) -> Array:
        """A (..., channel), in units of the white part, shrunk along what moves many together."""
        _, directions, change = self.parts
        return np.asarray(a + (a @ directions * change) @ directions.T) if len(change) else np.asarray(a)
