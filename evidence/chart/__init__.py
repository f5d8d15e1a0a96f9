"""`forceid chart`: accuracy against speed, every method and every peer, measured."""
