"""Rotations from angular rates. The rate between two samples is linear, and a step has two terms of the Magnus expansion.

``R(t)`` takes a vector's components at time t to those at the start. It follows ``dR/dt = R [w]x`` with the rate w in the
sensor's frame, so one step multiplies by ``exp([phi]x)`` with ``phi = h (w0 + w1) / 2 + h^2/12 (w0 x w1)``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal.recording.session import Array


def cross_matrix(v: Array) -> Array:
    """``[v]x`` of vectors [..., 3], shape [..., 3, 3]: ``cross_matrix(a) @ b`` is ``a x b``."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def exponential(phi: Array) -> Array:
    """Rotation matrices [..., 3, 3] of rotation vectors [..., 3], rad (Rodrigues)."""
    angle = np.linalg.norm(phi, axis=-1)[..., None, None]
    k = cross_matrix(phi)
    return np.eye(3) + np.sinc(angle / np.pi) * k + np.sinc(angle / (2 * np.pi)) ** 2 / 2 * (k @ k)


def steps(rate_rad_s: Array, t_s: Array) -> Array:
    """The rotation of each interval between samples, shape [n - 1, 3, 3], from rates [n, 3] (rad/s) at times [n] (s)."""
    h = np.diff(t_s)[:, None]
    before, after = rate_rad_s[:-1], rate_rad_s[1:]
    return exponential(h * (before + after) / 2 + h**2 / 12 * np.cross(before, after))


def cumulative(movements: Sequence[Array]) -> list[Array]:
    """``R`` at each sample of several movements, [n, 3, 3] each, from their steps [n - 1, 3, 3]; the first is the identity.

    The movements are independent of each other and are multiplied in parallel.
    """
    if not movements:
        return []
    longest = max(len(m) for m in movements)
    padded = np.broadcast_to(np.eye(3), (longest, len(movements), 3, 3)).copy()
    for k, m in enumerate(movements):
        padded[: len(m), k] = m
    out = np.empty((longest + 1, len(movements), 3, 3))
    out[0] = np.eye(3)
    for i in range(longest):
        out[i + 1] = out[i] @ padded[i]
    return [out[: len(m) + 1, k] for k, m in enumerate(movements)]


def tangents(u: Array) -> Array:
    """Two unit vectors at right angles to the unit vectors u [..., 3] and to each other, as rows [..., 2, 3]."""
    helper = np.eye(3)[np.argmin(np.abs(u), axis=-1)]
    first = np.cross(u, helper)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(u, first)], axis=-2)
