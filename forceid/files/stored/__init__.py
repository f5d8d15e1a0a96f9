"""What is stored, and how it is read without trust and written whole."""
