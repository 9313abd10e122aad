"""How much of the noise of measured columns is taken out: all of it, or half of a combination that is mostly noise."""

import numpy as np
import pytest

from gyrocal.inference.measured_columns import MOST_NOISE, part_taken


def products(seed: int, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Products of four columns of 300 values, two of which share a noise, and the expected products of that noise."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(4, 300)) * [[1.0], [30.0], [0.2], [5.0]]
    loads = np.array([0.0, 1.0, 0.5, 0.0])
    columns += noise * np.outer(loads, rng.normal(size=300))
    return columns @ columns.T, 300 * noise**2 * np.outer(loads, loads)


def test_noise_that_is_a_small_part_of_every_combination_is_taken_out_whole() -> None:
    assert part_taken(*products(1, 0.05)) is None


@pytest.mark.parametrize("noise", [1.0, 10.0, 300.0])
def test_no_combination_loses_more_than_half_and_others_lose_what_is_noise(noise: float) -> None:
    """Columns that share one noise may each be mostly signal while their difference is mostly noise."""
    gram, of_noise = products(2, noise)
    part = part_taken(gram, of_noise)
    assert part is not None
    taken = part @ of_noise @ part.T
    parts = np.linalg.eigvals(np.linalg.solve(gram, taken)).real
    assert parts.max() == pytest.approx(MOST_NOISE)
    assert parts.min() > -1e-9
    assert np.linalg.eigvalsh(gram - taken).min() > 0


def test_the_part_that_is_taken_does_not_depend_on_the_units_of_the_columns() -> None:
    gram, of_noise = products(3, 10.0)
    units = np.diag([1.0, 57.3, 1e-3, 1e4])
    part, other = part_taken(gram, of_noise), part_taken(units @ gram @ units, units @ of_noise @ units)
    assert part is not None
    assert other is not None
    scale = np.sqrt(np.outer(np.diag(gram), np.diag(gram)))
    taken = np.linalg.inv(units) @ other @ units @ of_noise @ units @ other.T @ np.linalg.inv(units)
    np.testing.assert_allclose(taken / scale, part @ of_noise @ part.T / scale, atol=1e-9)
