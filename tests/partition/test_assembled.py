"""Systems of own matrices: of each part by names or places, of the whole where it tells its parts."""

import lecture_cases as lc
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

import forceid
from forceid.config import PartSetting
from forceid.errors import ConfigError, DataError
from forceid.files.stored.hdf5 import write_motion
from forceid.partition import from_assembled, from_meshes, from_motion_file, from_names
from forceid.partition.grids import assemble_elements, bar, solid_parts
from forceid.partition.matrix_file import read_matrix
from forceid.principal.operator import summation_operator
from forceid.records import Body, Motion, Recording

PAIR = np.array([[1.0, -1.0], [-1.0, 1.0]])
# two braced quadrangles share nodes 2 and 3, with no bar between these: each is rigid by itself
PLACE = np.array([[0.0, 0.0], [0.1, 1.0], [1.0, -0.1], [1.2, 1.1], [2.0, 0.0], [2.1, 0.9]])
LEFT, RIGHT = [0, 1, 2, 3], [3, 2, 4, 5]
BARS = {
    "left": [(0, 1), (0, 2), (1, 3), (0, 3), (1, 2)],
    "right": [(4, 5), (2, 4), (3, 5), (2, 5), (3, 4)],
}
PARTS = {"left": LEFT, "right": RIGHT}


def truss(bars, place, nodes, axial_stiffness=1e4, density=0.5):
    """Stiffness and consistent mass of bars on these of the nodes, in their order."""
    at = {node: k for k, node in enumerate(nodes)}
    pairs = np.array([[at[a], at[b]] for a, b in bars])
    each = [bar(place[list(p)], axial_stiffness, density) for p in bars]
    axes = place.shape[1]
    return (assemble_elements(pairs, np.array(m), axes, len(nodes)) for m in zip(*each, strict=True))


def two_trusses():
    """Stiffness of each part, made by itself, and of the whole."""
    own = [next(truss(BARS[name], PLACE, nodes)) for name, nodes in PARTS.items()]
    whole, _ = truss([b for bars in BARS.values() for b in bars], PLACE, range(len(PLACE)))
    return own, whole


