"""The formats of laboratories, and from their channels to a recording."""
