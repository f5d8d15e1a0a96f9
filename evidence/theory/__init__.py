"""What theory says beside what forceid computes: printed values, bounds, orders, conditions."""
