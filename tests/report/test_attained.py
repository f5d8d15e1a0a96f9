"""Error over the bound beside the result, and how often its intervals hold the truth."""

from dataclasses import replace

import numpy as np
import pytest

from forceid.report.numbers import attained


def test_honest_claim_is_attained_and_covers(thrown):
    estimate, truth = thrown
    found = attained(estimate, truth)
    both = np.concatenate([found.force_efficiency, found.moment_efficiency])
    assert both == pytest.approx(1.0, abs=4 / np.sqrt(1200))
    covered = np.concatenate([found.force_coverage, found.moment_coverage])
    assert covered == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / 600))
    assert found.force_bound == pytest.approx([0.05, 0.04, 0.06])


def test_claim_of_half_the_error_is_missed_by_two(thrown):
    estimate, truth = thrown
    found = attained(replace(estimate, wrench_cov=estimate.wrench_cov / 4), truth)
    whole = attained(estimate, truth)
    assert found.force_efficiency == pytest.approx(2 * whole.force_efficiency)
    assert found.moment_coverage.max() < 0.75  # 67 % of a normal lie within 0.98 standard deviations


def test_ends_are_left_out_on_request(thrown):
    estimate, truth = thrown
    force = estimate.force.copy()
    force[:20] += 100.0
    spoiled = replace(estimate, force=force)
    assert attained(spoiled, truth).force_efficiency.min() > 100
    assert attained(spoiled, truth, central=0.75).force_efficiency.max() < 1.2


def test_nothing_is_attained_without_truth(thrown):
    found = attained(thrown[0], {})
    assert np.isnan(found.force_efficiency).all()
    assert np.isnan(found.moment_coverage).all()
