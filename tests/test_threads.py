"""How many threads small and large problems take."""

import numpy as np
from threadpoolctl import threadpool_info

from forceid.threads import LARGE, threads_for


def counted():
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


def test_small_matrices_go_through_one_thread_and_large_ones_through_as_many_as_before():
    before = counted()
    with threads_for(LARGE - 1):
        assert set(counted()) == {1}
    with threads_for(LARGE):
        assert counted() == before
    assert counted() == before


def test_threads_come_back_after_an_error():
    before = counted()
    try:
        with threads_for(1):
            np.linalg.inv(np.zeros((2, 2)))
    except np.linalg.LinAlgError:
        assert counted() == before
