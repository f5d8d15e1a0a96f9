"""Where the method is put together: a recording in, the applied wrench and a verdict out.

What may be used from outside stands in the stub beside; each name loads on first use.
"""

from forceid.face import homes_in, on_first_use

_HOMES = homes_in(__file__)
__all__ = [*_HOMES]
__getattr__ = on_first_use(__name__, _HOMES)
