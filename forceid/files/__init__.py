"""Files: the motion and result schema, and the formats of laboratories.

What may be used from outside; each name loads on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forceid.face import on_first_use

_HOMES = {
    "read_motion": "forceid.files.stored.hdf5",
    "write_motion": "forceid.files.stored.hdf5",
    "stamp": "forceid.files.stored.hdf5",
    "open_motion": "forceid.files.tree",
    "recording_from_tree": "forceid.files.tree",
    "tree_from_estimate": "forceid.files.tree",
    "read_result": "forceid.files.result",
    "write_result": "forceid.files.result",
    "read_truth": "forceid.files.result",
    "read_title": "forceid.files.result",
    "is_result": "forceid.files.result",
    "frames_from_lines": "forceid.files.formats.frame_lines",
    "growing_lines": "forceid.files.formats.frame_lines",
    "growing_file": "forceid.files.stored.growing",
    "import_sources": "forceid.files.formats.sources",
    "load_import_settings": "forceid.files.formats.sources",
}
__all__ = [*_HOMES]

if TYPE_CHECKING:
    from forceid.files.formats.frame_lines import frames_from_lines as frames_from_lines
    from forceid.files.formats.frame_lines import growing_lines as growing_lines
    from forceid.files.formats.sources import import_sources as import_sources
    from forceid.files.formats.sources import load_import_settings as load_import_settings
    from forceid.files.result import is_result as is_result
    from forceid.files.result import read_result as read_result
    from forceid.files.result import read_title as read_title
    from forceid.files.result import read_truth as read_truth
    from forceid.files.result import write_result as write_result
    from forceid.files.stored.growing import growing_file as growing_file
    from forceid.files.stored.hdf5 import read_motion as read_motion
    from forceid.files.stored.hdf5 import stamp as stamp
    from forceid.files.stored.hdf5 import write_motion as write_motion
    from forceid.files.tree import open_motion as open_motion
    from forceid.files.tree import recording_from_tree as recording_from_tree
    from forceid.files.tree import tree_from_estimate as tree_from_estimate


__getattr__ = on_first_use(__name__, _HOMES)
