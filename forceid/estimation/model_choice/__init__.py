"""Which level of deformation a recording needs: rigid, affine, or modes."""
