"""Joint forces of chains in free flight: recovered within their claims, or refused with a reason."""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import forceid
from forceid.cli.app import main
from forceid.config import Settings
from forceid.errors import ConfigError
from forceid.estimation.joints import linked_smoothing, linked_tuning
from forceid.estimation.joints import together as joint_smoothing
from forceid.estimation.joints.forces import joint_forces
from forceid.estimation.joints.linked_smoothing import overlapping_windows
from forceid.estimation.run import estimate_recording, estimate_whole
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import judge
from forceid.files.result import read_result, read_truth, write_result
from forceid.files.tree import tree_from_recording
from forceid.records import Motion, Recording
from forceid.scenes.flights import hinged

ROOT = Path(__file__).parents[3]
NOISE = 3e-4  # m
TIME = np.arange(150) / 200.0
LONG = np.arange(150) / 200.0
INNER = slice(19, -19)
BAND = 2.58  # standard deviations: 99 %
INDEPENDENT = 10  # errors of each component in a long record, one every 15 samples


def chain(seed, blocks=2, **changes):
    """A chain of hinge and ball, thrown and driven in a way of its own."""
    rng = np.random.default_rng(100 + seed)
    joints = blocks - 1
    given = {
        "mass": (0.4, 0.25, 0.3)[:blocks],
        "size": ((0.24, 0.12, 0.08), (0.18, 0.1, 0.06), (0.2, 0.1, 0.08))[:blocks],
        "joint": ("hinge", "ball")[:joints],
        "axis": tuple(map(tuple, rng.standard_normal((joints, 3)))),
        "stiffness": (0.6,) * joints,
        "damping": (0.004,) * joints,
        "swing": tuple(rng.uniform(-8, 8, joints)),
        "spin": tuple(rng.uniform(-6, 6, 3)),
        "turn": tuple(rng.uniform(-1, 1, 3)),
        "drive": 0.1,
        "drawn_frequency": 2.0,
        "drawn_seed": seed,
    }
    return hinged.Parameters(**(given | changes))


def seen(parameters, seed, noise=NOISE, time=TIME):
    """The chain as markers show it."""
    flight, rng = hinged.fly(parameters, time), np.random.default_rng(seed)
    x = flight.position + noise * rng.standard_normal(flight.position.shape)
    stated = {"position": noise} if noise else {}
    body = replace(flight.body, internal_momentum=np.zeros(3))
    return Recording(body, Motion(time, x, gravity=flight.gravity, noise_std=stated), flight.truth)


def jointed(parameters, external=(), driven=True, **changes):
    """The settings that say what is a part and what a joint."""
    names = "abc"[: len(parameters.mass)]
    ends = np.cumsum(np.array(parameters.size)[:, 0])
    part = [{"name": n, "nodes": [f"{n}{k}" for k in range(1, 9)], "external": n in external} for n in names]
    joint = [
        {
            "name": f"joint_{j}",
            "parts": tuple(names[j : j + 2]),
            "at": (ends[j], 0.0, 0.0),
            "kind": kind,
            "axis": parameters.axis[j],
            "driven": driven,
        }
        for j, kind in enumerate(parameters.joint)
    ]
    return Settings.model_validate({"part": part, "joint": joint, "model": "rigid"} | changes)


def errors(found, truth):
    """Errors of the joint wrenches (time, joint, 6)."""
    force, moment = found.force - truth["joint_force"], found.moment - truth["joint_moment"]
    return np.concatenate([force, moment], -1)


def rms(a):
    return float(np.sqrt(np.mean(np.square(a))))


def mean_nees(found, truth):
    """Squared errors by the claimed covariance, per degree of freedom."""
    e = errors(found, truth)
    return float(np.mean(np.einsum("tji,tjik,tjk->tj", e, np.linalg.inv(found.wrench_cov), e)) / 6)


@cache
def drawn_chains(blocks):
    """Two or three blocks under drawn motors: what is found of their joints, and the truth."""
    records = []
    for seed in range(4 - blocks):
        parameters = chain(seed, blocks)
        recording = seen(parameters, seed, time=LONG)
        records.append((joint_forces(recording, jointed(parameters), estimate_whole), recording.truth))
    return records


