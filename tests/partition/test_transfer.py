import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from forceid.errors import DataError, EstimationError
from forceid.partition.coupling.interpolation import interpolation
from forceid.partition.coupling.transfer import reproduction, transfer_load, transfer_motion
from forceid.principal.loads import distribute
from forceid.principal.operator import sum_nodal, summation_operator


def grid(rows, columns, surface):
    """Nodes and quadrilaterals of a patch, surface(s, t) of the unit square."""
    s, t = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    quads = first[:, None] + np.array([0, 1, columns + 2, columns + 1])
    return surface(s.ravel(), t.ravel()), quads


def split(quads):
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def shell(s, t):
    return np.stack(
        [1.2 * np.cos(1.7 * s), 1.2 * np.sin(1.7 * s), 0.8 * t + 0.1 * np.sin(3 * s) * t**2], axis=-1
    )


def flat(s, t):
    return np.stack([2.0 * s, 1.5 * t, np.zeros_like(s)], axis=-1)


def circle(count, radius=1.0, half_turns=1.0):
    angle = np.linspace(0, half_turns * np.pi, count)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def meshes(seed, offset=0.05, faces=None):
    """A coarse structure and a finer fluid side, off it by a little, with random loads in time."""
    rng = np.random.default_rng(seed)
    structure, quads = grid(3, 4, shell)
    fluid = grid(11, 7, shell)[0] * (1 + offset)
    return structure, quads if faces is None else faces(quads), fluid, rng.standard_normal((4, *fluid.shape))


def turned_all(x, seed):
    rotation = Rotation.random(random_state=seed).as_matrix()
    return x @ rotation.T, rotation


@pytest.mark.parametrize("faces", [None, split])
@pytest.mark.parametrize("seed", range(3))
def test_all_six_resultants_arrive_on_a_curved_surface_that_does_not_match(seed, faces):
    structure, cells, fluid, load = meshes(seed, faces=faces)
    area = np.random.default_rng(seed).uniform(0.5, 2.0, len(structure))
    H = interpolation(structure, fluid, cells)
    for weight in (None, area):
        done = transfer_load(H, load, structure, fluid, weight)
        goal = sum_nodal(load, fluid, done.about)
        assert np.abs(done.error_before[:, :3]).max() < 1e-12  # rows of H add up to one
        assert np.abs(done.error_before[:, 3:]).max() > 1e-2
        np.testing.assert_allclose(done.error_after, 0.0, atol=1e-12 * np.abs(load).sum(axis=(1, 2)).max())
        np.testing.assert_allclose(sum_nodal(done.load, structure), sum_nodal(load, fluid), atol=1e-12 * 100)
        np.testing.assert_allclose(sum_nodal(done.load, structure, done.about), goal, atol=1e-12 * 100)
        assert ((done.share > 0) & (done.share < 0.2)).all()


@pytest.mark.parametrize("faces", [None, split])
def test_a_plane_that_reproduces_linear_fields_needs_no_correction(faces):
    structure, quads = grid(4, 3, flat)
    fluid = np.random.default_rng(1).uniform([0, 0, 0], [2.0, 1.5, 0.0], (60, 3))
    cells = quads if faces is None else faces(quads)
    (structure, rotation), load = (
        turned_all(structure, 5),
        np.random.default_rng(2).standard_normal(fluid.shape),
    )
    fluid = fluid @ rotation.T + 3.0
    structure = structure + 3.0
    H = interpolation(structure, fluid, cells)
    found = reproduction(H, structure, fluid)
    assert found.exact
    assert max(found.unity.max(), found.offset.max()) < 1e-13
    done = transfer_load(H, load, structure, fluid)
    np.testing.assert_allclose(done.error_before, 0.0, atol=1e-12)
    assert done.share < 1e-13
    np.testing.assert_allclose(done.load, H.T @ load, atol=1e-13)


def test_planar_lines_that_lie_on_each_other_conserve_force_and_moment_without_correction():
    structure = np.array([[0.0, 0.0], [0.4, 0.1], [1.0, 0.3], [1.5, 0.3]])
    t = np.random.default_rng(0).uniform(0, 3, 40)
    k = np.minimum(t.astype(int), 2)
    fluid = structure[k] + (t - k)[:, None] * (structure[k + 1] - structure[k])
    H = interpolation(structure, fluid)
    expected = np.zeros(H.shape)
    expected[np.arange(40), k], expected[np.arange(40), k + 1] = 1 - t + k, t - k
    np.testing.assert_allclose(H.toarray(), expected, atol=1e-12)
    done = transfer_load(H, np.random.default_rng(1).standard_normal((40, 2)), structure, fluid)
    np.testing.assert_allclose(done.error_before, 0.0, atol=1e-12)
    assert done.share < 1e-13


