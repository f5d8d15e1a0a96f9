"""Whether claimed uncertainty is honest, counted on flights of known truth: tables that are printed."""