@pytest.mark.long
@pytest.mark.parametrize("blocks", [2, 3])
def test_joint_force_and_moment_are_off_by_what_they_claim_and_no_more(blocks):
    off = [errors(found, truth)[INNER] for found, truth in drawn_chains(blocks)]
    std = [np.concatenate([f.force_std, f.moment_std], -1)[INNER] for f, _ in drawn_chains(blocks)]
    for part in (slice(0, 3), slice(3, 6)):
        claimed = rms([s[..., part] for s in std])
        assert rms([e[..., part] for e in off]) < 1.3 * claimed
        loads = [
            truth["joint_force" if part.start == 0 else "joint_moment"] for _, truth in drawn_chains(blocks)
        ]
        assert claimed < 0.1 * rms(loads)


@pytest.mark.long
@pytest.mark.parametrize("blocks", [2, 3])
def test_nees_of_drawn_joint_loads_is_no_larger_than_its_band(blocks):
    scores = [mean_nees(found, truth) for found, truth in drawn_chains(blocks)]
    told = 6 * INDEPENDENT * len(scores) * (blocks - 1)
    # claims allow for what the record does not tell of its priors: the errors are often smaller
    assert np.mean(scores) - 1 < BAND * np.sqrt(2 / told)
    assert all(found.verdict.level != "refused" for found, _ in drawn_chains(blocks))


@pytest.mark.long
@pytest.mark.parametrize("blocks", [2, 3])
def test_joints_under_a_fast_drive_err_by_what_they_claim(blocks):
    """Drives of 6 Hz on a slow swing: what keeps the joints together may not be a second prior of these."""
    squares = []
    for seed in range(530, 533):
        parameters = chain(seed, blocks, drawn_frequency=6.0)
        recording = seen(parameters, seed, time=LONG)
        found = joint_forces(recording, jointed(parameters), estimate_whole)
        assert found.verdict.level == "ok"
        off, std = errors(found, recording.truth), np.concatenate([found.force_std, found.moment_std], -1)
        ratios = [rms(off[INNER][..., own]) / rms(std[INNER][..., own]) for own in (slice(0, 3), slice(3, 6))]
        assert max(ratios) < 2.0
        squares.append(np.square(ratios))
    assert 0.7 < np.sqrt(np.mean(squares)) < 1.4


@pytest.mark.long
def test_what_joints_keep_of_the_motion_makes_forces_several_times_more_accurate(monkeypatch):
    parameters = chain(0)
    recording = seen(parameters, 0, time=LONG)
    linked, truth = drawn_chains(2)[0]
    monkeypatch.setattr("forceid.estimation.joints.forces.smooth_linked_parts", lambda *_: (None, []))
    apart = joint_forces(recording, jointed(parameters), estimate_whole)
    assert rms(errors(apart, truth)[INNER, ..., :3]) > 2 * rms(errors(linked, truth)[INNER, ..., :3])
    assert rms(apart.force_std[INNER]) > 1.5 * rms(linked.force_std[INNER])


@pytest.mark.long
def test_parts_whose_covariance_is_lost_to_rounding_are_not_smoothed_together(monkeypatch):
    parameters = chain(0)
    recording = seen(parameters, 0, time=TIME[:80])
    monkeypatch.setattr(linked_tuning, "likeliest", lambda _, start, turned: start)
    monkeypatch.setattr(joint_smoothing, "smooth_linked", lost)
    found = joint_forces(recording, jointed(parameters), estimate_whole)
    monkeypatch.setattr("forceid.estimation.joints.forces.smooth_linked_parts", lambda *_: (None, []))
    apart = joint_forces(recording, jointed(parameters), estimate_whole)
    assert np.isfinite(found.wrench_cov).all()
    np.testing.assert_array_equal(found.force, apart.force)


def test_a_light_part_that_knows_its_wrench_better_alone_contradicts_no_chain():
    time, tight, wide = 50, np.tile(np.eye(6), (50, 1, 1)), np.tile(400.0 * np.eye(6), (50, 1, 1))
    alone = SimpleNamespace(force=np.zeros((time, 3)), moment=np.zeros((time, 3)), wrench_cov=tight)
    moved = np.full((time, 1, 6), 10.0)
    assert not joint_smoothing.contradicted(moved, wide, [alone])
    assert joint_smoothing.contradicted(moved, tight, [alone])


def lost(flight, bending, engine):
    """A smoothing of which rounding leaves no covariance."""
    size = 6 * len(flight.parts)
    wrench = np.zeros((len(flight.constraints.gap), len(flight.parts), 6))
    return wrench, np.full((len(wrench), size, size), np.nan)


