"""Paired speed ratios against the peers. Run all of it with `make bench`."""
