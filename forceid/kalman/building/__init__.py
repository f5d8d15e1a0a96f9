"""Models built: priors of loads, structures, sensors and lines."""
