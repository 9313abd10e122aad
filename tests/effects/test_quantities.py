"""What effects compute of a run's columns."""

import numpy as np
import pytest

from gyrocal.effects.quantities import means_of_tenths


@pytest.mark.parametrize("n", [1, 7, 10, 11, 99, 870])
def test_the_tenths_of_a_run_are_even_and_hold_each_sample_once(n: int) -> None:
    edges = [0.0]
    for middle in means_of_tenths(np.arange(float(n))[:, None])[:, 0]:  # the mean of a part of 0, 1, 2 ... is its middle
        edges.append(2 * middle + 1 - edges[-1])
    sizes = np.diff(edges)
    assert edges[-1] == n
    assert sizes.size == min(n, 10)
    assert np.ptp(sizes) <= 1
