"""A body in flight as a state-space model: loads, turning, modes, and what sensors on it read."""
