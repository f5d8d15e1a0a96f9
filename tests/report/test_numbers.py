"""The numbers quoted of an estimate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.report.numbers import truth_at, wrench_numbers


def test_honest_sigma_scores_one(thrown):
    estimate, truth = thrown
    quoted = wrench_numbers(estimate, truth)
    score = np.concatenate([quoted.force_score, quoted.moment_score])
    # rms of 600 unit normals: 1 with standard deviation 1 / sqrt(1200)
    np.testing.assert_allclose(score, 1.0, atol=4 / np.sqrt(1200))
    np.testing.assert_allclose(quoted.force_std, [0.05, 0.04, 0.06])


def test_errors_are_unknown_without_truth(thrown):
    quoted = wrench_numbers(thrown[0])
    assert np.isnan(quoted.force_error).all()
    assert np.isnan(quoted.moment_score).all()
    assert np.isfinite(quoted.force_rms).all()


def test_exact_force_and_moment_close_the_momenta(thrown):
    estimate, truth = thrown
    quoted = wrench_numbers(replace(estimate, force=truth["force"], moment=truth["moment"]))
    # trapezoid on 600 samples of at most 1.2 and 0.8 Hz: relative error (w h)^2 / 12 at most
    h, impulse = 3 / 599, np.abs(truth["force"]).max() * 3
    assert np.abs(quoted.force_closure).max() < impulse * (2 * np.pi * 1.2 * h) ** 2 / 12
    spin = np.ptp(estimate.angular_momentum, axis=0).max()
    assert np.abs(quoted.moment_closure).max() < spin * (2 * np.pi * 0.8 * h) ** 2 / 12


def test_missing_load_breaks_the_closure_by_its_impulse(thrown):
    estimate, truth = thrown
    pushed = replace(estimate, force=truth["force"] - [0.2, 0.0, 0.0], moment=truth["moment"] + [0, 0, 0.01])
    np.testing.assert_allclose(wrench_numbers(pushed).force_closure[0], 0.2 * 3.0, atol=1e-4)
    np.testing.assert_allclose(wrench_numbers(pushed).moment_closure[2], -0.01 * 3.0, atol=1e-5)


def test_force_with_weight_in_it_does_not_close(thrown):
    estimate, truth = thrown
    gap = wrench_numbers(
        replace(estimate, force=truth["force"] + estimate.mass * estimate.gravity)
    ).force_closure
    np.testing.assert_allclose(gap, -3.0 * estimate.mass * estimate.gravity, atol=1e-4)


def test_constant_error_of_one_sigma_reaches_the_limit_of_the_closure(thrown):
    estimate, truth = thrown
    wrong = replace(estimate, force=truth["force"] + estimate.force_std)
    quoted = wrench_numbers(wrong)
    np.testing.assert_allclose(quoted.force_closure_limit, 3.0 * np.array([0.05, 0.04, 0.06]))
    np.testing.assert_allclose(-quoted.force_closure, quoted.force_closure_limit, atol=2e-4)


def test_gap_in_the_force_leaves_the_rest_closed(thrown):
    estimate, truth = thrown
    force = truth["force"].copy()
    force[100:200] = np.nan
    quoted = wrench_numbers(replace(estimate, force=force))
    assert np.abs(quoted.force_closure).max() < 1e-3


def test_gap_hides_only_itself(thrown):
    estimate, truth = thrown
    force = truth["force"].copy()
    force[100:200] = np.nan
    quoted = wrench_numbers(replace(estimate, force=force), truth)
    np.testing.assert_allclose(quoted.force_error, 0.0, atol=1e-15)
    np.testing.assert_allclose(quoted.force_mean, np.nanmean(force, axis=0))


def test_truth_on_another_clock_is_read_at_the_times_of_the_estimate(thrown):
    estimate, _ = thrown
    line = {"time": np.array([0.0, 1.5]), "force": np.array([[0.0, 1.0, 2.0], [3.0, 1.0, 0.5]])}
    at = truth_at(estimate, line, "force")
    inside = estimate.time <= 1.5
    np.testing.assert_allclose(at[inside, 0], 2 * estimate.time[inside])
    assert np.isnan(at[~inside]).all()


def test_moment_about_another_point_is_not_judged_by_the_truth(thrown):
    estimate, truth = thrown
    quoted = wrench_numbers(replace(estimate, moment_about="m3"), truth)
    assert np.isnan(quoted.moment_error).all()
    assert np.isnan([quoted.moment_closure, quoted.moment_closure_limit]).all()
    assert np.isfinite(quoted.force_error).all()
    assert np.isfinite(quoted.force_closure).all()
