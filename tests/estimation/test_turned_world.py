"""The same flight in a world that is turned: the same force and moment, turned."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.files.stored.hdf5 import read_motion

TURN = Rotation.from_euler("zyx", [0.7, -0.4, 1.1]).as_matrix()
SAME = 1e-5  # of a standard deviation: rounding, ten times over


@pytest.mark.parametrize("scene", ["flexible_boomerang_5_markers", "top"])
def test_a_world_that_is_turned_turns_force_and_moment(scene):
    """Of loads without lines: these are sought along axes of the laboratory, where supports stand."""
    recording = read_motion(f"data/synthetic/{scene}.h5")
    motion = recording.motion
    turned = replace(motion, position=motion.position @ TURN.T, gravity=TURN @ motion.gravity)
    one = estimate_recording(recording, load_settings())
    other = estimate_recording(replace(recording, motion=turned), load_settings())
    assert other.verdict.level == one.verdict.level
    for name in ("force", "moment"):
        off = np.linalg.norm(getattr(other, name) @ TURN - getattr(one, name), axis=1)
        assert np.nanmax(off / np.linalg.norm(getattr(one, f"{name}_std"), axis=1)) < SAME
