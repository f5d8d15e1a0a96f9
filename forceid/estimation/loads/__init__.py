"""Priors of force and moment: their channels, noise, lines, axes, order, and what could hide."""
