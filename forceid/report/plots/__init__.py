"""Figures of a result, and how they look."""
