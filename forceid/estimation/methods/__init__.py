"""Ways from a motion to a wrench: smoother, classic differentiation, sensors alone."""
