"""Integrated rotations against scipy's, and the residual's law under small errors of the rate."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from gyrocal.gravity.rotation import cross_matrix, cumulative, exponential, steps, tangents


def test_exponentials_are_scipys() -> None:
    vectors = np.random.default_rng(1).normal(size=(50, 3)) * np.geomspace(1e-9, 3, 50)[:, None]
    np.testing.assert_allclose(exponential(vectors), Rotation.from_rotvec(vectors).as_matrix(), atol=1e-12)


def rate(t_s: np.ndarray) -> np.ndarray:
    return np.stack([2 * np.sin(3 * t_s), 1.5 * np.cos(2 * t_s), 2 * np.sin(t_s + 1)], axis=-1)


def test_a_tumbling_rotation_is_integrated_to_a_millidegree() -> None:
    t_s = np.arange(0, 2.0001, 0.01)
    found = cumulative([steps(rate(t_s), t_s)])[0][-1]
    def slope(t: float, r: np.ndarray) -> np.ndarray:
        return (r.reshape(3, 3) @ cross_matrix(rate(np.array(t)))).ravel()

    solved = solve_ivp(slope, (0, 2), np.eye(3).ravel(), rtol=1e-10, atol=1e-12)
    error = Rotation.from_matrix(found.T @ solved.y[:, -1].reshape(3, 3)).magnitude()
    assert np.rad2deg(error) < 1e-2


def test_movements_of_different_lengths_are_multiplied_apart() -> None:
    long, short = (steps(rate(np.arange(n) * 0.01), np.arange(n) * 0.01) for n in (40, 7))
    together = cumulative([long, short])
    np.testing.assert_allclose(together[0], cumulative([long])[0], atol=1e-14)
    np.testing.assert_allclose(together[1], cumulative([short])[0], atol=1e-14)


def test_tangents_are_at_right_angles() -> None:
    u = np.random.default_rng(0).normal(size=(20, 3))
    u /= np.linalg.norm(u, axis=1)[:, None]
    across = tangents(u)
    np.testing.assert_allclose(across @ np.swapaxes(across, 1, 2), np.broadcast_to(np.eye(2), (20, 2, 2)), atol=1e-12)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", across, u), 0, atol=1e-12)
