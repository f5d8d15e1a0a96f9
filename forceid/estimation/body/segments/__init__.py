"""Bodies of segments: what markers on each say of joints, and of the errors of mass points."""
