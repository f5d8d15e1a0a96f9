"""Laws of what pushes a body, air or ground, fitted to its motion, with no more terms than that asks for.

What may be used from outside stands in the stub beside; each name loads on first use.
"""

from forceid.face import on_first_use

__all__, __getattr__ = on_first_use(__name__, __file__)
