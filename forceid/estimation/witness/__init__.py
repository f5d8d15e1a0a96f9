"""The plainest defensible estimate, beside which every other one is held."""
