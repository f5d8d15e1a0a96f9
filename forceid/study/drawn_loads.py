"""The drawn loads of the scenes, under the name by which the key of a stress record asks for their source."""

from forceid.scenes.drawn_loads import ORDER, Drawn, draw

__all__ = ["ORDER", "Drawn", "draw"]