def test_the_offset_of_a_polygon_in_a_circle_is_its_sagitta():
    structure = circle(9)
    fluid = circle(17)[1::2]  # on the circle over the middle of every chord
    found = reproduction(interpolation(structure, fluid), structure, fluid)
    np.testing.assert_allclose(found.offset, 1 - np.cos(np.pi / 16), rtol=1e-12)
    np.testing.assert_allclose(found.unity, 0.0, atol=1e-14)
    assert not found.exact


def test_pressure_on_a_polygon_around_its_center_makes_no_moment_and_shear_makes_the_closed_form():
    structure, fluid = circle(9), circle(17)[1::2]
    H = interpolation(structure, fluid)
    normal, along = fluid, fluid[:, ::-1] * [-1, 1]
    center = structure.mean(axis=0)
    for load, lost in ((normal, 0.0), (along, -8 * (1 - np.cos(np.pi / 16)))):
        done = transfer_load(H, load, structure, fluid)
        # the arm of the shear is cos(pi/16) of the radius, before correction
        np.testing.assert_allclose(done.error_before, [0.0, 0.0, lost], atol=1e-13)
        np.testing.assert_allclose(done.error_after, 0.0, atol=1e-13)
        np.testing.assert_allclose(
            done.correction, distribute([0.0, 0.0, -lost], structure, about=center), atol=1e-13
        )


def test_the_correction_is_the_least_weighted_one_of_the_formula():
    structure, cells, fluid, load = meshes(4)
    weight = np.random.default_rng(4).uniform(0.1, 3.0, len(structure))
    H = interpolation(structure, fluid, cells)
    done = transfer_load(H, load, structure, fluid, weight)
    S, W = summation_operator(structure, done.about), np.diag(np.repeat(weight, 3))
    expected = -done.error_before @ np.linalg.solve(S.T @ W @ S, S.T @ W)
    np.testing.assert_allclose(done.correction.reshape(4, -1), expected, atol=1e-12)
    norm = np.linalg.norm(done.correction, axis=(1, 2)) / np.linalg.norm(done.load, axis=(1, 2))
    np.testing.assert_allclose(done.share, norm, rtol=1e-12)


def test_work_is_the_same_on_both_sides_without_correction():
    structure, cells, fluid, load = meshes(5)
    H = interpolation(structure, fluid, cells)
    u_s = np.random.default_rng(6).standard_normal((4, *structure.shape))
    u_f = np.einsum("fs,tsa->tfa", H.toarray(), u_s)
    np.testing.assert_allclose(
        (np.einsum("fs,tfa->tsa", H.toarray(), load) * u_s).sum((1, 2)), (load * u_f).sum((1, 2))
    )
    done = transfer_load(H, load, structure, fluid)
    plain = done.load - done.correction
    np.testing.assert_allclose((plain * u_s).sum((1, 2)), (load * u_f).sum((1, 2)), rtol=1e-12)


@pytest.mark.parametrize("weighted", [False, True])
def test_work_is_the_same_on_both_sides_with_correction_when_the_motion_is_corrected_too(weighted):
    structure, cells, fluid, load = meshes(7)
    weight = np.random.default_rng(7).uniform(0.1, 3.0, len(structure)) if weighted else None
    H = interpolation(structure, fluid, cells)
    u_s = np.random.default_rng(8).standard_normal((4, *structure.shape))
    u_f = transfer_motion(H, u_s, structure, fluid, weight)
    lam_s = transfer_load(H, load, structure, fluid, weight).load
    work = (load * u_f).sum((1, 2))
    np.testing.assert_allclose((lam_s * u_s).sum((1, 2)), work, rtol=1e-12)
    uncorrected = (load * np.einsum("fs,tsa->tfa", H.toarray(), u_s)).sum((1, 2))
    assert np.abs(uncorrected - work).max() > 1e-3


