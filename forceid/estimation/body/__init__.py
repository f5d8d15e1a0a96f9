"""What moves, and how: inertia, mean motion, shapes, deformation; readings cleaned, gaps filled."""
