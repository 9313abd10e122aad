"""Inverse Cholesky factors give the solutions and determinants of NumPy, whatever the number and size of the matrices."""

import numpy as np
import pytest

from gyrocal.inference.factors import inverse_factor, with_prior


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (5, 1, 1), (5, 3, 3), (2, 4, 2, 2), (0, 0)])
def test_it_is_the_inverse_and_its_determinant(shape: tuple[int, ...]) -> None:
    some = np.random.default_rng(0).normal(size=shape)
    matrices = some @ some.swapaxes(-1, -2) + np.eye(shape[-1])
    root, logdet = inverse_factor(matrices)
    assert root.swapaxes(-1, -2) @ root == pytest.approx(np.linalg.inv(matrices), rel=1e-12, abs=1e-14)
    assert np.triu(root, 1) == pytest.approx(0.0)
    assert logdet == pytest.approx(np.linalg.slogdet(matrices)[1], rel=1e-12)
    assert logdet.shape == shape[:-2]


@pytest.mark.parametrize("matrices", [-np.eye(1), np.full((2, 1, 1), np.nan), np.diag([1.0, -1.0]), -np.ones((3, 2, 2))])
def test_what_is_not_positive_definite_is_refused(matrices: np.ndarray) -> None:
    with pytest.raises(np.linalg.LinAlgError):
        inverse_factor(matrices)


def test_a_direction_of_which_too_much_noise_was_taken_out_is_known_by_its_prior_alone() -> None:
    turned = np.linalg.qr(np.random.default_rng(1).normal(size=(2, 2)))[0]
    root, logdet = with_prior(turned @ np.diag([4.0, -3.0]) @ turned.T)
    assert root.T @ root == pytest.approx(turned @ np.diag([0.25, 1.0]) @ turned.T)
    assert float(logdet) == pytest.approx(np.log(4.0))
