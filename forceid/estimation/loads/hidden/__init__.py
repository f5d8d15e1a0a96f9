"""What a record leaves open about loads: their priors, what is too fast or too faint, what turns inside."""
