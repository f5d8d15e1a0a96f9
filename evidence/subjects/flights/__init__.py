"""Bodies in flight: records, methods and peers, and what goes wrong."""
