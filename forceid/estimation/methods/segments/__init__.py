"""A body of segments, a person or a machine: force and moment of all its mass, claimed by its joint gaps."""
