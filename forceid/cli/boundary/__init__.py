"""Between the commands and what surrounds them: the terminal, interrupts, and every way to end."""
