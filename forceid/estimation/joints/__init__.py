"""Bodies in parts: constraints, motion of the parts together, forces in the joints."""
