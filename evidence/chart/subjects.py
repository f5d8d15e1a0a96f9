"""The subjects of the chart, in the order of its page."""

from __future__ import annotations

from evidence.subjects.affine.chart import AFFINE
from evidence.subjects.flights.chart import FLIGHTS
from evidence.subjects.parts.chart import PARTS

CHARTED = {subject.name: subject for subject in (FLIGHTS, PARTS, AFFINE)}
