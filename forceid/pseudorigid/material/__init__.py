"""Hyperelastic materials: what they are, and which ones there are."""
