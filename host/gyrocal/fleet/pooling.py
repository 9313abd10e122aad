"""A quantity of many boards as one population: its mean and its spreads over boards and rigs (crossed random effects).

    estimate = mean + rig + board + error

Board and rig are drawn from normal distributions whose spreads are estimated by restricted maximum likelihood; the error has
the standard error of the estimate (the random-effects model of DerSimonian and Laird, Control. Clin. Trials 7 (1986) 177, with
a second, crossed factor). Boards that lie further out than the normal distribution reaches in a fleet of this size have the
weight zero, so that they move neither mean nor spread. The search for them begins at median and median absolute deviation,
which half of the boards cannot move (Hampel et al., Robust Statistics, 1986, section 2.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.session import Array
from gyrocal.tails import ROBUST

ROUNDS = 20
NO_ERROR = 1e-6
"""No standard error is smaller than this fraction of the estimates' spread."""

Mask = np.ndarray[Any, np.dtype[np.bool_]]
Labels = np.ndarray[Any, np.dtype[np.intp]]


@dataclass(frozen=True)
class Pooled:
    """Mean and spread over boards with their standard errors, and the spread over rigs, which is None for fewer than two rigs.

    ``z`` [n] is each estimate's deviation from the prediction for a board on its rig, in standard deviations of the prediction.
    ``used`` [n] is False for estimates with weight zero. ``rig_offset`` [rigs] are the offsets of the rigs.
    """

    mean: float
    se: float
    sd: float
    sd_se: float
    rig_sd: float | None
    rig_sd_se: float | None
    rig_offset: Array = field(repr=False)
    z: Array = field(repr=False)
    used: Mask = field(repr=False)

    def to_json(self) -> dict[str, float]:
        found = {"mean": self.mean, "se": self.se, "sd": self.sd, "sd_se": self.sd_se}
        if self.rig_sd is not None and self.rig_sd_se is not None:
            found |= {"rig_sd": self.rig_sd, "rig_sd_se": self.rig_sd_se}
        return found


def labelled(names: Sequence[str | None]) -> Labels:
    """Numbers from 0 on for names in sorted order. All None have the same number."""
    order = {name: i for i, name in enumerate(sorted({n or "" for n in names}))}
    return np.array([order[n or ""] for n in names], dtype=np.intp)


def pool(values: Array, se: Array, board: Labels | None = None, rig: Labels | None = None) -> Pooled | None:
    """The population of estimates ``values`` [n] with standard errors ``se`` [n]; None if it has fewer than three boards.

    ``board`` and ``rig`` [n] number the boards and rigs from 0; without them each estimate is a board, and all are of one rig.
    """
    board = np.arange(values.size) if board is None else np.unique(board, return_inverse=True)[1]
    rig = np.zeros(values.size, dtype=np.intp) if rig is None else rig
    if values.size < POLICY.population_boards or board.max() + 1 < POLICY.population_boards:
        return None
    middle = float(np.median(values))
    unit = ROBUST * float(np.median(np.abs(values - middle))) or float(np.std(values)) or float(np.median(se)) or 1.0
    y, error = (values - middle) / unit, np.maximum(se / unit, NO_ERROR)
    limit = furthest(int(board.max()) + 1)
    used = np.abs(y - _medians(y, rig)) <= limit * np.sqrt(1.0 + error**2)
    seen: list[Mask] = []
    for _ in range(ROUNDS):
        found = _Reml.of(y[used], error[used], board[used], rig[used], int(rig.max()) + 1)
        z = found.z(y, error, rig)
        now = np.abs(z) <= limit
        if (now == used).all() or any((now == before).all() for before in seen):
            break
        seen.append(used)
        used = now
    return found.pooled(middle, unit, z, used)


def furthest(boards: int) -> float:
    """Distance in standard deviations that any ordinary board of a fleet exceeds with the probability ``POLICY.fleet_odd``."""
    from scipy.stats import t

    return float(t.isf(POLICY.fleet_odd / (2 * boards), max(boards - 2, 2)))


def _medians(y: Array, rig: Labels) -> Array:
    """The median of each estimate's rig, [n], or that of all estimates if the rig has too few boards."""
    out = np.full(y.size, float(np.median(y)))
    for r in np.unique(rig):
        if np.count_nonzero(rig == r) >= 2 * POLICY.population_boards:
            out[rig == r] = np.median(y[rig == r])
    return out


