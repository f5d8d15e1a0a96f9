"""State and input of a system without a prior on the input, or a white one."""
