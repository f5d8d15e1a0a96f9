"""A body in air: what the air does to it, and laws of that which flights are fitted to.

What may be used from outside stands in the stub beside; each name loads on first use.
"""

from forceid.face import on_first_use

__all__, __getattr__ = on_first_use(__name__, __file__)
