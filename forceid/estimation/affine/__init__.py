"""Force, moment and first moments of a body that deforms affinely."""
