import numpy as np
import pytest
from material_checks import check_material
from reduced_cases import BLOCK, TIME, master, random_start
from scipy.spatial.transform import Rotation

from evidence.subjects.affine.reduced import left_reduced
from forceid.errors import DataError
from forceid.pseudorigid import (
    Body,
    NeoHookean,
    NoStress,
    StVenantKirchhoff,
    TransverselyIsotropic,
)

LAM, MU, ALPHA, SHEAR, BETA = 1.3, 0.7, 0.4, 0.5, 6.0
DIRECTION = np.array([1.0, -2.0, 2.0]) / 3
QUADRATIC = TransverselyIsotropic(StVenantKirchhoff(LAM, MU), (1, -2, 2), ALPHA, SHEAR, BETA)
WITH_BARRIER = TransverselyIsotropic(NeoHookean.natural(MU / 2, LAM / 4), (1, -2, 2), ALPHA, SHEAR, BETA)


@pytest.mark.parametrize("material", [QUADRATIC, WITH_BARRIER], ids=["quadratic", "with a barrier"])
def test_fibers_are_consistent_frame_indifferent_and_turn_about_their_direction_alone(material):
    found = check_material(material, np.random.default_rng(3))
    assert found.gradient < 1e-9
    assert found.hessian < 1e-9
    assert (found.consistent, found.frame_indifferent, found.natural) == (True, True, True)
    assert found.isotropy > 1e-3
    F = np.random.default_rng(4).normal(size=(3, 3)) * 0.1 + np.eye(3)
    about = Rotation.from_rotvec(1.1 * DIRECTION).as_matrix()
    np.testing.assert_allclose(material.gradient(F @ about), material.gradient(F) @ about, atol=1e-13)


def test_small_strains_meet_the_five_constants_of_spencer():
    """Along e3: in the notation of Voigt, by hand."""
    W = TransverselyIsotropic(StVenantKirchhoff(LAM, MU), (0, 0, 3), ALPHA, SHEAR, BETA)
    along = LAM + 2 * MU + 2 * ALPHA + 4 * SHEAR + BETA
    voigt = np.diag([LAM + 2 * MU, LAM + 2 * MU, along, MU + SHEAR, MU + SHEAR, MU])
    voigt[0, 1] = voigt[1, 0] = LAM
    voigt[:2, 2] = voigt[2, :2] = LAM + ALPHA
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)]
    for k, (i, j) in enumerate(pairs):
        strain = np.zeros((3, 3))
        strain[i, j] += 0.5
        strain[j, i] += 0.5  # Voigt's shear is twice the strain
        stress = W.hessian(np.eye(3), strain)
        np.testing.assert_allclose([stress[p] for p in pairs], voigt[:, k], atol=1e-14)


@pytest.mark.parametrize("material", [QUADRATIC, WITH_BARRIER], ids=["quadratic", "with a barrier"])
def test_left_reduced_fibers_move_as_the_master_system_says(material):
    F0, dF0 = random_start(6)
    F, dF = master(BLOCK, material, F0, dF0, TIME)
    motion = left_reduced.simulate(BLOCK, material, F0, dF0, TIME)
    np.testing.assert_allclose(motion.F, F, rtol=0, atol=1e-12)
    np.testing.assert_allclose(motion.dF, dF, rtol=0, atol=1e-11)


def test_body_round_about_its_fibers_keeps_the_circulation_about_them_and_no_other():
    F0, dF0 = random_start(7)
    E = 1.2 * np.eye(3) + 0.8 * np.outer(DIRECTION, DIRECTION)
    circulation = Body(E, WITH_BARRIER).simulate(F0, dF0, TIME, "dop853").circulation
    assert np.ptp(circulation @ DIRECTION) < 1e-12
    assert np.ptp(circulation, axis=0).max() > 0.05
    skew = Body(BLOCK, WITH_BARRIER).simulate(F0, dF0, TIME, "dop853").circulation
    assert np.ptp(skew @ DIRECTION) > 0.01


def test_body_without_stress_goes_straight_on_until_it_is_flat():
    F0, dF0 = random_start(8)
    for method in ("verlet", "blanes_moan_6", "dop853"):
        motion = Body(BLOCK, NoStress()).simulate(F0, dF0, TIME, method)
        np.testing.assert_allclose(motion.F, F0 + TIME[:, None, None] * dF0, atol=1e-14)
    falling = Body(1.0, NoStress()).simulate(np.eye(3), np.diag([0, 0, -2.0]), [0.0, 1.0], "dop853")
    assert falling.event.kind == "inversion"
    assert falling.event.time == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"direction": (0, 0, 0)}, "is zero"),
        ({"direction": (0, 1)}, "shape (2,)"),
        ({"shear": np.nan}, "shear"),
        ({"alpha": "much"}, "alpha is str"),
        ({"shear": -MU}, "expected > 0"),
        ({"alpha": 40.0}, "expected > 0"),
        ({"base": 3.0}, "which has no energy"),
    ],
)
def test_fibers_out_of_range_are_refused(changed, told):
    given = {"base": StVenantKirchhoff(LAM, MU), "direction": (1, 0, 0)} | changed
    with pytest.raises(DataError) as caught:
        TransverselyIsotropic(**given)
    assert told in str(caught.value)