@pytest.mark.long
def test_a_ball_said_to_be_a_hinge_is_noticed_and_not_held_as_one():
    parameters = chain(2, drive=0.0, joint=("ball",), stiffness=(0.0,), damping=(0.0,), swing=(0.0,))
    parameters = parameters.model_copy(update={"axis": ((0.0, 0.0, 1.0),), "stiffness": (0.3,)})
    recording = seen(parameters.model_copy(update={"swing": (6.0,)}), 2)
    settings = jointed(parameters)
    hinge = settings.joint[0].model_copy(update={"kind": "hinge", "axis": (0.0, 1.0, 0.0), "driven": True})
    found = joint_forces(recording, settings.model_copy(update={"joint": (hinge,)}), estimate_whole)
    assert any("as a hinge does not let" in reason for reason in found.verdict.reasons)
    assert rms(errors(found, recording.truth)[INNER][..., :3]) < 0.1 * rms(recording.truth["joint_force"])


@pytest.fixture(scope="module")
def exact():
    """Motion without noise, of a chain that nothing drives."""
    parameters = chain(3, drive=0.0)
    return parameters, seen(parameters, 0, noise=0.0, time=TIME[:80])


@pytest.mark.long
def test_exact_motion_shows_joint_forces_all_but_exactly(exact):
    parameters, recording = exact
    found = joint_forces(recording, jointed(parameters), estimate_whole)
    e = errors(found, recording.truth)[INNER]
    assert np.abs(e[..., :3]).max() < 1e-3 * np.abs(recording.truth["joint_force"]).max()
    assert np.abs(e[..., 3:]).max() < 1e-3 * np.abs(recording.truth["joint_moment"]).max()
    np.testing.assert_allclose(found.point, recording.truth["joint_point"], atol=1e-6)
    assert np.abs(found.gap).max() < 1e-5


@pytest.mark.long
def test_a_ball_passes_no_moment_and_a_hinge_none_about_its_axis():
    parameters = chain(1, 3, drive=0.0, stiffness=(0.0, 0.0), damping=(0.0, 0.0))
    recording = seen(parameters, 1)
    found = joint_forces(recording, jointed(parameters, driven=False, method="savgol"), estimate_whole)
    assert found.dof == 18 - 5 - 3
    assert np.abs(found.moment[:, 1]).max() < 1e-12
    assert rms(errors(found, recording.truth)[INNER][..., :3]) < 0.1 * rms(recording.truth["joint_force"])


@pytest.fixture(scope="module")
def pushed():
    """Two blocks of which the first is pushed."""
    parameters = chain(2, push=1.5, drive=0.0)
    return parameters, seen(parameters, 2)


@pytest.mark.long
def test_a_push_that_nobody_states_is_noticed(pushed):
    parameters, recording = pushed
    found = joint_forces(recording, jointed(parameters), estimate_whole)
    assert found.verdict.level == "refused"
    assert any("balances of the parts do not close" in reason for reason in found.verdict.reasons)
    assert found.consistency > 25


@pytest.mark.long
def test_a_push_on_a_part_named_external_leaves_the_joint_force_to_the_other(pushed):
    parameters, recording = pushed
    alone = {}

    def solve(recording, settings):
        alone[recording.title] = estimate_whole(recording, settings)
        return alone[recording.title]

    found = joint_forces(recording, jointed(parameters, external="a", method="spline"), solve)
    own = alone["b"][0]
    assert found.dof == 0
    assert np.isnan(found.consistency)
    np.testing.assert_allclose(found.force[:, 0], own.force, atol=1e-9)
    arm = own.center - found.point[:, 0]
    np.testing.assert_allclose(found.moment[:, 0], own.moment + np.cross(arm, own.force), atol=1e-9)
    e, truth = errors(found, recording.truth)[INNER], recording.truth
    assert rms(e[..., :3]) < 0.1 * rms(truth["joint_force"])


