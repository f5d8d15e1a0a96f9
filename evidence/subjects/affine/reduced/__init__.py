"""Second ways to the motion of an affine body, with rotations taken out: what charts cost beside F itself.

Each form is a module with a `simulate` of its own. Source: pseudo-rigid bodies, section 5.
"""
