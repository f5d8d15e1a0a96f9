"""Files: the motion and result schema, and the formats of laboratories."""
