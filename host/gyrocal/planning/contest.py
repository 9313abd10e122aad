"""How surely a diagnosis names the true one of two effects when runs are added.

The true effect acts at its fitted size. The rival takes the coefficients by which it mimics the true effect best, beside the
model (T-optimality: Atkinson and Fedorov, Biometrika 62 (1975) 57). The squared norm of the mismatch that remains in power
cycle k, weighted by the noise, is lambda_k. The log-likelihoods of the two differ in that cycle by a normal variable of mean
lambda_k / 2 and variance lambda_k. Naming asks that the sum exceeds ``rival_errors`` standard errors, which are estimated from
the scatter of the cycles, or that the shapes differ by ``similar_shape``; the effect must also pass against the model alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gyrocal import tails
from gyrocal.inference.design import Mask
from gyrocal.planning.columns import Columns, Member
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

HOPELESS = -9.0
"""Standard deviations by which a contest without any signal is lost."""
NODES = ((-np.sqrt(3.0), 1 / 6), (0.0, 2 / 3), (np.sqrt(3.0), 1 / 6))
"""Nodes and weights of Gauss and Hermite for the uncertain size."""
RIDGE = 1e-10
"""Of the normal equations' diagonal, so that a column that nothing shows has the coefficient 0."""

Chosen = Sequence[tuple[int, float]]
"""Kinds of power cycles with their numbers. Kinds from ``Contest.n_new`` on are the session's own power cycles."""


class Strengths(NamedTuple):
    """Number, sum and sum of squares of the lambdas, and the cosine of the shapes, [candidates] each."""

    n: Array
    first: Array
    second: Array
    cosine: Array


