"""Loads that are known beforehand: what a recording says of them, and their motion taken out of it."""
