"""Bodies in parts: manufactured solutions, solvers, and what goes wrong."""
