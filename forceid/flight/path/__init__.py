"""The path of a body in flight: linearized about it, and settled where it rests."""
