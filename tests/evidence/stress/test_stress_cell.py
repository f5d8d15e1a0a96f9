"""The rule that colors a cell, on trials written down."""

import numpy as np
import pytest

from evidence.stress.cell import Trial, judge_cell

NAN = float("nan")
HONEST = Trial("ok", (0.1, 0.01), (0.1, 0.01), (0.08, 0.008))


def trial(verdict="ok", error=(0.1, 0.01), claimed=(0.1, 0.01), bound=(0.08, 0.008), reason=""):
    return Trial(verdict, error, claimed, bound, reason)


def test_an_honest_estimate_near_the_bound_is_green():
    assert judge_cell([HONEST] * 5, coarse=False).color == "green"


@pytest.mark.parametrize("claimed", [(0.049, 0.01), (0.1, 0.0049)])
def test_an_error_beyond_twice_the_claim_of_force_or_of_moment_is_red(claimed):
    for coarse in (False, True):
        cell = judge_cell([trial(claimed=claimed)], coarse)
        assert cell.color == "red"
        assert "claimed" in cell.cause
        assert not cell.honest_red


def test_an_error_beyond_twice_the_bound_is_red_for_a_smoother_and_pale_for_a_coarse_method():
    far = trial(bound=(0.049, 0.008))
    assert judge_cell([far], coarse=False).color == "red"
    assert judge_cell([far], coarse=False).honest_red
    assert judge_cell([far], coarse=True).color == "pale"


def test_what_is_said_to_be_degraded_is_amber_however_wrong():
    assert judge_cell([trial("degraded", claimed=(1e-3, 1e-4))] * 5, coarse=False).color == "amber"


def test_what_is_refused_is_grey_and_its_reason_is_kept():
    nothing = (NAN, NAN)
    cell = judge_cell([Trial("refused", nothing, nothing, nothing, "no frame shows it")] * 3, coarse=False)
    assert (cell.color, cell.reason, cell.refused) == ("grey", "no frame shows it", 3)


def test_one_boastful_ok_among_degraded_makes_a_cell_red():
    trials = [trial("degraded")] * 4 + [trial(claimed=(0.01, 0.01))]
    assert judge_cell(trials, coarse=False).color == "red"


def test_a_single_record_past_the_limit_is_flagged_though_the_seeds_together_are_within():
    cell = judge_cell([HONEST] * 4 + [trial(error=(0.17, 0.01), claimed=(0.08, 0.01))], coarse=False)
    assert cell.color == "green"
    assert cell.alone == 1


def test_an_ok_that_claims_nothing_is_red():
    assert judge_cell([trial(error=(NAN, NAN), claimed=(NAN, NAN))], coarse=True).color == "red"


def test_an_error_that_is_none_of_ours_is_red():
    cell = judge_cell([HONEST, trial("crashed", reason="LinAlgError: singular")], coarse=True)
    assert (cell.color, cell.cause) == ("red", "crashed")


def test_verdicts_equally_frequent_count_as_the_more_cautious_one():
    assert judge_cell([HONEST, trial("degraded")], coarse=False).color == "amber"
    assert judge_cell([trial("degraded"), trial("refused", reason="why")], coarse=False).color == "grey"


def test_without_a_bound_claims_alone_decide():
    unknown = trial(bound=(NAN, NAN))
    cell = judge_cell([unknown], coarse=False)
    assert cell.color == "green"
    assert np.isnan(cell.over_bound).all()


def test_an_exact_zero_is_within_any_claim():
    assert judge_cell([trial(error=(0.0, 0.0), claimed=(0.0, 0.0))], coarse=False).color == "green"
