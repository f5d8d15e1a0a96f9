"""A chart of few contestants, that counts who answers."""

from dataclasses import replace

import pytest

from evidence.chart import run as chart
from evidence.chart.subjects import CHARTED


@pytest.fixture
def charting(monkeypatch):
    """Called with a subject, who takes part in it and what is not installed, gives who has answered."""
    asked, answered = [], chart.scored_answer

    def counted(subject, c, *rest):
        asked.append(c.name)
        return answered(subject, c, *rest)

    def few(name, contestants, missing=(), **more):
        taken = replace(CHARTED[name], contestants=lambda case: (list(contestants), list(missing)), **more)
        monkeypatch.setitem(CHARTED, name, taken)
        return asked

    monkeypatch.setattr(chart, "scored_answer", counted)
    monkeypatch.setattr(chart, "version", lambda *modules, **folders: "as it is")
    return few