def test_corrected_motion_carries_every_rigid_motion_as_it_is():
    structure, cells, fluid, _ = meshes(9)
    H = interpolation(structure, fluid, cells)
    rigid = summation_operator(structure).T.reshape(6, *structure.shape)
    expected = summation_operator(fluid).T.reshape(6, *fluid.shape)
    np.testing.assert_allclose(transfer_motion(H, rigid, structure, fluid), expected, atol=1e-12)
    assert np.abs(np.einsum("fs,tsa->tfa", H.toarray(), rigid) - expected).max() > 1e-2


@pytest.mark.parametrize("seed", range(3))
def test_loads_turn_with_the_frame(seed):
    structure, cells, fluid, load = meshes(seed)
    rotation, shift = Rotation.random(random_state=seed).as_matrix(), np.array([4.0, -2.0, 7.0])
    H = interpolation(structure, fluid, cells)
    other = interpolation(structure @ rotation.T + shift, fluid @ rotation.T + shift, cells)
    np.testing.assert_allclose(other.toarray(), H.toarray(), atol=1e-12)
    here = transfer_load(H, load, structure, fluid)
    there = transfer_load(
        other, load @ rotation.T, structure @ rotation.T + shift, fluid @ rotation.T + shift
    )
    np.testing.assert_allclose(there.load, here.load @ rotation.T, atol=1e-11)
    np.testing.assert_allclose(there.share, here.share, rtol=1e-9)


def test_the_projection_finds_the_closest_point_of_all_triangles():
    rng = np.random.default_rng(10)
    structure, cells = (
        rng.standard_normal((30, 3)),
        rng.permuted(np.tile(np.arange(30), (40, 1)), axis=1)[:, :3],
    )
    fluid = 2 * rng.standard_normal((700, 3))
    off = np.linalg.norm(interpolation(structure, fluid, cells) @ structure - fluid, axis=1)
    # every point of a fine lattice on every triangle is at least as far, and one of them nearly as near
    a, b = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41))
    inside = (a + b <= 1 + 1e-12).ravel()
    w = np.stack([1 - a - b, a, b], axis=-1).reshape(-1, 3)[inside]
    lattice = np.einsum("kw,cwa->cka", w, structure[cells]).reshape(-1, 3)
    least = np.array([np.linalg.norm(lattice - x, axis=1).min() for x in fluid[:60]])
    assert (off[:60] <= least + 1e-12).all()
    np.testing.assert_allclose(off[:60], least, atol=0.15)


def test_lines_triangles_and_quadrilaterals_go_together_and_a_collapsed_one_does_no_harm():
    structure = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [3, 0, 0]])
    fluid = np.array([[0.5, 0.5, 0.2], [1.2, 0.3, 0.0], [2.5, 0.0, -0.1]])
    H = interpolation(structure, fluid, [[0, 1, 2, 3], [1, 4, 2], [4, 5], [2, 3, 3]]).toarray()
    expected = [[0.25, 0.25, 0.25, 0.25, 0, 0], [0, 0.5, 0.3, 0, 0.2, 0], [0, 0, 0, 0, 0.5, 0.5]]
    np.testing.assert_allclose(H, expected, atol=1e-14)


def test_an_interpolation_between_degrees_of_freedom_is_the_nodal_one_of_every_axis():
    structure, cells, fluid, load = meshes(11)
    H = interpolation(structure, fluid, cells)
    nodal = transfer_load(H, load, structure, fluid)
    full = transfer_load(sp.kron(H, np.eye(3)).toarray(), load, structure, fluid)
    np.testing.assert_allclose(full.load, nodal.load, atol=1e-13)


def test_rows_that_do_not_add_up_to_one_lose_force_and_the_check_says_how_much():
    structure, cells, fluid, load = meshes(12)
    H = 0.9 * interpolation(structure, fluid, cells)
    np.testing.assert_allclose(reproduction(H, structure, fluid).unity, 0.1, rtol=1e-12)
    done = transfer_load(H, load, structure, fluid)
    np.testing.assert_allclose(done.error_before[:, :3], -0.1 * load.sum(axis=1), atol=1e-12)
    np.testing.assert_allclose(done.error_after, 0.0, atol=1e-12 * 100)


