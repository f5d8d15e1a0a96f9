"""What is said of parts and joints before any force is estimated."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forceid.cli.app import main
from forceid.config import Settings
from forceid.errors import ConfigError
from forceid.estimation.inspection import inspect_recording
from forceid.estimation.joints.forces import joint_forces
from forceid.estimation.joints.inspection import inspect_linkage
from forceid.estimation.run import estimate_whole
from forceid.records import Motion, Recording
from forceid.scenes.flights import hinged

ROOT = Path(__file__).parents[3]
DATA, CONFIG = ROOT / "data/synthetic/two_blocks.h5", ROOT / "config/two_blocks.toml"
TIME = np.arange(60) / 200.0
SIZE, WIDTH = 0.2, (0.2, 0.1, 0.06)


def row(blocks, noise=3e-4, axis=(0.0, 0.0, 1.0), **changes):
    """Blocks hinged in a row, tumbling, as markers show them."""
    joints = blocks - 1
    given = {
        "mass": (0.3,) * blocks,
        "size": (WIDTH,) * blocks,
        "joint": ("hinge",) * joints,
        "axis": (axis,) * joints,
        "stiffness": (0.0,) * joints,
        "damping": (0.0,) * joints,
        "swing": (6.0, -8.0, 5.0)[:joints],
    }
    flight = hinged.fly(hinged.Parameters(**(given | changes)), TIME)
    x = flight.position + noise * np.random.default_rng(4).standard_normal(flight.position.shape)
    stated = {"position": noise} if noise else {}
    return Recording(flight.body, Motion(TIME, x, gravity=flight.gravity, noise_std=stated))


def joint(name, first, second, x, kind="weld", z=0.0, **more):
    return {"name": name, "parts": (first, second), "at": (x, 0.0, z), "kind": kind, **more}


def told(*joints, external=(), blocks=2):
    """The settings of these joints between blocks a, b, c ..."""
    names = "abcd"[:blocks]
    parts = [{"name": n, "nodes": [f"{n}{k}" for k in range(1, 9)], "external": n in external} for n in names]
    return Settings.model_validate({"part": parts, "joint": joints, "model": "rigid", "method": "difference"})


AXIS = {"axis": (0.0, 0.0, 1.0)}


@pytest.mark.long
def test_a_tree_is_told_and_the_balances_beyond_it_are_counted():
    settings = told(
        joint("j", "a", "b", SIZE, "hinge", **AXIS), joint("k", "b", "c", 2 * SIZE, "ball"), blocks=3
    )
    recording = row(3)
    found = inspect_linkage(recording, settings)
    assert (found.loops, found.resultants, found.told, found.spare) == (0, 8, 8, 10)
    assert [(j.passes, j.told, j.open) for j in found.joint] == [(5, 5, ()), (3, 3, ())]
    assert [(p.mass_kg, p.nodes, p.seen_nodes, p.force, p.moment) for p in found.part] == [
        (pytest.approx(0.3), 8, 8, True, True)
    ] * 3
    assert found.warnings == ()
    assert found.spare == joint_forces(recording, settings, estimate_whole).dof


@pytest.mark.long
def test_a_loop_of_welds_hides_its_joints_and_the_sentence_is_that_of_the_verdict():
    settings = told(
        joint("j", "a", "b", SIZE),
        joint("k", "b", "c", 2 * SIZE),
        joint("strut", "a", "b", SIZE, z=0.02),
        blocks=3,
    )
    recording = row(3)
    found = inspect_linkage(recording, settings)
    assert (found.loops, found.resultants, found.told) == (1, 18, 12)
    assert [j.told for j in found.joint] == [0, 6, 0]
    assert found.trading == (("j", "strut"),)
    assert any("j, strut: wrenches round them" in line for line in found.summary)
    assert len(found.warnings) == 1
    assert found.warnings[0] in joint_forces(recording, settings, estimate_whole).verdict.reasons


def test_what_is_open_is_named_in_the_axes_of_the_part():
    hinges = (
        joint("lower", "a", "b", SIZE, "hinge", **AXIS),
        joint("upper", "a", "b", SIZE, "hinge", z=0.03, **AXIS),
    )
    found = inspect_linkage(row(2), told(*hinges))
    assert [j.open for j in found.joint] == [
        ("force x", "force y", "force z", "moment x", "moment y"),
    ] * 2
    assert "open: force x, y, z; moment x, y in the axes of a" in found.summary[2]
    assert found.told == 10 - 5


@pytest.mark.long
def test_loads_from_outside_on_every_part_leave_the_joint_open():
    found = inspect_linkage(row(2), told(joint("j", "a", "b", SIZE), external="ab"))
    assert (found.loops, found.resultants, found.told, found.spare) == (0, 18, 12, 0)
    assert found.joint[0].told == 0
    assert any("through it that loads from outside balance" in line for line in found.summary)
    one = inspect_linkage(row(2), told(joint("j", "a", "b", SIZE), external="a"))
    assert (one.told, one.joint[0].told, one.warnings) == (12, 6, ())


@pytest.mark.long
@pytest.mark.parametrize("noise", [0.0, 3e-4], ids=["exact", "noisy"])
def test_noise_that_alone_opens_a_loop_counts_as_none(noise):
    """A plane linkage of three hinges and a ball: a force across the plane goes round, whatever the noise."""
    hinges = [
        joint(name, *pair, (k + 1) * SIZE, "hinge", **AXIS)
        for k, (name, *pair) in enumerate(("1ab", "2bc", "3cd"))
    ]
    recording = row(4, noise)
    settings = told(*hinges, joint("ball", "d", "a", 0.1, "ball"), blocks=4)
    found = inspect_linkage(recording, settings)
    assert (found.loops, found.resultants, found.told) == (1, 18, 17)
    assert found.joint[-1].open == ("force z",)
    hidden = [text for text in found.warnings if "all but hides" in text]
    assert len(hidden) == (noise > 0)


def test_a_joint_put_in_the_wrong_place_is_noticed():
    found = inspect_linkage(row(2), told(joint("j", "a", "b", SIZE + 0.05)))
    assert any("apart at joint j" in text for text in found.warnings)


def test_parts_that_no_frame_shows_together_promise_nothing():
    recording = row(2)
    assert recording.motion.position is not None
    x = recording.motion.position.copy()
    x[:30, :8], x[30:, 8:] = np.nan, np.nan
    found = inspect_linkage(
        replace(recording, motion=replace(recording.motion, position=x)), told(joint("j", "a", "b", SIZE))
    )
    assert (found.told, found.joint[0].told, found.spare) == (0, 0, 0)
    assert found.warnings[-1] == "no frame shows the poses of all parts: no joint force follows"


def test_whole_bodies_have_no_linkage_and_parts_that_do_not_fit_are_an_error():
    recording = row(2)
    assert inspect_recording(recording, Settings()).linkage is None
    with pytest.raises(ConfigError, match="unknown part 'c'"):
        inspect_recording(recording, told(joint("j", "a", "c", SIZE)))


def test_the_command_says_parts_joints_and_what_is_told(capsys):
    assert main(["inspect", str(DATA), "-c", str(CONFIG)]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "part left: 0.4 kg, 8 nodes, 8 with markers; force and moment can be identified" in out
    assert "joint hinge, left on right: driven hinge at (0.24, 0, 0) m, passes 6 resultants, all told" in out
    assert "2 parts, 1 joint in a tree: 6 of 6 resultants are told; 6 balances are left to test them" in out
    assert main(["inspect", str(DATA), "-c", str(CONFIG), "--json"]) == 0
    linkage = json.loads(capsys.readouterr().out)["linkage"]
    assert [part["name"] for part in linkage["part"]] == ["left", "right"]
    assert linkage["joint"][0]["parts"] == ["left", "right"]
    assert (linkage["loops"], linkage["told"], linkage["spare"]) == (0, 6, 6)
    assert main(["inspect", str(DATA), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["linkage"] is None
