"""Bodies by name: tables of segments of persons, and mass properties that other programs write."""
