"""`forceid stress`: where each method breaks, and what forceid says there."""