def beam_in_tube():
    structure = np.stack([np.linspace(0, 2, 5), np.zeros(5), np.zeros(5)], axis=-1)
    angle = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    ring = np.stack([np.zeros(8), 0.3 * np.cos(angle), 0.3 * np.sin(angle)], axis=-1)
    fluid = (np.linspace(0.1, 1.9, 6)[:, None, None] * [1, 0, 0] + ring).reshape(-1, 3)
    lines = np.stack([np.arange(4), np.arange(1, 5)], axis=1)
    return turned_all(structure, 1)[0], lines, turned_all(fluid, 1)[0]


def test_collinear_nodes_cannot_take_a_moment_about_their_line_and_the_error_says_so():
    structure, lines, fluid = beam_in_tube()
    H = interpolation(structure, fluid, lines)
    twist = np.cross(structure[-1] - structure[0], fluid)
    with pytest.raises(
        EstimationError, match=r"structure lies on a line.*cannot be restored; add structural"
    ):
        transfer_load(H, twist, structure, fluid)
    with pytest.raises(EstimationError, match="lies on a line"):
        transfer_motion(H, np.ones((5, 3)), structure, fluid)


def test_collinear_nodes_take_what_makes_no_moment_about_their_line():
    structure, lines, fluid = beam_in_tube()
    H = interpolation(structure, fluid, lines)
    along = (structure[-1] - structure[0]) * (1 + fluid @ [0.3, 0.2, -0.5])[:, None]
    done = transfer_load(H, along, structure, fluid)
    assert np.abs(done.error_before).max() > 1e-2
    np.testing.assert_allclose(done.error_after, 0.0, atol=1e-12 * np.abs(along).sum())
    # forces that are even around the tube: nothing but rounding is lost about the line
    even = transfer_load(H, np.tile([0.3, -0.2, 0.7], (len(fluid), 1)), structure, fluid)
    np.testing.assert_allclose(even.error_after, 0.0, atol=1e-12 * 50)


def test_no_load_stays_no_load():
    structure, cells, fluid, _ = meshes(13)
    done = transfer_load(interpolation(structure, fluid, cells), np.zeros_like(fluid), structure, fluid)
    np.testing.assert_array_equal(done.load, 0.0)
    assert done.share == 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"structure": np.zeros((4, 4))}, "expected 2 or 3 coordinates"),
        ({"structure": np.zeros(3)}, "structure has shape"),
        ({"fluid": np.zeros((2, 2))}, "fluid has shape .* as many axes as the structure"),
        ({"fluid": [[0.0, 0.0, np.nan]]}, "fluid has shape"),
        ({"fluid": np.zeros((0, 3))}, "fluid has shape"),
        ({"cells": None}, "cells is not given, and spatial nodes need it"),
        ({"cells": []}, "cells is empty"),
        ({"cells": [[0, 1, 9]]}, r"cell 0 is \[0, 1, 9\], expected 2, 3 or 4 node numbers from 0 to 3"),
        ({"cells": [[0, 1, 2], [3]]}, r"cell 1 is \[3\]"),
    ],
)
def test_bad_surfaces_are_told_by_name(change, message):
    good = {"structure": grid(1, 1, flat)[0], "fluid": np.zeros((2, 3)), "cells": [[0, 1, 2]]}
    with pytest.raises(DataError, match=message):
        interpolation(**(good | change))


def test_bad_interpolations_loads_motions_and_weights_are_told_by_name():
    structure, cells, fluid, load = meshes(14)
    H = interpolation(structure, fluid, cells)
    with pytest.raises(DataError, match=r"H has shape \(20, 96\), expected \(96, 20\) or \(288, 60\)"):
        reproduction(H.T, structure, fluid)
    with pytest.raises(DataError, match="H has shape"):
        transfer_load(np.full(H.shape, np.nan), load, structure, fluid)
    with pytest.raises(DataError, match=r"load has shape \(20, 3\), expected \(\.\.\., 96, 3\)"):
        transfer_load(H, structure, structure, fluid)
    with pytest.raises(DataError, match="load has shape"):
        transfer_load(H, np.full(fluid.shape, np.inf), structure, fluid)
    with pytest.raises(DataError, match="motion has shape"):
        transfer_motion(H, fluid, structure, fluid)
    with pytest.raises(DataError, match="weight must be 20 finite numbers"):
        transfer_load(H, load, structure, fluid, weight=-np.ones(20))
