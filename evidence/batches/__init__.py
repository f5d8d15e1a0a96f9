"""Files that are damaged, and where time and memory of batches go."""
