"""Motions in closed form, steady motions and their spectra."""
