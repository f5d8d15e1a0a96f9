"""Bad bodies, starts, constants and instants: one clear line with what to change, never a wrong motion."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evidence.subjects.affine.reduced import general_reduced, left_reduced, two_sided
from forceid import pseudorigid
from forceid.errors import DataError, ForceIdError
from forceid.pseudorigid import Body, MooneyRivlin

RUBBER = MooneyRivlin(0.6, 0.25, 0.4, 3.0)
F0, V0 = np.diag([1.1, 1.0, 0.9]), np.array([[0.1, -0.4, 0.3], [0.5, 0, -0.2], [-0.1, 0.3, -0.05]])
BALL = 1.7 * np.eye(3)
NUMBERS = st.sampled_from([0.0, -1.0, 1.0, 2.0, 1e-300, 1e300, float("nan"), float("inf"), -float("inf")])
ENTRIES = st.sampled_from([0.0, -1.0, 1.0, 2.0, 1e-9, 1e9, float("nan"), float("inf"), -float("inf")])
VALUES = st.one_of(
    NUMBERS, st.sampled_from([None, "soft", 1j, (1.0,), [1.0], {}, np.eye(2), np.zeros((0, 3))])
)
SHAPES = [np.ones(3), np.ones((2, 2)), np.ones((4, 3)), 1j * np.eye(3), [[1, 2], [3]], [F0, V0], "soft", {}]
MATRICES = st.one_of(
    ENTRIES,
    st.lists(ENTRIES, min_size=9, max_size=9).map(lambda x: np.reshape(x, (3, 3))),
    st.lists(ENTRIES, min_size=3, max_size=3).map(np.diag),
    st.sampled_from(SHAPES),
)
INSTANTS = st.one_of(VALUES, st.lists(NUMBERS, max_size=4), st.just([[0.0, 1.0]]), st.just(range(3)))

# what is asked, by name: a function of one bad value, and what bad values it may be given
ASKED = {
    "second moment": (lambda x: Body(x, RUBBER), MATRICES),
    "material": (lambda x: Body(1.0, x), VALUES),
    "start": (lambda x: Body(1.7, RUBBER).simulate(x, V0, [0.0, 1e-3], "kahan_li_6"), MATRICES),
    "instants": (lambda x: Body(1.7, RUBBER).simulate(F0, V0, x, "kahan_li_6", 1e290), INSTANTS),
    "step": (lambda x: Body(1.7, RUBBER).simulate(F0, V0, [0.0, 0.1], "kahan_li_6", x), VALUES),
    "method": (lambda x: Body(1.7, RUBBER).simulate(F0, V0, [0.0, 0.1], str(x)), VALUES),
    "start of det F = 1": (
        # by a step of its own: that of a body pressed to 1e-9 of its width would take hours
        lambda x: Body(1.7, RUBBER, incompressible=True).simulate(x, 0 * V0, [0.0, 1e-3], step=1e-4),
        MATRICES,
    ),
    "polar": (pseudorigid.polar, MATRICES),
    "bipolar": (pseudorigid.bipolar, MATRICES),
    "path": (pseudorigid.bipolar_path, st.one_of(MATRICES, MATRICES.map(lambda x: [F0, x]))),
    "polar rates": (lambda x: pseudorigid.polar_rates(F0, x), MATRICES),
    "bipolar rates": (lambda x: pseudorigid.bipolar_rates(F0, x), MATRICES),
    "natural modes": (lambda x: pseudorigid.natural_modes(MooneyRivlin.natural(0.6, 0.25, 0.4), x), MATRICES),
    "rest": (
        lambda x: pseudorigid.natural_modes(MooneyRivlin.natural(0.6, 0.25, 0.4), BALL, x),
        MATRICES,
    ),
    "inertia": (lambda x: pseudorigid.free_rotation(x, np.ones(3), [0.0, 1.0]), MATRICES),
    "rotation": (
        lambda x: pseudorigid.free_rotation(np.diag([1.0, 2, 3]), np.ones(3), [0.0, 1.0], x),
        MATRICES,
    ),
    "instants of a rigid body": (
        lambda x: pseudorigid.free_rotation(np.diag([1.0, 2, 3]), np.ones(3), x),
        INSTANTS,
    ),
    "eccentricity": (pseudorigid.maclaurin, VALUES),
    "axis a2": (pseudorigid.jacobi, VALUES),
    "axes": (lambda x: pseudorigid.riemann_s(0.8, x), VALUES),
    "semi-axis": (lambda x: pseudorigid.index_symbols(1.0, 0.7, x), NUMBERS),
    "a": (lambda x: MooneyRivlin(x, 0.25, 0.4, 3.0), VALUES),
    "d": (lambda x: MooneyRivlin(0.6, 0.25, 0.4, x), VALUES),
    "c": (lambda x: pseudorigid.NeoHookean(0.6, x, 3.0), VALUES),
    "beta": (lambda x: pseudorigid.HadamardGreen(0.6, x, 0.4, 3.0), VALUES),
    "lam": (lambda x: pseudorigid.StVenantKirchhoff(x, 0.7), VALUES),
    "gamma": (lambda x: pseudorigid.PerfectGas(1.0, x), VALUES),
    "alpha": (lambda x: pseudorigid.Ogden(x, (2.0,), c=0.4, d=3.0), VALUES),
    "exponents": (lambda x: pseudorigid.Ogden((1.0,), (x,), c=0.4, d=3.0), VALUES),
    "gravity": (pseudorigid.SelfGravity, VALUES),
    "cloud": (lambda x: pseudorigid.GasCloud(1.0, 1.4, trap=x), VALUES),
    "deformation of rubber": (RUBBER.gradient, MATRICES),
    "deformation of gas": (pseudorigid.PerfectGas(1.0, 1.4).energy, MATRICES),
}
REFUSED = {  # of those functions, what each must not take
    "second moment": [np.diag([1.0, 1, 0]), np.diag([1.0, 1, -1]), 0.0, -1.0, np.nan * BALL],
    "material": [None, "soft", object()],
    "start": [np.diag([1.0, 1, -1]), np.diag([1.0, 1, 0]), np.nan * F0, np.ones(3), np.eye(2)],
    "instants": [[0.0, 0.0], [1.0, 0.0], [0.0, np.nan], [0.0, np.inf], [], [[0.0, 1.0]], 5.0],
    "step": [0.0, -1.0, np.nan, np.inf, 1e-300, "soft"],
    "method": ["rk4", ""],
    "start of det F = 1": [np.diag([1.1, 1, 1]), np.diag([-1.0, -1, 1]) @ np.diag([1.0, 1, -1])],
    "polar": [np.diag([1.0, 1, -1]), np.diag([1.0, 1, 0]), np.nan * F0, np.ones((2, 2))],
    "rest": [np.diag([1.0, 1, 0]), np.diag([1.0, 1, -1]), 1.2 * np.eye(3)],
    "rotation": [2 * np.eye(3), np.diag([1.0, 1, -1]), np.nan * F0],
    "inertia": [np.full((3, 3), np.inf), np.diag([1.0, 2, -3]), np.ones(3)],
    "eccentricity": [0.0, 1.0, -1.0, np.nan, np.inf],
    "axis a2": [0.0, 2.0, -1.0, np.nan],
    "axes": [0.0, -1.0, np.nan, np.inf],
    "a": [-1.0, np.nan, np.inf, None],
    "d": [0.0, -1.0, np.nan],
    "gamma": [1.0, 0.0, np.nan, np.inf],
    "exponents": [-1.0, np.nan],
    "deformation of rubber": [np.diag([1.0, 1, -1]), np.diag([1.0, 1, 0]), np.nan * F0, np.eye(2)],
    "deformation of gas": [np.diag([1.0, 1, -1]), np.diag([1.0, 1, 0])],
}  # fmt: skip


@pytest.mark.parametrize("name", ASKED)
@settings(max_examples=25, deadline=None, derandomize=True)
@given(data=st.data())
def test_anything_handed_in_gives_an_answer_or_one_clear_line(name, data):
    ask, values = ASKED[name]
    value, said = data.draw(values), None
    with warnings.catch_warnings():  # what is huge, and sound, may overflow
        warnings.filterwarnings("ignore", "overflow|divide by zero|invalid value", RuntimeWarning)
        try:
            ask(value)
        except ForceIdError as error:
            said = error
    if said is not None:
        assert "\n" not in str(said)
        assert said.where
        assert said.next_step
        assert 20 < len(str(said)) < 260


@pytest.mark.parametrize(("name", "value"), [(n, v) for n, values in REFUSED.items() for v in values])
def test_what_is_unsound_is_refused_and_says_what_to_change(name, value):
    with pytest.raises(ForceIdError) as caught:
        ASKED[name][0](value)
    assert caught.value.where
    assert caught.value.next_step


@pytest.mark.parametrize("form", [left_reduced, two_sided, general_reduced])
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"time": [0.0, np.inf]}, "time is not a list of 2 or more finite numbers"),
        ({"time": [0.0]}, "time is not a list of 2 or more"),
        ({"time": [0.0, 0.0]}, "drop repeated samples"),
        ({"F0": np.diag([1.0, 1, 0])}, "F0 has determinant 0, expected > 0"),
        ({"F0": [np.eye(3)] * 2}, "hand in one at a time"),
        ({"dF0": np.full((3, 3), np.inf)}, "dF0 holds values that are not finite"),
        ({"second_moment": np.full((3, 3), np.inf)}, "second_moment holds values that are not finite"),
    ],
)
def test_reduced_forms_refuse_what_no_motion_starts_from(form, change, says):
    call = {"second_moment": BALL, "F0": F0, "dF0": V0, "time": [0.0, 0.1]} | change
    with pytest.raises(DataError, match=says):
        form.simulate(material=RUBBER, **call)


def test_lists_of_whole_numbers_are_as_good_as_arrays():
    eye = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert RUBBER.energy(eye) == pytest.approx(0.6 * 3 + 0.25 * 3 + 0.4)
    np.testing.assert_allclose(RUBBER.gradient(np.eye(3, dtype=int)), 0, atol=1e-15)
    np.testing.assert_array_equal(
        pseudorigid.angular_momentum(eye, [[0, -1, 0], [1, 0, 0], [0, 0, 0]], eye), [0, 0, 2]
    )
    motion = Body(1, RUBBER).simulate(eye, [[0, 0, 0]] * 3, [0, 1])
    np.testing.assert_allclose(motion.F, [np.eye(3)] * 2, atol=1e-15)


def test_starts_and_rates_of_different_batches_are_named():
    with pytest.raises(DataError, match=r"shapes \(2, 3, 3\) and \(3, 3, 3\), which do not go together"):
        Body(1.0, RUBBER).simulate(np.tile(F0, (2, 1, 1)), np.tile(V0, (3, 1, 1)), [0.0, 1.0])
