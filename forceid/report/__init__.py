"""The report: the numbers, the figures and one self-contained page."""
