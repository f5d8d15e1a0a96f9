"""What is charted and stressed: flights, bodies in parts, affine bodies."""
