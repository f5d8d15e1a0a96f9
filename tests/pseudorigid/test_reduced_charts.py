"""Where the reduced forms hold, and where they are refused with the reason."""

import numpy as np
import pytest
from reduced_cases import BALL, BLOCK, EVERY, IDS, TIME, Springs, master, near_crossing, random_start

from evidence.subjects.affine.reduced import general_reduced, left_reduced, two_sided
from forceid.errors import DataError, EstimationError


@pytest.mark.parametrize(("form", "E"), EVERY[1:], ids=IDS[1:])
def test_axes_that_come_within_a_thousandth_are_still_followed(form, E):
    W = Springs()
    F0, dF0 = near_crossing(E, W, 1e-3)
    t = np.array([0.0, 0.4, 0.6])
    F, _ = master(E, W, F0, dF0, t)
    np.testing.assert_allclose(form.simulate(E, W, F0, dF0, t).F, F, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("form", "E", "least"), [(two_sided, BALL, 3e-5), (two_sided, BALL, 0.0), (general_reduced, BLOCK, 0.0)]
)
def test_axes_that_coalesce_are_followed_until_then_and_refused_by_time_and_name(form, E, least):
    W, before = Springs(), np.array([0.2, 0.6])
    F0, dF0 = near_crossing(E, W, least)
    with pytest.raises(EstimationError, match=r"t = 0\.(699|7)\d* s axes . and . coalesce.*Body\.simulate"):
        form.simulate(E, W, F0, dF0, np.array([0.2, 0.9]))
    F, _ = master(E, W, F0, dF0, before)
    np.testing.assert_allclose(form.simulate(E, W, F0, dF0, before).F, F, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("form", "E"), EVERY[1:], ids=IDS[1:])
def test_a_start_of_equal_axes_is_refused_at_once(form, E):
    with pytest.raises(EstimationError, match="t = 2 s axes 2 and 3 coalesce"):
        form.simulate(E, Springs(), np.eye(3), 0.1 * np.ones((3, 3)), np.array([2.0, 3.0]))


@pytest.mark.parametrize(("form", "E"), [(two_sided, BALL), (general_reduced, np.diag([1.0, 1.5, 2.2]))])
def test_axes_that_nothing_turns_pass_through_each_other(form, E):
    F0, dF0, t = np.diag([1.3, 1.1, 0.8]), np.diag([-0.9, 0.4, 0.9]), np.linspace(0, 1, 11)
    F, _ = master(E, Springs(), F0, dF0, t)
    motion = form.simulate(E, Springs(), F0, dF0, t)
    assert (motion.a[:, 0] > motion.a[:, 1]).any()
    assert (motion.a[:, 0] < motion.a[:, 1]).any()
    np.testing.assert_allclose(motion.F, F, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("form", "E"), EVERY, ids=IDS)
def test_a_body_that_collapses_is_refused_where_J_reaches_0(form, E):
    with pytest.raises(EstimationError, match=r"t = 0\.5 s .*J"):
        form.simulate(
            E, Springs(0, 0, 0), np.diag([1.5, 1.2, 0.5]), np.diag([0, 0, -1.0]), np.array([0.0, 1.0])
        )


@pytest.mark.parametrize(("form", "E"), [(two_sided, BALL), (general_reduced, np.diag([1.5, 1.5, 2.2]))])
def test_a_spinning_spheroid_is_followed_in_its_own_axes_or_refused_but_never_wrong(form, E):
    F0, dF0 = np.diag([1.0, 1.0, 0.8]), np.array([[0.1, -0.5, 0], [0.5, 0.1, 0], [0, 0, 0.2]])
    F, _ = master(E, Springs(), F0, dF0, TIME)
    if form is general_reduced:
        with pytest.raises(EstimationError, match="axes 1 and 2 coalesce"):
            form.simulate(E, Springs(), F0, dF0, TIME)
    else:
        np.testing.assert_allclose(form.simulate(E, Springs(), F0, dF0, TIME).F, F, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("form", "E"), EVERY, ids=IDS)
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"F0": np.diag([1.0, 1, -1])}, "F0 has determinant -1, expected > 0"),
        ({"F0": np.ones(3)}, r"F0 has shape \(3,\)"),
        ({"dF0": np.full((3, 3), np.nan)}, "finite"),
        ({"second_moment": np.diag([1.0, 1, 0])}, "positive definite"),
        ({"time": np.array([1.0, 0.0])}, "time is not a growing list"),
    ],
)
def test_a_start_that_does_not_fit_is_refused(form, E, change, says):
    F0, dF0 = random_start(9)
    call = {"second_moment": E, "F0": F0, "dF0": dF0, "time": TIME} | change
    with pytest.raises(DataError, match=says):
        form.simulate(material=Springs(), **call)


def test_a_body_or_material_without_the_symmetry_is_refused():
    F0, dF0 = random_start(10)

    class Tethered(Springs):
        def gradient(self, F):
            return super().gradient(F) - np.outer([1.0, 0, 0], [0.0, 1, 0])

    class Rubber(Springs):
        incompressible = True

    with pytest.raises(DataError, match=r"not mu I.*general_reduced"):
        two_sided.simulate(BLOCK, Springs(), F0, dF0, TIME)
    for form in (two_sided, general_reduced):
        with pytest.raises(DataError, match="isotropic"):
            form.simulate(BALL, Springs(fiber=0.3), F0, dF0, TIME)
    with pytest.raises(DataError, match="rotations of space"):
        left_reduced.simulate(BALL, Tethered(), F0, dF0, TIME)
    for form in (left_reduced, general_reduced):
        with pytest.raises(DataError, match="no constraint"):
            form.simulate(BALL, Rubber(), F0, dF0, TIME)
    with pytest.raises(DataError, match="expected 1 and 0"):
        two_sided.simulate(BALL, Rubber(), F0, dF0, TIME)
