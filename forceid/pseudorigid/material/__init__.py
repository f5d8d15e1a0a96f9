"""Hyperelastic materials: what they are, which ones there are, and checks of what they claim."""
