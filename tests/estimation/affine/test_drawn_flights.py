"""Moments of drawn affine bodies that stretch by a third and more are within their claims."""

import numpy as np
import pytest

from evidence.theory.affine import drawn
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording


@pytest.mark.long
@pytest.mark.parametrize("seed", [2411, 31])
def test_moments_of_stretched_bodies_are_known_as_claimed(seed):
    over = []
    for k in range(24):
        record, _, stretch = drawn(seed, k)
        if min(stretch) < 0.35 or max(stretch) > 1.8:
            continue
        found, inner = estimate_recording(record, load_settings()), slice(30, -30)
        off = (found.moment - record.truth["moment"])[inner]
        over.append(np.sqrt(np.mean(off**2) / np.mean(found.moment_std[inner] ** 2)))
    assert len(over) >= 6
    assert np.median(over) < 1.3
    assert np.max(over) < 2.5
