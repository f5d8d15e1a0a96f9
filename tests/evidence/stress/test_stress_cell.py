"""The rule that colors a cell, on trials written down."""

from dataclasses import replace

import numpy as np
import pytest

from evidence.stress.cell import Trial, judge_cell

NAN = float("nan")
NOTHING = (NAN, NAN)
HONEST = Trial("ok", (0.1, 0.01), (0.1, 0.01), (0.08, 0.008), over=(1.0, 1.0))
SAID = replace(HONEST, verdict="degraded")
REFUSED = Trial("refused", NOTHING, NOTHING, NOTHING, "no frame shows it")


def test_an_honest_estimate_near_the_bound_is_green():
    assert judge_cell([HONEST] * 5).color == "green"


@pytest.mark.parametrize("over", [(2.1, 1.0), (1.0, 2.1)])
def test_an_error_beyond_twice_the_claim_of_force_or_of_moment_is_red(over):
    cell = judge_cell([replace(HONEST, over=over)])
    assert cell.color == "red"
    assert "claimed" in cell.cause


def test_an_error_beyond_twice_that_of_the_plain_route_is_red():
    cell = judge_cell([replace(HONEST, beside=(0.9, 2.1))])
    assert cell.color == "red"
    assert "moment error 2.1 times that of the plain route" in cell.cause


def test_an_error_beyond_twice_the_bound_is_pale():
    assert judge_cell([replace(HONEST, bound=(0.049, 0.008))]).color == "pale"


def test_an_error_beyond_the_band_that_is_claimed_counts_for_nothing():
    assert judge_cell([replace(HONEST, error=(5.0, 0.01), bound=NOTHING)]).color == "green"


def test_what_is_said_to_be_degraded_is_amber_however_wrong():
    cell = judge_cell([replace(SAID, over=(100.0, 100.0))] * 5)
    assert (cell.color, cell.needless) == ("amber", False)


def test_an_amber_cell_is_in_vain_where_all_its_records_that_are_degraded_are_within_their_claim():
    far = replace(SAID, over=(1.6, 0.5), codes=("load-kinks",))
    assert judge_cell([SAID] * 2).needless
    assert not judge_cell([SAID, far]).needless
    assert judge_cell([SAID, far]).codes == ("load-kinks",)


def test_what_is_refused_is_grey_and_its_reason_is_kept():
    cell = judge_cell([REFUSED] * 3)
    assert (cell.color, cell.reason, cell.refused) == ("grey", "no frame shows it", 3)


@pytest.mark.parametrize("others", [[SAID] * 4, [HONEST] * 4])
def test_one_record_that_is_silently_wrong_makes_a_cell_red(others):
    cell = judge_cell([*others, replace(HONEST, over=(10.0, 1.0))])
    assert (cell.color, cell.silent) == ("red", 1)


def test_an_ok_that_claims_nothing_is_red():
    cell = judge_cell([replace(HONEST, error=NOTHING, claimed=NOTHING, over=NOTHING)])
    assert (cell.color, cell.cause) == ("red", "nothing claimed")


def test_an_error_that_is_none_of_ours_is_red():
    cell = judge_cell([HONEST, Trial("crashed", NOTHING, NOTHING, NOTHING, "LinAlgError: singular")])
    assert (cell.color, cell.cause) == ("red", "crashed")


def test_verdicts_equally_frequent_count_as_the_more_cautious_one():
    assert judge_cell([HONEST, SAID]).color == "amber"
    assert judge_cell([SAID, REFUSED]).color == "grey"


def test_without_a_bound_claims_alone_decide():
    cell = judge_cell([replace(HONEST, bound=NOTHING)])
    assert cell.color == "green"
    assert np.isnan(cell.over_bound).all()


@pytest.mark.parametrize(("told", "color"), [((0.5, 0.0), "amber"), ((0.1, 0.0), "red")])
def test_a_budget_that_accounts_for_a_wrong_input_is_amber(told, color):
    wrong = replace(HONEST, error=(0.8, 0.01), over=(8.0, 1.0), told=told)
    cell = judge_cell([wrong])
    assert (cell.color, cell.budgeted, cell.needless) == (color, color == "amber", False)
