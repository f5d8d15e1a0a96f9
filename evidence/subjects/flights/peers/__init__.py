"""Peers that find a load from motion: filters, splines, low passes."""
