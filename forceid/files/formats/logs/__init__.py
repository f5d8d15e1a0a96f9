"""Logs of flight controllers: gyros and accelerometers, each recognized by how its files begin."""
