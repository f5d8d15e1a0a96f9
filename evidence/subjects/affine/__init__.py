"""Affine bodies: motions with a closed form, ways to them, and what goes wrong."""
