"""Drawn records by the thousand: how often forceid is right, careful for nothing, or wrong and silent."""
