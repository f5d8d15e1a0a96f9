"""What counts as zero in arithmetic with doubles of 16 digits: each tolerance of rounding is one of these."""

from __future__ import annotations

ROUNDED = 1e-12  # of the largest term: what sums of thousands of products leave of zero, 4500 roundoffs
SOLVED = 1e-9  # of the largest entry: what solving leaves of zero, which multiplies roundoff by a condition
SINGLE = 1e-6  # of the size: numbers that went through single precision, as files hold them, agree to it
COMPLEX_STEP = 1e-30  # imaginary step of a derivative: its square is lost beside any real part
CENTRAL_STEP = 6e-6  # relative, of central differences: cube root of roundoff, where both errors are alike
HARMLESS = 1e4  # condition that takes four digits of sixteen: none that counts
ITERATIONS = 40  # of what settles in ten, at most
