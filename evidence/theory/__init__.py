"""Beside theory: first moments of force on affine bodies, and a million unknowns in parts."""
