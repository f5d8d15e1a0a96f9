"""What the software of capture laboratories exports: one file a format, in one table (`table.py`)."""
