"""Recordings too large to hold, and too long for one pass."""
