"""Mean motion and loads of parts beside the solution: commands, momenta, transfer, resultants."""
