"""One toss of four markers with an accelerometer, as the files of laboratories hold it."""

import warnings

import h5py
import nptdms
import numpy as np
import pyuff

from forceid.errors import ForceIdError
from forceid.files.formats.sources import import_sources
from forceid.import_settings import ImportSettings
from forceid.sections import validate

N, RATE = 40, 200.0
TIME = np.arange(N) / RATE
NAMES = ("nose", "left", "right", "top")
SHAPE = np.array([[0.1, 0, 0], [-0.1, 0.1, 0], [-0.1, -0.1, 0], [0.1, 0, 0.1]])
POSITION = np.random.default_rng(0).standard_normal((N, 4, 3))
SPECIFIC_FORCE = np.random.default_rng(1).standard_normal((N, 3))
MASS = dict.fromkeys(NAMES, 0.02)


def settings(channels, **more):
    """Import settings with the channels given, checked."""
    return validate(ImportSettings, {"gravity": [0, 0, -9.81], "channels": channels} | more, "test:")


def brought(path, channels, **more):
    """The one recording in a file."""
    ((_, recording),) = import_sources([path], settings(channels, **{"body": {"mass": MASS}} | more))
    return recording


def refusal(read):
    """What a refusal says; nothing where there is none. Any other error passes."""
    try:
        read()
    except ForceIdError as error:
        return str(error)
    return ""


def write_mat73(path, variables):
    """A MAT file as MATLAB saves it with -v7.3: axes in reverse, structs as groups, cells as references."""
    with h5py.File(path, "w", userblock_size=512) as f:
        refs = f.create_group("#refs#")
        for name, value in variables.items():
            put(f, refs, name, value)
    with open(path, "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def put(group, refs, name, value):
    if isinstance(value, dict):
        struct = group.create_group(name)
        struct.attrs["MATLAB_class"] = np.bytes_("struct")
        for key, entry in value.items():
            put(struct, refs, key, entry)
    elif isinstance(value, str):
        item = group.create_dataset(name, data=np.array([list(map(ord, value))], "u2").T)
        item.attrs["MATLAB_class"] = np.bytes_("char")
    elif isinstance(value, tuple):
        targets = []
        for k, entry in enumerate(value):
            put(refs, refs, f"{name}{k}", entry)
            targets.append([refs[f"{name}{k}"].ref])
        item = group.create_dataset(name, data=np.array(targets, h5py.ref_dtype))
        item.attrs["MATLAB_class"] = np.bytes_("cell")
    else:
        item = group.create_dataset(name, data=np.atleast_2d(np.asarray(value, float)).T)
        item.attrs["MATLAB_class"] = np.bytes_("double")


def response(node, direction, data, quantity, unit="NONE", binary=0, **more):
    """A time response as pyuff writes it: function type 1 against time in s."""
    return {
        "type": 58, "binary": binary, "func_type": 1, "rsp_node": node, "rsp_dir": direction, "ref_node": 0,
        "ref_dir": 0, "data": np.asarray(data), "x": np.arange(len(data)) / RATE, "abscissa_spacing": 1,
        "abscissa_spec_data_type": 17, "abscissa_axis_units_lab": "s", "ordinate_spec_data_type": quantity,
        "ordinate_axis_units_lab": unit, "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0,
    } | more  # fmt: skip


def nodes(kind=2411):
    """The places of nodes 1 to 4."""
    ones = np.ones(4, int)
    x, y, z = SHAPE.T
    return {
        "type": kind, "node_nums": np.arange(1, 5), "def_cs": 0 * ones, "disp_cs": 0 * ones, "color": ones,
        "x": x, "y": y, "z": z,
    }  # fmt: skip


def units(length):
    """Units of a universal file: lengths to the meter."""
    return {
        "type": 164, "units_code": 9, "units_description": "lab", "temp_mode": 1, "length": length,
        "force": 1.0, "temp": 1.0, "temp_offset": 273.15,
    }  # fmt: skip


def write_uff(path, sets):
    """The datasets by pyuff's own writer."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves the file open that it writes 58b to
        pyuff.UFF(str(path)).write_sets(sets, mode="add")
    return path


def write_tdms(path, channels, group="capture"):
    """Channels (values, properties) by npTDMS' own writer."""
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [nptdms.ChannelObject(group, name, np.asarray(v), p) for name, (v, p) in channels.items()]
        )
    return path