@pytest.mark.long
def test_a_loop_of_welds_is_said_to_hide_its_joints_and_a_tree_beside_it_is_told():
    parameters = chain(0, 3, drive=0.0)
    recording = seen(parameters, 0)
    settings = jointed(parameters, method="difference")
    back = settings.joint[0].model_copy(update={"name": "strut", "at": (0.24, 0.05, 0.0)})
    settings = settings.model_copy(update={"joint": (*settings.joint, back)})
    found = joint_forces(recording, settings, estimate_whole)
    assert found.determined.tolist() == [False, True, False]
    assert np.isnan(found.force[:, [0, 2]]).all()
    assert np.isfinite(found.force[:, 1]).all()
    assert found.null_space.shape == (3, 6, 6)
    np.testing.assert_allclose(found.null_space[0], -found.null_space[2], atol=1e-9)
    assert any("joint_0, strut: the joints close a loop" in reason for reason in found.verdict.reasons)


@pytest.mark.long
def test_a_joint_put_in_the_wrong_place_is_noticed():
    parameters = chain(0)
    settings = jointed(parameters, method="spline")
    joint = settings.joint[0].model_copy(update={"at": (0.30, 0.0, 0.0)})
    found = joint_forces(seen(parameters, 0), settings.model_copy(update={"joint": (joint,)}), estimate_whole)
    assert any("apart at joint joint_0" in reason for reason in found.verdict.reasons)


@pytest.mark.long
def test_a_part_that_is_refused_takes_the_joints_with_it():
    parameters = chain(0)

    def solve(recording, settings):
        estimate, solution = estimate_whole(recording, settings)
        if recording.title == "a":
            return estimate, solution
        return replace(estimate, verdict=judge([note("no-mass-center")])), None

    found = joint_forces(seen(parameters, 0), jointed(parameters, method="difference"), solve)
    assert found.verdict.level == "refused"
    assert found.verdict.findings[-1].cause == ("no-mass-center", "b")
    assert found.verdict.reasons[-1].startswith("part b: no frame shows the mass center")
    assert np.isnan(found.force).all()
    assert not found.determined.any()


def part(name, *nodes, **more):
    return {"name": name, "nodes": nodes or tuple(f"{name}{k}" for k in range(1, 9)), **more}


def joint(first="a", second="b", at="a5", **more):
    return {"name": "hinge", "parts": (first, second), "at": at, **more}


A, B, J = part("a"), part("b"), joint()


@pytest.mark.parametrize(
    ("parts", "joints", "message"),
    [
        ([part("a", "a1", "a2", "a9"), B], [J], "part a names the unknown node 'a9'; did you mean 'a"),
        ([A, part("b", 8, 9, 16)], [J], "part b names node 16, of 16"),
        (
            [A, part("b", "b1", "b2", mass=1.0, center=(0, 0, 0), inertia=np.eye(3))],
            [J],
            "b has 2 markers seen",
        ),
        ([A, part("b", *B["nodes"], mass=1.0)], [J], "part b has no center"),
        (
            [A, part("b", *B["nodes"], mass=1.0, center=(0, 0, 0), inertia=-np.eye(3))],
            [J],
            "that no body has",
        ),
        ([A, part("b", "b1", "b2", "b3")], [J], "leave out node 'b4', which carries 0.03125 kg"),
        ([A, part("b", "a1", *B["nodes"])], [J], "name node 'a1' more than once"),
        ([A, A], [J], "part a is named twice"),
        ([A, B], [], "stands without a joint"),
        ([A, B], [joint(second="c")], "joint hinge names the unknown part 'c'; did you mean"),
        ([A, B], [joint(second="a")], "joint hinge holds 'a' to itself"),
        ([A, B], [joint(at="c1")], "joint hinge names the unknown node 'c1'"),
        ([A, B], [joint(kind="hinge")], "joint hinge is a hinge without an axis"),
        ([A, B], [J, J], "joint hinge is named twice"),
        ([part("a", *A["nodes"][:4]), part("c", *A["nodes"][4:]), B], [J], "part c is held by no joint"),
    ],
)
def test_parts_and_joints_that_do_not_fit_are_one_line(parts, joints, message):
    parts = [{k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in p.items()} for p in parts]
    settings = Settings.model_validate({"part": parts, "joint": joints})
    recording = seen(chain(0), 0, time=TIME[:5])
    with pytest.raises(ConfigError, match=message) as error:
        joint_forces(recording, settings, estimate_whole)
    assert "\n" not in str(error.value)


