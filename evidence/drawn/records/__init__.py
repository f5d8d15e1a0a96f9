"""Records that several studies draw, and how an estimate of one is scored."""
