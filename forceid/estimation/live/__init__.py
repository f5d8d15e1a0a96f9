"""Estimates while the motion goes on: one frame in, one wrench out, a fixed lag behind."""
