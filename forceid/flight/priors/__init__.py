"""Priors of the loads on a body in flight."""
