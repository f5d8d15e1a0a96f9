"""Polar and bipolar factors of deformations, and the 3 by 3 algebra below them."""
