"""Natural frequencies from small-strain constants, in closed form."""

import numpy as np


def lame_frequencies(lam, mu, second_moment):
    """Squared (9,), ascending: three zeros; mu (1/e_i + 1/e_j); lam 1 1^T + 2 mu I against diag(e)."""
    e = np.linalg.eigvalsh(second_moment)
    pairs = [mu * (1 / e[i] + 1 / e[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    stretches = np.linalg.eigvalsh(lam / np.sqrt(np.outer(e, e)) + 2 * mu * np.diag(1 / e))
    return np.sort(np.concatenate([np.zeros(3), pairs, stretches]))
