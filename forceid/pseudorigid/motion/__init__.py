"""Affine bodies in motion: the master system, its integrators, what ends a motion and what it keeps."""
