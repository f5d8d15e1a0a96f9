"""Records drawn at random, and whether what is claimed of them holds: a page of results each."""
