"""Where the method is put together: a recording in, the applied wrench and a verdict out."""
