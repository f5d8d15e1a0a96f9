"""A body in air: how air meets it, and what that does to it, with its uncertainty.

What may be used from outside stands in the stub beside; each name loads on first use.
"""

from forceid.face import on_first_use

__all__, __getattr__ = on_first_use(__name__, __file__)
