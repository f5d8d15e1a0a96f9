"""Links inside of an HDF5 file, followed by hand: none leads out of it, none in a circle.

HDF5 opens the file that an external link names as soon as it is asked whether a name is there, and waits
forever where that is a pipe.
"""

from __future__ import annotations

from typing import Any

import h5py

from forceid.errors import DataError

HOPS = 32  # soft links in a row: people make one or two


def holds(group: Any, name: str, where: str) -> bool:
    """Whether a group has a member of that name. DataError: it lies in another file, or nowhere.

    where: names the file and the group, as in `toss.h5:` or `toss.h5:/motion`.
    """
    node, parts, hops, here = group, name.split("/"), 0, f"{where}/{name}"
    while parts:
        part = parts.pop(0)
        if part in ("", "."):
            continue
        if not isinstance(node, h5py.Group):
            return False
        try:
            link = node.get(part, getlink=True)
        except (KeyError, ValueError):
            link = None
        except TypeError:  # a link of a kind of its own
            link = h5py.ExternalLink("", "/")
        if link is None and not hops:
            return False
        if isinstance(link, h5py.ExternalLink):
            raise DataError(
                "is a link to another file, expected the data itself", here, "copy the data into the file"
            )
        if isinstance(link, h5py.SoftLink) and hops < HOPS:
            hops, node = hops + 1, node.file["/"] if link.path.startswith("/") else node
            parts = link.path.split("/") + parts
        elif isinstance(link, h5py.HardLink):
            node = node[part]
        else:
            raise DataError(
                "is damaged (a link that leads nowhere), expected the data itself", here, "copy it again"
            )
    return True
