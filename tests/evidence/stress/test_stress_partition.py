"""Bodies in parts in the stress map: the truth is one, solvers that are broken on purpose show red."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from evidence.stress import run as stress
from evidence.stress.cell import judge_cell
from evidence.stress.failure_table import failures_named
from evidence.stress.figures import draw_map, draw_overview
from evidence.stress.page import page_of
from evidence.stress.run import StressJob, key_of, maps_of, trial_of
from evidence.stress.subjects import FLIGHTS, PARTS, default_of, subject_of
from evidence.stress.trial import attempt
from evidence.subjects.parts import failures as fp
from evidence.subjects.parts.trial import DEFAULT, WAYS, Way, solved, solver
from forceid.cli.app import main
from forceid.cli.boundary.output import finite_or_none
from forceid.partition.operators.conjugate_gradient import projected_cg
from forceid.records import Verdict

BY_NAME = {f.name: f for f in failures_named(["partition"])}
HEALTHY = BY_NAME["cross_points"]
DIRECT = WAYS[0]


def cell_of(failure, level, solve=solved, who=DIRECT, seeds=(1, 2)):
    records = [attempt(PARTS, failure, level, seed, (solver(who, solve),)) for seed in seeds]
    trials = [trial_of(finite_or_none(r["trials"][who.name])) for r in records]
    return judge_cell(trials, PARTS.quantities)


def unaware(body, who):
    """Claims ten digits whatever the tolerance."""
    system = body.system()
    found = system.solve_cg(body.load, "dirichlet", tolerance=1e-4)
    return replace(found, error=1e-10, lam_error=1e-10, verdict=Verdict())


def without_principal_part(body, who):
    """Conjugate gradients on P_L F P_L: the balance of the parts is left out."""
    system = body.system()
    found, P, f = system.solve(body.load), system.projection, system.loads(body.load)
    b = system.topology.B.T @ system.inverse(f)
    done = projected_cg(system.flexibility, b, P.balanced, P.averaged, lambda x: x, 1e-10, 3000)
    return replace(found, lam=P.balanced(done.x))


def unrelieved(body, who):
    """Solves a floating body as if its loads were in balance."""
    system = body.system()
    S = system.free_motions
    f = system.loads(body.load)
    return system.solve(f - S @ (S.T @ f))


def singular(body, who):
    raise np.linalg.LinAlgError("singular")


@pytest.mark.parametrize("who", WAYS, ids=lambda who: who.name)
def test_every_solver_is_green_on_a_healthy_body(who):
    found = cell_of(HEALTHY, 3, who=who)
    assert found.color == "green"
    assert max(found.over_claim) < 1.5


@pytest.mark.parametrize(
    ("broken", "cause"),
    [(unaware, "times the claimed one"), (without_principal_part, "force error"), (singular, "crashed")],
)
def test_a_solver_that_is_broken_on_purpose_shows_red(broken, cause):
    found = cell_of(HEALTHY, 3, broken)
    assert found.color == "red"
    assert cause in found.cause


def test_loads_out_of_balance_that_are_dropped_show_red():
    failure = BY_NAME["floating"]
    assert cell_of(failure, 1e-3, unrelieved).color == "red"
    assert cell_of(failure, 1e-3).color == "grey"
    assert cell_of(failure, 1e-3, who=Way(relief=True)).color == "green"


def test_an_error_of_motions_is_told_as_one_of_motions():
    def moved(body, who):
        found = solved(body, who)
        return replace(found, u=found.u * (1 + 1e-6))

    assert cell_of(HEALTHY, 3, moved).cause.startswith("motion error")


@pytest.mark.parametrize("failure", failures_named(["partition"]), ids=lambda f: f.name)
def test_the_truth_is_in_balance_and_the_same_seed_makes_it_again(failure):
    body, again = (failure.make(failure.levels[0], np.random.default_rng(1)) for _ in range(2))
    np.testing.assert_array_equal(body.load, again.load)
    np.testing.assert_array_equal(body.lam, again.lam)
    system = body.system()
    top = system.topology
    f, size = system.loads(body.load), np.abs(body.load).max()
    strained = sp.block_diag(system.stiffness) @ body.u
    assert np.abs(f - strained - top.B @ body.lam).max() < 1e-11 * size
    assert np.abs(top.L_f.T @ body.lam).max(initial=0.0) < 1e-11 * size
    assert np.abs(system.projection.averaged(top.B.T @ body.u)).max(initial=0.0) == 0


@pytest.mark.parametrize("count", [2, 3, 8, 64])
def test_wedges_meet_in_one_point_and_close_to_a_disk(count):
    parts = fp.wedges(count)
    top = fp.wedge_parts(count, np.random.default_rng(1)).system().topology
    assert top.count.max() == count
    middle = np.flatnonzero((np.abs(parts.place) < 1e-12).all(1))
    assert len(middle) == 1
    assert np.linalg.norm(parts.place, axis=1).max() == pytest.approx(1.0)


def test_loads_on_stiff_strips_are_as_much_larger_unless_they_are_said_to_be_alike():
    apart, alike = (
        make(1e8, np.random.default_rng(1)).load for make in (fp.jump_of_strips, fp.jump_under_load)
    )
    soft = fp.jump_of_strips(1.0, np.random.default_rng(1)).load
    assert np.abs(apart).max() > 1e6 * np.abs(soft).max()
    assert np.abs(alike).max() < 1e3 * np.abs(soft).max()


def test_the_code_of_partitions_counts_for_bodies_in_parts_and_for_nothing_else(monkeypatch):
    jobs = [StressJob("mass", 0.0, 1, True), StressJob("wedge_parts", 2, 1, True)]
    before = [key_of(job) for job in jobs]
    code = stress.code_hash

    def changed(sources):
        sources = list(sources)
        return code(sources) + "changed" * any(path.parent.name == "partition" for path in sources)

    monkeypatch.setattr(stress, "code_hash", changed)
    after = [key_of(job) for job in jobs]
    assert after[0] == before[0]
    assert after[1] != before[1]


def test_the_group_of_bodies_in_parts_is_met_by_solvers_and_every_other_by_estimators():
    assert {f.name for f in failures_named(["partition"])} == set(BY_NAME)
    for failure in failures_named([]):
        subject = subject_of(failure)
        if failure.group not in ("affine", "affine_loads"):
            assert subject is (PARTS if failure.name in BY_NAME else FLIGHTS)
            assert default_of(failure) == subject.default
        assert default_of(failure) in [who.name for who in subject.contestants(failure, False)]
        assert [who.name for who in subject.contestants(failure, True)] == [default_of(failure)]


def test_pictures_and_page_of_both_kinds_name_what_each_is_judged_by():
    chosen = failures_named(["mass", "wedge_parts"])
    records = [stress.do(StressJob("wedge_parts", level, 1, True)) for level in (2, 4, 8)]
    records += [
        {**r, "failure": "mass", "level": level, "trials": {"smoother": r["trials"][DEFAULT.name]}}
        for r, level in zip(records, (0, 3e-3, 0.03), strict=True)
    ]
    maps = maps_of([finite_or_none(r) for r in records], chosen, short=True)
    parts = next(m for m in maps if m.failure.group == "partition")
    title = draw_map(parts).axes[0].get_title(loc="left")
    assert title.endswith("error over claim, the worse of force and motion")
    assert [t.get_text() for t in draw_overview(maps).axes[0].texts][-3:] == ["✓ 2", "✓ 4", "✓ 8"]
    page = page_of(maps, 1)
    assert "## Thresholds of the smoother" in page
    assert "## Thresholds of the CG, Dirichlet" in page
    assert "Bodies in parts at rest" in page
    assert page.count("No cell.") == 1


@pytest.mark.long
def test_the_command_maps_bodies_in_parts(tmp_path, capsys):
    assert main(["stress", "wedge_parts", "-o", str(tmp_path), "--short", "-j", "1"]) == 0
    assert "cells    3: 3 green" in capsys.readouterr().out
    assert (tmp_path / "wedge_parts.png").stat().st_size > 10_000
