"""Scenes that another simulator moves, MuJoCo: what forceid says of bodies that it had no part in making."""
