"""Where the method is put together: a recording in, the applied wrench and a verdict out.

What may be used from outside stands in the stub beside; each name loads on first use.
"""

from forceid.face import on_first_use

__all__, __getattr__ = on_first_use(__name__, __file__)
