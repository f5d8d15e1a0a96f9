"""Checks of values before any work rests on them: numbers, clocks, bodies, and what is told twice."""
