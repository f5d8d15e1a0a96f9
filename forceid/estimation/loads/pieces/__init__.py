"""Loads that change character: edges found by evidence, what is open of their places, and impulses."""
