"""What goes wrong with a flight and its record: a sweep each."""
