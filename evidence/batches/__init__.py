"""Batches that are killed, files that are damaged, and where time and memory go."""
