"""Hostile files, odd surroundings, kills: what `forceid` makes of each, counted."""
