"""forceid: what pushed a body, from how it moved.

The public names load on first use, so that `import forceid` costs no scipy.

>>> import forceid
>>> "estimate" in dir(forceid)
True
"""

from __future__ import annotations

from forceid.face import on_first_use

try:
    from forceid._version import __version__  # written by the build, from the tag
except ImportError:
    __version__ = "0.1.0.dev0"  # a tree that was never built

_public, __getattr__ = on_first_use(__name__, __file__)
__all__ = ["__version__", *_public]


def __dir__() -> list[str]:
    return sorted(__all__)