def tied(places, shared, seed=3):
    """Places and bars of two parts in space: all pairs of nodes of a part but those of shared ones."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(shared + 2 * places, 3))
    common = list(range(shared))
    parts = [common + list(range(shared + k * places, shared + (k + 1) * places)) for k in range(2)]
    bars = [[(a, b) for k, a in enumerate(nodes) for b in nodes[max(k + 1, shared) :]] for nodes in parts]
    return x, parts, bars


@pytest.mark.parametrize("name", lc.PRINTED)
def test_matrices_written_and_read_back_solve_the_printed_cases(tmp_path, name):
    case, printed = lc.MADE[name](), lc.PRINTED[name]
    P = case.parts
    for s, (K, M) in enumerate(zip(P.stiffness, P.mass, strict=True)):
        scipy.io.mmwrite(tmp_path / f"K{s}.mtx", K)
        scipy.io.mmwrite(tmp_path / f"M{s}.mtx", M)
    K, M = ([read_matrix(tmp_path / f"{a}{s}.mtx") for s in range(len(P.position))] for a in "KM")
    fixed = [np.isclose(x[:, 0], 0) for x in P.position]
    system = from_meshes(K, M, P.position, 1e-6, fixed)
    found = system.solve(case.force)
    top = system.topology
    assert (len(top.frame), system.R_b.shape[1], len(top.interface)) == printed.sizes
    norms = [np.linalg.norm(x) for x in (found.lam, system.start_vector(case.force), found.u_f)]
    shown = [float(f"{x:.9g}") for x in (*norms, found.energy)]  # as the note prints them
    assert shown == pytest.approx([printed.lam, printed.start, printed.u_f, printed.energy], rel=1e-9)
    same = case.system.solve(case.force)
    assert lc.largest(found.lam, same.lam) < 1e-9
    assert lc.largest(found.u, same.u) < 1e-9
    assert found.energy == pytest.approx(same.energy, rel=1e-9)


def test_names_and_places_make_the_same_system():
    P = lc.plane_stress((2, 2), 3).parts
    names = [[tuple(p) for p in x.round(6).tolist()] for x in P.position]
    fixed = [n for n in dict.fromkeys(n for part in names for n in part) if n[0] == 0]
    by_name = from_names(P.stiffness, P.mass, names, P.position, fixed)
    by_place = from_meshes(P.stiffness, P.mass, P.position, 1e-6, [x[:, 0] == 0 for x in P.position])
    for a, b in zip(by_name.boolean, by_place.boolean, strict=True):
        assert np.array_equal(sp.csr_array(a).toarray(), sp.csr_array(b).toarray())
    assert [r.shape[1] for r in by_name.rigid_modes] == [0, 0, 3, 3]


def test_modes_are_found_where_no_places_are_given():
    P = lc.plane_stress((2, 1), 2).parts
    names = [x.round(6).tolist() for x in P.position]
    names = [[tuple(p) for p in part] for part in names]
    load = np.zeros_like(P.place)
    load[P.place[:, 0] == 2] = [0.1, -1.0]
    held = [n for n in names[0] if n[0] == 0]
    with_places, without = (
        from_names(P.stiffness, None, names, x, held).solve(load[P.place[:, 0] > 0].ravel())
        for x in (P.position, None)
    )
    assert lc.largest(without.lam, with_places.lam) < 1e-11


def test_nodal_masses_are_those_of_translations_alone():
    P = lc.plane_stress((2, 1), 1).parts
    by_names = from_names(P.stiffness, [np.arange(1.0, 5)] * 2, [[0, 1, 2, 3], [2, 3, 4, 5]], P.position)
    assert by_names.mass[0].diagonal().tolist() == [1, 1, 2, 2, 3, 3, 4, 4]
    frame = sp.csr_array((24, 24))
    turning = from_names([frame], [np.arange(1.0, 5)], [range(4)])
    assert turning.mass[0].diagonal().tolist() == [m for k in range(1, 5) for m in (k, k, k, 0, 0, 0)]


def test_an_assembled_stiffness_gives_every_part_what_it_has_by_itself():
    own, whole = two_trusses()
    system = from_assembled(whole, None, PARTS, PLACE)
    for found, K in zip(system.stiffness, own, strict=True):
        assert lc.largest(found.toarray(), K.toarray()) < 1e-13
    assert [r.shape[1] for r in system.rigid_modes] == [3, 3]


@pytest.mark.parametrize(("places", "shared"), [(4, 3), (5, 4), (4, 1)])
@pytest.mark.parametrize("known", [True, False])
def test_parts_in_space_are_told_apart_with_and_without_their_places(places, shared, known):
    x, parts, bars = tied(places, shared)
    own = [next(truss(b, x, nodes)) for b, nodes in zip(bars, parts, strict=True)]
    whole, _ = truss(bars[0] + bars[1], x, range(len(x)))
    system = from_assembled(whole, None, dict(enumerate(parts)), x if known else None)
    for found, K in zip(system.stiffness, own, strict=True):
        assert lc.largest(found.toarray(), K.toarray()) < 1e-12


def test_the_map_of_nodes_to_parts_says_the_same_as_the_nodes_of_parts():
    _, whole = two_trusses()
    owner = ["left", "left", ("left", "right"), {"right", "left"}, "right", ["right"]]
    by_node = from_assembled(whole, None, owner, PLACE)
    by_part = from_assembled(whole, None, {"left": LEFT, "right": sorted(RIGHT)}, PLACE)
    for a, b in zip(by_node.stiffness, by_part.stiffness, strict=True):
        assert np.array_equal(a.toarray(), b.toarray())


def test_assembled_nodes_stay_in_their_order_and_the_system_moves_as_the_whole():
    _, whole = two_trusses()
    system = from_assembled(whole, None, PARTS, PLACE, fixed=[0, 1])
    load = np.random.default_rng(5).normal(size=8)
    found = system.solve(load)
    u = np.linalg.solve(whole.toarray()[4:, 4:], load)
    assert lc.largest(found.u, system.topology.L @ u) < 1e-11
    L = system.topology.L
    K = (L.T @ sp.block_diag(system.stiffness) @ L).toarray()
    assert lc.largest(K, whole.toarray()[4:, 4:]) < 1e-13


def test_forces_between_parts_of_a_whole_are_those_of_parts_by_themselves():
    own, whole = two_trusses()
    pull = summation_operator(PLACE)
    load = np.random.default_rng(6).normal(size=12)
    load -= pull @ np.linalg.lstsq(pull, load, rcond=None)[0]
    apart = from_names(own, None, [LEFT, RIGHT], [PLACE[LEFT], PLACE[RIGHT]])
    together = from_assembled(whole, None, {"left": LEFT, "right": RIGHT}, PLACE)
    assert lc.largest(together.solve(load).lam, apart.solve(load).lam) < 1e-11


def test_masses_of_shared_nodes_are_divided_as_loads_are():
    _, whole = two_trusses()
    mass = np.arange(1.0, 7)
    system = from_assembled(whole, mass, PARTS, PLACE)
    assert system.mass[0].diagonal()[::2].tolist() == [1, 2, 1.5, 2]
    assert system.mass[1].diagonal()[::2].tolist() == [2, 1.5, 5, 6]
    lumped = from_assembled(whole, sp.diags_array(np.repeat(mass, 2)), PARTS, PLACE)
    for a, b in zip(lumped.mass, system.mass, strict=True):
        assert np.array_equal(a.toarray(), b.toarray())


def frame_bar(a, b):
    """A beam with nodal rotations, bending and twist: twelve dof, K = T^T k T with six strains of its own."""
    along = b - a
    length = np.linalg.norm(along)
    e = Rotation.align_vectors([along / length], [[1.0, 0, 0]])[0].as_matrix()
    T = np.kron(np.eye(4), e.T)
    G = np.zeros((6, 12))
    G[0, [0, 6]] = G[1, [3, 9]] = [-1, 1]
    for row, (w, t, sign) in ((2, (1, 5, 1)), (4, (2, 4, -1))):
        for end, k in ((0, row), (1, row + 1)):
            G[k, t + 6 * end] = 1
            G[k, [w, w + 6]] += np.array([1, -1]) * sign / length
    D = np.diag([300.0, 5.0, 0, 0, 0, 0])
    D[2:4, 2:4] = D[4:, 4:] = np.array([[4.0, 2.0], [2.0, 4.0]]) * 7 / length
    return (G @ T).T @ D @ (G @ T)


def test_nodes_with_rotations_are_taken_apart_by_their_places():
    x = np.array([[0.0, 0, 0], [1.0, 0.2, 0], [1.5, 1.0, 0.3], [2.5, 1.0, -0.4], [2.0, 2.0, 0.1]])
    beams, parts = [[(0, 1), (1, 2)], [(2, 3), (3, 4), (2, 4)]], {"arm": [0, 1, 2], "head": [2, 3, 4]}
    assert all(
        np.abs(frame_bar(x[a], x[b]) @ summation_operator(x[[a, b]], rotations=True)).max() < 1e-11
        for a, b in beams[0] + beams[1]
    )
    sums = [
        assemble_elements(np.array(each), np.array([frame_bar(x[a], x[b]) for a, b in each]), 6, 5)
        for each in beams
    ]
    system = from_assembled(sums[0] + sums[1], None, parts, x)
    for found, K, nodes in zip(system.stiffness, sums, parts.values(), strict=True):
        d = (6 * np.array(nodes)[:, None] + np.arange(6)).ravel()
        assert lc.largest(found.toarray(), K[d][:, d].toarray()) < 1e-12
    assert [r.shape[1] for r in system.rigid_modes] == [6, 6]


def test_parts_on_a_line_have_the_modes_of_their_stiffness():
    x = np.array([[0.0, 0], [1.0, 0], [2.0, 0]])
    K, _ = truss([(0, 1), (1, 2)], x, range(3))
    system = from_assembled(K, None, [0, (0, 1), 1], x)
    assert [r.shape[1] for r in system.rigid_modes] == [3, 3]
    assert system.solve([-2.0, 0, 0, 0, 2.0, 0]).lam[:2] == pytest.approx([-2.0, 0.0], abs=1e-12)


def test_springs_to_the_ground_belong_to_the_part_that_holds_their_node():
    _, whole = two_trusses()
    K = whole + sp.diags_array(np.repeat([7.0, 9, 0, 0, 0, 0], 2))
    system = from_assembled(K, None, PARTS)
    assert [r.shape[1] for r in system.rigid_modes] == [0, 3]
    load = np.random.default_rng(8).normal(size=12)
    assert lc.largest(system.solve(load).u, system.topology.L @ np.linalg.solve(K.toarray(), load)) < 1e-10


def coupled(a, b, axes=2):
    K, _ = truss([(a, b)], PLACE, range(len(PLACE)))
    return two_trusses()[1] + K


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        (
            {"stiffness": coupled(0, 4)},
            "couples node 0 of part left to node 4 of part right, expected parts that",
        ),
        ({"parts": {"a": [0, 1, 2], "b": [3, 4, 5]}}, "couples node 0 of part a to node 3 of part b"),
        (
            {"stiffness": coupled(2, 3)},
            "couples nodes 2 and 3, which part left and part right share: how much",
        ),
        ({"parts": {"left": LEFT, "right": [2, 3, 4]}}, "parts leave out node 5; give every node to a part"),
        (
            {"parts": {"left": LEFT, "right": [2, 3, 4, 5, 6]}},
            "part right names the unknown node 6; did you mean 5",
        ),
        ({"parts": {"left": LEFT, "right": [2, 3, 4, 5, 5]}}, "part right names node 5 twice"),
        ({"fixed": ["0"]}, "fixed names the unknown node '0'; nodes are named 0 and so on"),
        ({"fixed": range(6)}, "Boolean matrix of partition 0 has no row: nothing of the partition is free"),
        ({"stiffness": np.eye(12) + np.eye(12, k=1)}, "assembled stiffness is not symmetric"),
        ({"stiffness": np.full((12, 12), np.nan)}, "assembled stiffness holds numbers that are not finite"),
        ({"stiffness": np.eye(12)[:10]}, "has .10. rows for .6. nodes, expected one whole number"),
        ({"stiffness": np.eye(13)}, "has .13. rows for .6. nodes, expected one whole number"),
        ({"mass": np.ones(5)}, r"assembled mass has shape \(10, 10\), expected \(12, 12\)"),
        ({"mass": np.eye(12) + 0.1 * np.eye(12, k=1)}, "assembled mass is not symmetric"),
        (
            {"mass": list(truss(BARS["left"], PLACE, range(6)))[1]},
            "assembled mass couples node 2, which part left",
        ),
        ({"position": np.ones((6, 3))}, "position has 3 axes and 2 degrees of freedom a node"),
        ({"position": PLACE[:, ::-1] * [1, 2]}, "would have part left resist rigid motion at node 2, by"),
        (
            {"stiffness": two_trusses()[1] + 50 * np.diag([0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0])},
            r"holds node 2, which part left and part right share, by 50 of .* take its supports out",
        ),
    ],
)
def test_a_whole_that_does_not_tell_its_parts_is_refused_with_what_would(changed, told):
    right = {"stiffness": two_trusses()[1], "mass": np.ones(6), "parts": PARTS, "position": PLACE}
    assert len(from_assembled(**right).stiffness) == 2
    with pytest.raises(DataError, match=told) as caught:
        from_assembled(**(right | changed))
    assert caught.value.next_step
    assert "\n" not in str(caught.value)


def test_two_meshes_with_an_edge_in_common_are_not_told_apart_by_their_sum():
    P = solid_parts((2, 1), 3)
    L = sp.vstack(P.boolean)
    whole = L.T @ sp.block_diag(P.stiffness) @ L
    parts = {s: L.indices[::2] // 2 for s, L in enumerate(P.boolean)}
    with pytest.raises(
        DataError, match=r"only the elements tell; assemble each part by itself .* from_names"
    ):
        from_assembled(whole, None, parts, P.place)
    names = [nodes.tolist() for nodes in parts.values()]
    assert (
        from_names(P.stiffness, P.mass, names, P.position).solve(np.zeros(len(P.place) * 2)).deficiency == 3
    )


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"names": [["a", "b"]]}, "names has 1 entries, expected 2, one a part"),
        ({"mass": [PAIR]}, "mass has 1 entries, expected 2, one a part"),
        ({"position": [[[0.0, 0], [1, 0]]]}, "position has 1 entries, expected 2"),
        (
            {"names": [["a", "b", "c"], ["b", "c"]]},
            r"has \[2, 2\] rows for \[3, 2\] nodes, expected one whole",
        ),
        ({"names": [["a", "b"], ["c", "d"]]}, "fall into 2 pieces that share nothing"),
        ({"names": [["a", "a"], ["a", "b"]]}, "uses the assembled degree of freedom 0 twice"),
        ({"fixed": ["A"]}, "fixed names the unknown node 'A'"),
        ({"stiffness": [PAIR, PAIR * np.inf]}, "stiffness of partition 1 holds numbers that are not finite"),
        ({"mass": [np.ones(3), np.ones(2)]}, r"mass of partition 0 has shape \(3, 3\), expected \(2, 2\)"),
    ],
)
def test_parts_that_make_no_system_are_refused(changed, told):
    right = {"stiffness": [PAIR, PAIR], "mass": [PAIR, np.ones(2)], "names": [["a", "b"], ["b", "c"]]}
    assert from_names(**right).topology.interface.tolist() == [1]
    with pytest.raises(DataError, match=told):
        from_names(**(right | changed))


def test_a_name_at_two_places_is_told():
    P = solid_parts((2, 1), 1)
    names = [[0, 1, 2, 3], [2, 3, 4, 5]]
    assert from_names(P.stiffness, None, names, P.position).topology.size == 12
    off = [P.position[0], P.position[1] + 0.01]
    told = r"position of partition 1 has node 2 at \[1.01, 0.01\], expected \[1.0, 0.0\], as before"
    with pytest.raises(DataError, match=told):
        from_names(P.stiffness, None, names, off)
    with pytest.raises(DataError, match=r"position of partition 0 has shape \(3, 2\), expected \(4, axis\)"):
        from_names(P.stiffness, None, names, [P.position[0][:3], P.position[1]])


def test_flags_of_other_nodes_are_refused():
    P = solid_parts((2, 1), 1)
    with pytest.raises(DataError, match=r"fixed has shapes \[\(3,\), \(4,\)\], expected \[\(4,\), \(4,\)\]"):
        from_meshes(P.stiffness, None, P.position, 1e-6, [np.zeros(3, bool), np.zeros(4, bool)])


@pytest.fixture
def recorded(tmp_path):
    """A motion file whose body has a stiffness, and the stiffness of its two parts by themselves."""
    x, parts, bars = tied(4, 3)
    own = [next(truss(b, x, nodes)) for b, nodes in zip(bars, parts, strict=True)]
    whole, _ = truss(bars[0] + bars[1], x, range(len(x)))
    names = tuple(f"n{k}" for k in range(len(x)))
    body = Body(node=names, position=x, mass=np.full(len(x), 0.1), stiffness=whole.toarray())
    motion = Motion(time=np.arange(4.0), position=np.tile(x, (4, 1, 1)), gravity=np.array([0, 0, -9.81]))
    write_motion(tmp_path / "body.h5", Recording(body, motion))
    return tmp_path / "body.h5", [[names[k] for k in part] for part in parts], own, body


def test_a_motion_file_and_its_tree_give_the_parts_of_their_body(recorded):
    path, parts, own, body = recorded
    tables = [PartSetting(name=name, nodes=tuple(n)) for name, n in zip("ab", parts, strict=True)]
    path.with_name("parts.toml").write_text(
        "".join(f"[[part]]\nname = '{name}'\nnodes = {n}\n" for name, n in zip("ab", parts, strict=True))
    )
    by_number = {k: [int(n[1:]) for n in part] for k, part in enumerate(parts)}
    for source in (path, str(path), forceid.open_motion(path)):
        for given in (dict(zip("ab", parts, strict=True)), by_number, tables, path.with_name("parts.toml")):
            system = from_motion_file(source, given)
            for found, K in zip(system.stiffness, own, strict=True):
                assert lc.largest(found.toarray(), K.toarray()) < 1e-12
    held = from_motion_file(path, by_number, fixed=["n5", "n6", 9])
    load = np.random.default_rng(9).normal(size=held.topology.size)
    free = np.setdiff1d(np.arange(33), [3 * n + k for n in (5, 6, 9) for k in range(3)])
    u = np.linalg.solve(body.stiffness[np.ix_(free, free)], load)
    assert lc.largest(held.solve(load).u, held.topology.L @ u) < 1e-9


def test_acceleration_of_a_body_in_flight_tells_the_force_between_its_parts(recorded):
    path, parts, _, body = recorded
    system = from_motion_file(path, dict(enumerate(parts)))
    pull = np.zeros((11, 3))
    pull[10, 2] = 1.1  # N on a node of the second part, of 1.1 kg together
    found = system.solve(pull.ravel(), relief=True)
    S = summation_operator(body.position)
    a = S @ np.linalg.solve(S.T @ (np.repeat(body.mass, 3)[:, None] * S), S.T @ pull.ravel())
    nominal = system.interface_forces(pull.ravel(), a)
    first = system.topology.rows[0]
    force = -found.lam[first].reshape(-1, 3).sum(0)
    own = np.where(np.arange(11) < 3, 0.05, np.where(np.arange(11) < 7, 0.1, 0))  # kg: shared nodes in halves
    assert force == pytest.approx(own @ a.reshape(-1, 3), abs=1e-10)
    assert -nominal.lam[first].reshape(-1, 3).sum(0) == pytest.approx(force, abs=1e-10)


def test_a_motion_file_that_does_not_tell_its_parts_is_refused_by_variable(recorded):
    path, parts, _, _ = recorded
    with pytest.raises(
        DataError, match=r"body.h5:/body/stiffness couples node 'n0' of part 0 to node 'n7' of"
    ):
        from_motion_file(path, {0: parts[0], 1: parts[1][3:]})
    with pytest.raises(DataError, match="part 1 names the unknown node 'm3'; did you mean n3"):
        from_motion_file(path, {0: parts[0], 1: ["m3"]})
    path.with_name("none.toml").write_text("model = 'rigid'\n")
    with pytest.raises(ConfigError, match=r"none.toml holds no \[\[part\]\]; add one for each part"):
        from_motion_file(path, path.with_name("none.toml"))
    with pytest.raises(DataError, match="cannot be read"):
        from_motion_file(path.with_name("none.h5"), {0: ["n0"]})


def test_a_motion_file_without_stiffness_is_told_what_is_missing(recorded):
    path, parts, _, _ = recorded
    tree = forceid.open_motion(path)
    tree["body"] = tree["body"].to_dataset().drop_vars("stiffness")
    with pytest.raises(DataError, match="/body/stiffness is missing, expected for parts that deform; add it"):
        from_motion_file(tree, dict(enumerate(parts)))
