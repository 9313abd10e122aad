"""The search for a maximum between bounds looks once where it begins at the end."""

import numpy as np
import pytest

from gyrocal.inference.reml import maximise

BOUNDS = [(-1.0, 2.0), (-1.0, 2.0)]


@pytest.mark.parametrize(("top", "found"), [((0.5, 1.0), (0.5, 1.0)), ((0.5, 3.0), (0.5, 2.0)), ((-2.0, 3.0), (-1.0, 2.0))])
def test_it_ends_at_the_top_or_at_a_bound_before_it(top: tuple[float, float], found: tuple[float, float]) -> None:
    asked = []

    def loglik(x: np.ndarray) -> tuple[float, np.ndarray]:
        asked.append(x.copy())
        return -50.0 * float(((x - top) ** 2).sum()), -100.0 * (x - top)

    x = maximise(loglik, np.zeros(2), BOUNDS)
    assert x == pytest.approx(found, abs=1e-3)
    looks = len(asked)
    assert looks > 1
    assert maximise(loglik, np.array(found), BOUNDS) == pytest.approx(found, abs=1e-12)
    assert len(asked) == looks + 1
