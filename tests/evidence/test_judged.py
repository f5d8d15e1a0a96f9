"""The one judge: what counts of an error, beside its claim and beside the plain route, and what is silent."""

from types import SimpleNamespace

import numpy as np
import pytest

from evidence.judged import Judged, over_claim, over_witness, scores, silent_share, silently_wrong, unbanded


def test_error_over_claim_leaves_out_what_is_beyond_the_band():
    t = np.arange(600) / 200.0
    fast = np.sin(2 * np.pi * 60 * t)[:, None] * np.ones(3)
    slow = np.sin(2 * np.pi * 2 * t)[:, None] * np.ones(3)
    std = np.full((600, 3), np.sqrt(0.5))
    assert over_claim(slow + fast, std, np.full(3, 10.0), 200.0) == pytest.approx(1.0, abs=0.02)
    assert over_claim(slow + fast, std, np.full(3, np.inf), 200.0) == pytest.approx(np.sqrt(2), abs=0.02)
    assert np.isnan(over_claim(np.full((600, 3), np.nan), std, np.full(3, 10.0), 200.0))


def test_of_joints_all_count_together():
    ones = np.ones((80, 2, 3))
    found = SimpleNamespace(force=3 * ones, moment=ones, force_std=ones, moment_std=ones)
    got = scores(found, [ones, ones], np.full(6, np.nan), 100.0)
    assert got == dict.fromkeys(("over", "plain", "relative"), pytest.approx((2.0, 0.0))) | dict.fromkeys(
        ("beside", "beside_plain"), pytest.approx((np.nan, np.nan), nan_ok=True)
    )


def test_of_two_errors_alike_none_is_called_twice_the_other_by_chance():
    """In bands of half a cycle to all frequencies; one four times the other is told from it."""
    rng, rate, twice = np.random.default_rng(5), 100.0, 0
    for band in (0.2, 1.0, 3.0, np.inf):
        for _ in range(50):
            one, other = rng.standard_normal((2, 400, 3))
            twice += over_witness(one, other, np.full(3, band), rate) > 2
            assert over_witness(4 * one, other, np.full(3, band), rate) > 2
    assert twice <= 4  # of 200, two to be expected at most


def test_of_components_that_are_not_given_the_others_count():
    """As of mass on a line: no moment along it, and one across that is off by five claims."""
    error, std = np.full((80, 3), 5.0), np.ones((80, 3))
    error[:, 0] = np.nan
    assert over_claim(error, std, np.full(3, np.inf), 100.0) == pytest.approx(5.0)
    assert over_witness(error, std, np.full(3, np.inf), 100.0) == pytest.approx(5.0)


def test_samples_that_are_not_given_do_not_count():
    error, std = np.ones((80, 3)), np.ones((80, 3))
    error[20:40], std[20:40] = np.nan, 7.0
    assert over_claim(error, std, np.full(3, np.inf), 100.0) == pytest.approx(1.0)


def test_an_estimate_is_judged_within_the_band_that_it_claims():
    t = np.arange(600) / 200.0
    fast = 5 * np.sin(2 * np.pi * 60 * t)[:, None] * np.ones(3)
    ones = np.ones((600, 3))

    def judged(band):
        found = SimpleNamespace(time=t, force=fast, moment=ones, force_std=ones, moment_std=ones, hidden=band)
        return scores(found, [0 * ones, ones])

    claimed = judged(SimpleNamespace(band=np.full(6, 10.0)))
    assert claimed["over"][0] < 0.05
    assert claimed["plain"][0] == pytest.approx(5 / np.sqrt(2), rel=0.02)
    assert judged(None)["over"] == claimed["plain"]
    assert judged(SimpleNamespace(band=np.full(6, np.nan)))["over"] == claimed["plain"]


def test_a_coarse_method_is_not_held_to_the_plain_route():
    ones, t = np.ones((80, 3)), np.arange(80) / 100.0
    route = SimpleNamespace(force=0 * ones, moment=ones)

    def judged(method):
        made = {"force": 3 * ones, "moment": ones, "force_std": ones, "moment_std": ones}
        found = SimpleNamespace(time=t, hidden=None, witness=route, method=method, **made)
        return scores(found, [ones, 0 * ones])

    assert judged("smoother")["beside"] == pytest.approx((2.0, 1.0))
    assert np.isnan(judged("savgol")["beside"]).all()
    assert judged("savgol")["over"] == judged("smoother")["over"]


def test_an_ok_that_claims_nothing_is_silently_wrong_and_a_refusal_is_not():
    assert silently_wrong("ok", (np.nan, np.nan), (np.nan,))
    assert not silently_wrong("refused", (np.nan, np.nan), (np.nan,))
    assert not silently_wrong("ok", (1.0, np.nan), (np.nan,))


def test_beyond_the_band_only_an_ok_beyond_twice_its_claim_is_told():
    assert unbanded("ok", (np.nan, 2.1))
    assert not unbanded("ok", (1.9, np.nan))
    assert not unbanded("degraded", (9.0, 9.0))


def test_any_series_counts_not_force_and_moment_alone():
    assert silently_wrong("ok", (1.0, 1.0), (1.0, 1.0), (2.1,))
    assert not silently_wrong("degraded", (1.0, 1.0), (1.0, 1.0), (2.1,))


def test_a_share_tells_its_interval():
    class Made(Judged):
        def __init__(self, verdict, over):
            self.verdict, self.over, self.beside = verdict, (over,), ()

    records = [Made("ok", 3.0), Made("degraded", 3.0), *[Made("ok", 1.0)] * 8]
    assert silent_share(record.silent for record in records) == "1/10 (0.3–44.5 %)"
