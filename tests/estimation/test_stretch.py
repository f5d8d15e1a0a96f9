import numpy as np
import pytest
from scipy.linalg import polar

from forceid.estimation.assembly import stretch_to


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_stretch_of_an_affine_map_is_the_right_factor_of_its_polar_decomposition(seed):
    rng = np.random.default_rng(seed)
    shape = rng.standard_normal((6, 3))
    F = np.eye(3) + 0.2 * rng.standard_normal((3, 3))
    np.testing.assert_allclose(stretch_to(shape, (shape @ F.T)[None])[0], polar(F)[1], atol=1e-12)
