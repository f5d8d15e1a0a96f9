"""Studies: accuracy against speed of every method, and where each of them breaks."""
