"""A search ends at the maximum within the bounds, to a thousandth of the errors, wherever it begins."""

from collections.abc import Callable

import numpy as np
import pytest

from gyrocal.inference.maximise import SETTLED, maximise
from gyrocal.recording.session import Array

WIDE = [(-20.0, 20.0)] * 2


def ridge(x: Array) -> tuple[float, Array]:
    """A curved ridge: well determined across it, hardly along it; the maximum is at (1, 1)."""
    across = x[1] - x[0] ** 2
    slope = np.array([400 * across * x[0] + 1 - x[0], -200 * across])
    return -100 * float(across**2) - 0.5 * float(1 - x[0]) ** 2 - 1e4, slope


def flat_then_steep(x: Array) -> tuple[float, Array]:
    """A variance as the exponential of a coordinate: nearly flat below, and of negative curvature far from its maximum at 0."""
    return float(np.sum(-50 * (np.exp(-x) + x))), 50 * (np.exp(-x) - 1)


@pytest.mark.parametrize("start", [(-2.0, 3.0), (1.5, -1.0), (4.0, 0.0), (0.9, 0.9)])
@pytest.mark.parametrize(("surface", "top"), [(ridge, (1.0, 1.0)), (flat_then_steep, (0.0, 0.0))])
def test_every_start_ends_at_the_top(
    surface: Callable[[Array], tuple[float, Array]], top: tuple[float, float], start: tuple[float, float]
) -> None:
    found = maximise(surface, np.array(start), WIDE)
    assert surface(np.array(top))[0] - surface(found)[0] < SETTLED**2


@pytest.mark.parametrize("start", [(-2.0, 3.0), (0.3, -1.0), (-1.0, 0.2)])
def test_a_top_beyond_a_bound_is_sought_along_it(start: tuple[float, float]) -> None:
    """With x at most 0.5 the ridge's highest point is on the bound, at y = x^2."""
    low, high = -20.0, 0.5
    found = maximise(ridge, np.clip(start, low, high), [(low, high), (low, high)])
    assert found == pytest.approx([0.5, 0.25], abs=SETTLED)


def test_a_coordinate_that_nothing_determines_keeps_its_place() -> None:
    def loglik(x: Array) -> tuple[float, Array]:
        return -0.5 * float(x[0] ** 2), np.array([-x[0], 0.0])

    assert maximise(loglik, np.array([3.0, 0.7]), WIDE) == pytest.approx([0.0, 0.7], abs=SETTLED)
