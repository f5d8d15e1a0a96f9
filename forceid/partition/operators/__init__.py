"""What parts do to vectors: stiffness, inverses, interface maps, preconditioners, projection."""