@pytest.mark.long
def test_a_part_may_be_given_with_its_mass_and_without_the_masses_of_its_nodes():
    parameters = chain(0)
    recording = seen(parameters, 0)
    settings = jointed(parameters, method="spline")
    expected = joint_forces(recording, settings, estimate_whole)
    J = hinged.chain_constants(parameters).inertia[1].tolist()
    b = {"name": "b", "nodes": range(8, 16), "mass": 0.25, "center": (0.33, 0.0, 0.0), "inertia": J}
    told = settings.model_dump(mode="json") | {"part": [settings.part[0].model_dump(mode="json"), b]}
    found = joint_forces(recording, Settings.model_validate(told), estimate_whole)
    np.testing.assert_allclose(found.force, expected.force, atol=0.02)


@pytest.mark.long
def test_long_records_are_smoothed_in_stretches_that_agree(monkeypatch):
    monkeypatch.setattr(linked_tuning, "likeliest", lambda _, start, turned: start)
    parameters = chain(1)
    recording = seen(parameters, 1)
    solved = {}

    def solve(recording, settings):
        if recording.title not in solved:
            solved[recording.title] = estimate_whole(recording, settings)
        return solved[recording.title]

    whole = joint_forces(recording, jointed(parameters), solve)
    monkeypatch.setattr(linked_smoothing, "ROOM", 1)
    monkeypatch.setattr(linked_smoothing, "FLIGHT_SAMPLES", 120)
    pieces = joint_forces(recording, jointed(parameters), solve)
    assert len(list(overlapping_windows(150, 120))) == 2
    assert rms(pieces.force - whole.force) < 0.1 * rms(whole.force_std)
    np.testing.assert_allclose(pieces.force_std, whole.force_std, rtol=0.1)


@pytest.mark.long
def test_the_whole_body_stays_as_it_is_and_the_file_holds_the_joints(tmp_path):
    parameters = chain(0)
    recording = seen(parameters, 0, time=TIME[:60])
    settings = jointed(parameters, method="difference")
    plain = estimate_recording(recording, settings.model_copy(update={"part": (), "joint": ()}))
    result = estimate_recording(recording, settings)
    np.testing.assert_array_equal(result.force, plain.force)
    assert plain.interface is None
    write_result(tmp_path / "r.h5", result, recording)
    read = read_result(tmp_path / "r.h5").interface
    for name, value in vars(result.interface).items():
        back = getattr(read, name)
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(back, value, err_msg=name)
        else:
            assert back == value, name
    tree = forceid.estimate(tree_from_recording(recording), **settings.model_dump(exclude_defaults=True))
    joints = tree["interface"]
    np.testing.assert_array_equal(joints["force"], result.interface.force)
    assert joints["force"].dims == ("time", "joint", "axis")
    assert joints["moment"].attrs["units"] == "N m"
    assert joints["joint"].values.tolist() == ["joint_0"]
    assert joints.attrs["moment_about"] == "the point of the joint"


@pytest.mark.long
def test_the_command_says_what_passes_through_the_hinge(tmp_path, capsys):
    data, config = ROOT / "data/synthetic/two_blocks.h5", ROOT / "config/two_blocks.toml"
    out = tmp_path / "out.h5"
    words = [
        "estimate",
        str(data),
        "-c",
        str(config),
        "-o",
        str(out),
        "--method",
        "spline",
        "--model",
        "rigid",
    ]
    assert main(words) == 0
    line = next(x for x in capsys.readouterr().out.splitlines() if x.startswith("joint "))
    assert re.fullmatch(r"joint    hinge, left on right: [\d.]+ ± [\d.]+ N, [\d.]+ ± [\d.]+ N m rms", line)
    found, truth = read_result(out).interface, read_truth(out)
    assert found.parts == (("left", "right"),)
    assert rms(errors(found, truth)[16:-16][..., :3]) < 0.1 * rms(truth["joint_force"])
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["interface"]
    assert told["joint"][0]["name"] == "hinge"
    assert told["joint"][0]["force"] == pytest.approx(rms(np.linalg.norm(found.force, axis=-1)))
    config = tmp_path / "bad.toml"
    parts = '[[part]]\nname = "left"\nnodes = ["a1", "a2", "z"]\n'
    config.write_text(parts + '[[joint]]\nname = "j"\nparts = ["left", "x"]\nat = "a1"\n')
    assert main(["estimate", str(data), "-c", str(config)]) == 2
    assert "part left names the unknown node 'z'" in capsys.readouterr().err
