"""What a page, a notebook and a print say first: verdict for who is no expert, three numbers, next steps."""

from dataclasses import replace

import numpy as np
import pytest

from forceid.estimation import CATALOGUE
from forceid.records import Finding, HiddenLoad, Verdict
from forceid.report.first_screen import cards, headline, next_steps


def found(code, level="degraded", text="a sentence; do this"):
    return Finding(code, level, {}, text)


def test_an_accurate_estimate_says_so_and_asks_for_nothing(thrown):
    first = headline(replace(thrown[0], verdict=Verdict("ok")))
    assert first.sentence.startswith("You can rely on this")
    assert first.steps == ()
    assert str(first).startswith("Accurate. You can rely on this")


def test_a_degraded_one_counts_its_reasons_and_a_refused_one_claims_nothing(thrown):
    two = Verdict("degraded", (found("a"), found("b"), found("c", "ok")))
    assert "for 2 reasons" in headline(replace(thrown[0], verdict=two)).sentence
    refused = headline(replace(thrown[0], verdict=Verdict("refused", (found("a", "refused"),))))
    assert "does not show" in refused.sentence
    assert "rely" not in refused.sentence


def test_a_moment_that_is_not_seen_is_said_to_be_unknown(thrown):
    blind = replace(thrown[0], moment=np.full_like(thrown[0].moment, np.nan), verdict=Verdict("ok"))
    first = headline(blind)
    assert first.sentence.endswith("; the moment is not known.")
    assert first.cards[1].value == "not known"


def test_three_numbers_are_sizes_with_two_sigma_and_the_band(thrown):
    estimate, _ = thrown
    hidden = HiddenLoad(np.array([1.0, 2.0]), np.ones((2, 6)), np.array([3.0, 4.0, 7.0, 0, 0, 0]))
    force, moment, band = cards(replace(estimate, hidden=hidden))
    size = np.sqrt(np.mean(np.sum(estimate.force**2, axis=1)))
    assert float(force.value.split()[0]) == pytest.approx(size, rel=5e-3)
    assert force.note == f"± {2 * np.linalg.norm([0.05, 0.04, 0.06]):.2g} N (2σ)"
    assert moment.value.endswith("N m")
    assert band.value == "7 Hz"


def test_a_force_within_its_uncertainty_is_not_told_apart_from_none(thrown):
    weak = replace(thrown[0], force=0.01 * thrown[0].force)
    assert cards(weak)[0].more.endswith("not told apart from none")


def test_next_steps_come_from_the_catalogue_gravest_first_and_each_once():
    grave = next(code for code, entry in CATALOGUE.items() if entry.level == "refused")
    mild, idle = "innovations-large", next(c for c, e in CATALOGUE.items() if e.action.startswith("Nothing"))
    steps = next_steps([found(idle), found(mild), found(mild, text="b"), found(grave, "refused")])
    assert [step.action for step in steps[:2]] == [
        CATALOGUE[code].action.rstrip(".") for code in (grave, mild)
    ]
    assert steps[1].reasons == ("a sentence; do this", "b")
    assert steps[-1].action.startswith("Nothing")


def test_a_finding_of_another_version_gives_the_next_step_of_its_sentence():
    assert next_steps([found("of-long-ago")])[0].action == "Do this"


def test_html_of_names_and_sentences_is_text(thrown):
    odd = Verdict("degraded", (found("odd", text="node <b> is off; mend <b>"),))
    for shown in (odd._repr_html_(), headline(replace(thrown[0], verdict=odd))._repr_html_()):
        assert "<b> is off" not in shown
        assert "end &lt;b&gt;" in shown
