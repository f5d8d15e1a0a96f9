"""CPU time by stage: what counts for which, whatever it comes to."""

import io
import tomllib
from importlib.resources import files
from itertools import count

from forceid import timing
from forceid.report import show_stages
from forceid.timing import STAGES, in_order, recorded, stage


def test_a_second_counts_for_the_innermost_stage_that_it_was_spent_in(monkeypatch):
    seconds = count()  # one at every look
    monkeypatch.setattr(timing, "process_time", lambda: float(next(seconds)))

    @stage("flight")
    def fly():
        return "flown"

    with recorded() as spent, stage("rest"):
        with stage("level"):
            assert fly() == fly() == "flown"
        fly()
    assert spent == {"flight": 3.0, "level": 3.0, "rest": 3.0}
    assert sum(spent.values()) == next(seconds) - 1


def test_a_stage_that_fails_has_taken_its_time_too(monkeypatch):
    seconds = count()
    monkeypatch.setattr(timing, "process_time", lambda: float(next(seconds)))
    with recorded() as spent:
        try:
            with stage("level"), stage("flight"):
                raise ValueError
        except ValueError:
            pass
    assert spent == {"level": 2.0, "flight": 1.0}


def test_records_are_apart_and_where_nobody_records_nothing_looks_at_the_clock(monkeypatch):
    with recorded() as outer:
        with recorded() as inner, stage("force"):
            pass
        assert list(inner) == ["force"]
        assert not outer
    monkeypatch.setattr(timing, "process_time", None)
    with stage("force"):
        pass


def test_the_table_has_every_stage_in_order_its_share_and_the_total():
    written = io.StringIO()
    show_stages(in_order({"writing": 0.25, "flight_tuning": 0.75}), written)
    lines = [line.strip() for line in written.getvalue().splitlines()]
    assert lines[1].startswith("flight tuning  0.750   75 %  priors")
    assert lines[2].startswith("writing        0.250   25 %")
    assert lines[3] == "total          1.000  100 %"


def test_every_stage_has_words_in_the_table():
    words = tomllib.loads((files("forceid.report") / "stages.toml").read_text("utf-8"))
    assert tuple(words) == STAGES


def test_a_line_of_the_table_fits_on_a_terminal():
    written = io.StringIO()
    show_stages(dict.fromkeys(STAGES, 1.0), written)
    assert len(written.getvalue().splitlines()) == len(STAGES) + 2