@dataclass(frozen=True)
class _Reml:
    """The estimates at the spreads that REML found, all in units of the estimates' own spread."""

    s: float
    r: float
    mean: float
    mean_se: float
    offset: Array
    boards_se: Array
    rigs_se: Array
    """Standard error of each board's mean and of each rig's, from the estimates' errors (a rig's also from its boards)."""

    @staticmethod
    def of(y: Array, error: Array, board: Labels, rig: Labels, rigs: int) -> _Reml:
        from scipy.optimize import minimize

        sums = _Sums.of(y, error, board, rig, rigs)
        several = int(np.count_nonzero(sums.of_rig.any(axis=0))) > 1
        bounds = [(0.0, 10.0 * max(1.0, float(np.ptp(y))))] * (2 if several else 1)

        def cost(x: Array) -> float:
            return -sums.at(float(x[0]), float(x[1]) if several else 0.0).loglik

        starts = [[first, second][: len(bounds)] for first in (1.0, 0.1) for second in (1.0, 0.1)]
        options = {"ftol": 1e-14, "gtol": 1e-8}
        tried = [minimize(cost, start, method="L-BFGS-B", bounds=bounds, options=options) for start in starts]
        spreads = min(tried, key=lambda t: t.fun).x
        s, r = float(spreads[0]), float(spreads[1]) if several else 0.0
        best = sums.at(s, r)
        boards_se = 1 / np.sqrt(sums.of_rig.sum(axis=1))
        weight = (sums.of_rig / (1 + s**2 * sums.of_rig.sum(axis=1))[:, None]).sum(axis=0)
        rigs_se = 1 / np.sqrt(weight[weight > 0]) if several else np.zeros(0)
        return _Reml(s, r, best.mean, best.mean_se, best.offset, boards_se, rigs_se)

    def z(self, y: Array, error: Array, rig: Labels) -> Array:
        return np.asarray((y - self.mean - self.offset[rig]) / np.sqrt(self.s**2 + error**2 + self.mean_se**2 * (self.r == 0)))

    def pooled(self, middle: float, unit: float, z: Array, used: Mask) -> Pooled:
        rig_sd, rig_sd_se = (self.r * unit, spread_error(self.r, self.rigs_se) * unit) if self.rigs_se.size else (None, None)
        return Pooled(
            middle + unit * self.mean, unit * self.mean_se, unit * self.s, unit * spread_error(self.s, self.boards_se),
            rig_sd, rig_sd_se, unit * self.offset, z, used,
        )  # fmt: skip


def spread_error(sd: float, errors: Array) -> float:
    """Standard error of a spread over units whose own values have the standard errors ``errors`` [k], by Fisher's information.

    For a spread near zero it is the size whose square is the standard error of the variance.
    """
    of_variance = 0.5 * float(np.sum(1 / (sd**2 + errors**2) ** 2)) * (1 - 1 / errors.size)
    zero = of_variance**-0.25
    return float(min(zero, 1 / (2 * sd * np.sqrt(of_variance)))) if sd > 0 else zero


class _AtSpreads(NamedTuple):
    """REML log-likelihood at given spreads; the mean, its standard error, and the offset of each rig, [rigs]."""

    loglik: float
    mean: float
    mean_se: float
    offset: Array


@dataclass(frozen=True)
class _Sums:
    """Sums of precision, and of precision times estimate, for each board and rig [boards, rigs]; the sum of squares about the
    boards' means ``within``; the sum of the logarithms of precision."""

    of_rig: Array
    of_value: Array
    within: float
    log: float
    n: int

    @staticmethod
    def of(y: Array, error: Array, board: Labels, rig: Labels, rigs: int) -> _Sums:
        precision = 1 / error**2
        boards = np.unique(board, return_inverse=True)[1]
        of_rig, of_value = np.zeros((boards.max() + 1, rigs)), np.zeros((boards.max() + 1, rigs))
        np.add.at(of_rig, (boards, rig), precision)
        np.add.at(of_value, (boards, rig), precision * y)
        means = of_value.sum(axis=1) / of_rig.sum(axis=1)
        return _Sums(of_rig, of_value, float(precision @ (y - means[boards]) ** 2), float(np.log(precision).sum()), y.size)

    def at(self, s: float, r: float) -> _AtSpreads:
        """The estimates at the spread ``s`` over boards and ``r`` over rigs."""
        board, value = self.of_rig.sum(axis=1), self.of_value.sum(axis=1)
        left = 1 / (1 + s**2 * board)  # written so that nothing cancels if the estimates have no errors
        own = (self.of_rig * (1 + s**2 * (board[:, None] - self.of_rig)) * left[:, None]).sum(axis=0)
        a = -(s**2) * (self.of_rig * left[:, None]).T @ self.of_rig
        np.fill_diagonal(a, own)
        apart = self.of_value * board[:, None] - self.of_rig * value[:, None]
        b = ((self.of_value + s**2 * apart) * left[:, None]).sum(axis=0)
        square = self.within + float((value**2 / board) @ left)
        logdet = float(np.log1p(s**2 * board).sum()) - self.log
        # rigs = mean + r·v with v ~ N(0, 1) are integrated out
        inner = np.eye(b.size) + r**2 * a
        logdet += float(np.linalg.slogdet(inner)[1])
        ones = (self.of_rig * left[:, None]).sum(axis=0)
        solved = np.linalg.solve(inner, np.column_stack([np.ones(b.size), b]))
        information = float(ones @ solved[:, 0])  # ones = a·1, so that nothing cancels here either
        mean = float(solved[:, 1].sum()) / information
        offset = r**2 * solved[:, 1] - mean * (1 - solved[:, 0])
        chi2 = square - r**2 * float(b @ solved[:, 1]) - information * mean**2
        loglik = -0.5 * (logdet + np.log(information) + chi2 + (self.n - 1) * np.log(2 * np.pi))
        return _AtSpreads(float(loglik), mean, information**-0.5, offset)
