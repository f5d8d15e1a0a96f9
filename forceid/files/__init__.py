"""Files: the motion and result schema, and the formats of laboratories.

What may be used from outside stands in the stub beside; each name loads on first use.
"""

from forceid.face import on_first_use

__all__, __getattr__ = on_first_use(__name__, __file__)