@dataclass(frozen=True)
class Contest:
    """A true effect against a rival, or against none.

    ``grams`` [kinds + cycles, p, p] are those of the planned kinds and of the session's cycles, ``random`` [kinds + cycles] is
    what a random part adds, ``plain`` [kinds + cycles, p, p] holds the products without noise. ``size`` [p] holds the true
    coefficients. ``model`` [p] is a mask of columns, and ``rivals`` [p] are those that the rival may take: it takes the best.
    """

    grams: Array
    random: Array
    plain: Array
    size: Array
    model: Mask
    rivals: tuple[Mask, ...]
    n_new: int
    least: float
    """Log-likelihood that the true effect must gain."""

    @staticmethod
    def of(columns: Columns, members: Sequence[Member], truth: int, rival: int | None, least: float) -> Contest:
        """The contest of member ``truth`` against member ``rival``, or against none."""
        grams = columns.grams(truth, members[truth], rival)
        own, new = columns.plain()
        cycles = len(grams.own)
        plain = np.concatenate([new, np.repeat(own[None] / cycles, cycles, axis=0)])
        none = np.zeros(len(columns.owner), dtype=bool)
        return Contest(
            np.concatenate([grams.new, grams.own]), np.concatenate([grams.new_random, grams.own_random]), plain,
            columns.coefficients(truth, members[truth]), columns.owner == -1,
            (none,) if rival is None else tuple(columns.variants(rival)), len(grams.new), least,
        )  # fmt: skip

    def strengths(self, chosen: Chosen, candidates: Chosen = ((0, 0.0),)) -> Strengths:
        """Strengths of a plan with each candidate added. The session's own power cycles are part of each."""
        own = np.arange(self.n_new, len(self.grams))
        kinds = np.concatenate([own, [k for k, _ in chosen]]).astype(int)
        times = np.concatenate([np.ones(own.size), [n for _, n in chosen]])
        extra, number = (np.array([c[i] for c in candidates]) for i in (0, 1))
        extra = extra.astype(int)
        total = np.tensordot(times, self.grams[kinds], 1) + number[:, None, None] * self.grams[extra]
        plain = np.tensordot(times, self.plain[kinds], 1) + number[:, None, None] * self.plain[extra]
        found = []
        for rival in self.rivals:
            mismatch = self._mismatch(total, rival)
            lambdas = np.einsum("kij,ci,cj->ck", self.grams[kinds], mismatch, mismatch, optimize=True) + self.random[kinds]
            last = np.einsum("cij,ci,cj->c", self.grams[extra], mismatch, mismatch, optimize=True) + self.random[extra]
            lambdas, last = np.maximum(lambdas, 0.0), np.maximum(last, 0.0)
            found.append((
                lambdas @ times + number * last, lambdas**2 @ times + number * last**2, self._cosine(plain, mismatch, rival)
            ))  # fmt: skip
        sums, squares, cosines = (np.array([one[i] for one in found]) for i in range(3))
        best = (np.argmin(sums, axis=0), np.arange(len(number)))
        return Strengths(times.sum() + number, sums[best], squares[best], cosines[best])

    def _mismatch(self, total: Array, rival: Mask) -> Array:
        """Coefficients [c, p] of the true term minus the best that the model and the rival make of it."""
        rest = self.model | rival
        out = np.repeat(self.size[None], len(total), axis=0)
        if rest.any():
            h, g = total[:, rest][:, :, rest], total[:, rest] @ self.size
            out[:, rest] -= solved(h, g)
        return out

    def _cosine(self, plain: Array, mismatch: Array, rival: Mask) -> Array:
        """Cosine [c] of the true signal and of the rival's fit to it, both without what the model explains."""
        if not rival.any() or not self.size.any():
            return np.zeros(len(plain))
        sizes = np.stack([np.repeat(self.size[None], len(plain), axis=0), np.where(rival, -mismatch, 0.0)], axis=1)
        if self.model.any():
            h, g = plain[:, self.model][:, :, self.model], plain[:, self.model] @ sizes.swapaxes(1, 2)
            sizes[:, :, self.model] -= solved(h, g).swapaxes(1, 2)
        product = sizes @ plain @ sizes.swapaxes(1, 2)
        norm = np.sqrt(np.maximum(product[:, 0, 0] * product[:, 1, 1], 1e-300))
        return np.asarray(np.minimum(np.abs(product[:, 0, 1]) / norm, 1.0))

    def margin(self, n: Array, first: Array, second: Array, cosine: Array, size: float = 1.0) -> Array:
        """Standard deviations by which the contest is won on average, [candidates]; ``size`` multiplies the true effect's."""
        total, squares = size**2 * first, size**4 * second
        scatter = squares / 4 - total**2 / 4 / n + (1 - 1 / n) * total
        errors = np.sqrt(np.maximum(n / np.maximum(n - 1, 1.0) * scatter, 0.0))
        if self.rivals[0].any():
            wanted = np.where(cosine <= POLICY.similar_shape, 0.0, POLICY.rival_errors * errors)
        else:
            wanted = np.maximum(POLICY.gain_errors * errors, self.least)
        won = (total / 2 - wanted) / np.sqrt(np.maximum(total, 1e-300))
        return np.asarray(np.where(total > 1e-9, np.maximum(won, HOPELESS), HOPELESS))

    def power(self, chosen: Chosen, spread: float) -> float:
        """Probability of winning, over the uncertain size of the true effect with the relative standard error ``spread``."""
        strengths = self.strengths(chosen)
        return float(sum(w * tails.normal(-self.margin(*strengths, 1 + x * spread)[0]) for x, w in NODES))

    @property
    def relative_error(self) -> float:
        """Relative standard error of the true effect's size in the session, at most one half."""
        total = self.strengths(())[1][0]
        return float(min(0.5, 1 / np.sqrt(max(total, 1e-300))))


def solved(h: Array, g: Array) -> Array:
    """The solutions of normal equations ``h`` [c, k, k] with the right sides ``g`` [c, k] or [c, k, m]."""
    scale = np.sqrt(np.maximum(np.diagonal(h, axis1=1, axis2=2), 1e-300))
    unit = h / (scale[:, :, None] * scale[:, None, :]) + RIDGE * np.eye(h.shape[-1])
    right = (g if g.ndim == 3 else g[..., None]) / scale[..., None]
    found = np.linalg.solve(unit, right) / scale[..., None]
    return np.asarray(found if g.ndim == 3 else found[..., 0])
