"""Beside theory: first moments on affine bodies, stiff bodies and their limit, a million unknowns."""
