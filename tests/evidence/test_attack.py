"""A short sample of the battery: contradictions are told, hostile files and damaged ones end in one line."""

import pytest

from evidence.attack import bodies, contradictions, damaged, files, outputs, surroundings, units
from evidence.attack.watched import forked, warm


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("attack").resolve()
    warm(path)
    return path


REFUSED = [
    kind for kind in contradictions.KINDS if kind in [*contradictions.MASSES, *contradictions.SPRINGS][:18]
]


@pytest.mark.long
@pytest.mark.parametrize("kind", REFUSED, ids=lambda kind: kind.name)
def test_a_body_that_contradicts_itself_is_refused_or_doubted(folder, kind):
    path = bodies.write(folder / "c.h5", kind.base, kind.edit)
    end = forked(["inspect", path.name], folder)
    assert end.faults(path.name) == []
    assert end.code == 3 or "lighter than any" in end.out.replace("\n         ", " ")


@pytest.mark.parametrize("kind", contradictions.CLOCKS[:5], ids=lambda kind: kind.name)
def test_a_clock_that_no_recording_has_is_refused_at_once(folder, kind):
    path = bodies.write(folder / "c.h5", kind.base, kind.edit)
    end = forked(["estimate", path.name], folder, patience=10)
    assert end.code == 3
    assert f"{path.name}:/motion/time " in end.last


@pytest.mark.parametrize(
    "kind", [kind for kind in contradictions.OF_MOTIONS if kind.base == "both"], ids=lambda kind: kind.name
)
def test_a_pose_that_the_markers_deny_is_said(folder, kind):
    path = bodies.write(folder / "c.h5", kind.base, kind.edit)
    assert "the measured pose is" in " ".join(forked(["inspect", path.name], folder).out.split())


def test_a_pose_that_the_markers_confirm_is_said_to_be_left_out(folder):
    path = bodies.write(folder / "c.h5", "both")
    assert "the markers are used, the pose is not" in " ".join(
        forked(["inspect", path.name], folder).out.split()
    )


@pytest.mark.long
def test_a_flight_by_other_units_and_scales_has_the_same_result_or_is_refused(folder):
    found = list(units.flights_compared(folder))
    assert [(base, name, faults) for base, name, _, faults in found if faults] == []
    assert sum(end.code == 0 for _, _, end, _ in found) >= 20


@pytest.mark.long
def test_hostile_motion_files_end_as_the_contract_says(folder):
    assert [(n, kind, faults) for n, kind, _, faults in files.each_file(folder, 1, 0, 12) if faults] == []


@pytest.mark.long
def test_damaged_files_of_every_kind_end_as_the_contract_says(folder):
    found = list(damaged.damaged_files(folder, 1, 0, 40))
    assert len({kind for kind, *_ in found}) > 5
    assert [(kind, damage, faults) for kind, damage, _, faults in found if faults] == []


@pytest.mark.long
def test_no_output_takes_the_place_of_what_was_there(folder):
    found = list(outputs.odd_outputs(folder))
    assert len(found) > 90
    assert [(place, command, faults) for place, command, _, faults in found if faults] == []


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["output in ascii", "name escapes", "output device full", "COLUMNS 1000000000"]
)
def test_odd_surroundings_cost_no_result(folder, name):
    (odd,) = [one for one in surroundings.ODD_SURROUNDINGS if one.name == name]
    surroundings.furnish(folder)
    end = surroundings.surrounded(odd, surroundings.COMMANDS["estimate"], folder)
    assert end.faults() == []
    assert "\x1b" not in end.out + end.err
    assert any(folder.glob("*.result.h5"))
