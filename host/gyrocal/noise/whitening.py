"""Whitened normal equations of block means for white noise plus a slow Ornstein-Uhlenbeck drift.

Ordinary least squares mistakes drift for an effect (docs/method.md). Generalised least squares with this covariance does not.
The cost is O(n), because only a tridiagonal system is solved. If drift is slow compared with the
white noise, it can be taken as constant within short cells of time. The cost of another noise level is then proportional to the
number of cells.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np

from gyrocal.noise.color import WHITE, Color
from gyrocal.recording.session import Array

Index = np.ndarray[Any, np.dtype[np.intp]]

JOINED = 1.5
"""Blocks follow each other if their distance is below this multiple of the usual one."""
ROUNDING = 1e-6
"""Of a cell: the times of blocks that begin a cell are known to this part of it."""
AT_ONCE = 2**14
"""Approximate number of values that are multiplied at once, so that they fit into the processor's cache."""


@dataclass(frozen=True)
class Noise:
    """The noise of one axis.

    ``white_sd_dps`` is the standard deviation of one sample's white noise in deg/s. The drift has the standard deviation
    ``ou_sd_dps`` in deg/s and the correlation time ``ou_tau_s`` in s.
    """

    white_sd_dps: float
    ou_sd_dps: float = 0.0
    ou_tau_s: float = 30.0

    def times(self, factor: float) -> Noise:
        """The noise with all standard deviations multiplied by a factor."""
        return Noise(factor * self.white_sd_dps, factor * self.ou_sd_dps, self.ou_tau_s)

    def drift_within(self, seconds: float) -> float:
        """The variance of the drift about its mean over a run of so many seconds, dps^2."""
        times = max(seconds / self.ou_tau_s, 1e-6)
        of_mean = 2 / times * (1 + float(np.expm1(-times)) / times)
        return self.ou_sd_dps**2 * max(0.0, 1 - of_mean)


@dataclass(frozen=True)
class Summed:
    """Sums of the columns of runs with the same block times, as far as they do not depend on the noise level.

    ``gram`` [runs, q, q] holds products summed over all blocks, and ``within`` [runs, q, q] the part of them that is about the
    means of the cells. ``means`` [runs, q, k] holds means over cells of time in which
    drift is taken to be constant, ``t_s`` [k] their mean times in s and ``n`` [k] their numbers of samples. ``blocks`` is the
    number of blocks and ``log_n`` the sum of log n over them, plus twice the logarithm of the determinant of the filter against
    colour. ``owed`` [runs, q, q] are products that columns owe to a white noise of their own (:meth:`less`).
    :meth:`normal_equations` completes the computation.
    """

    gram: Array
    within: Array
    means: Array
    t_s: Array
    n: Array
    blocks: int
    log_n: float
    owed: Array | None = None

    @staticmethod
    def of(columns: Iterable[Array], t_s: Array, n: Array, cell_s: float = 0.0, color: Color = WHITE) -> Summed:
        """Sum ``columns`` [q, m] of each run: q columns of m block means at times ``t_s`` [m] in s, of ``n`` [m] samples each.

        With ``cell_s`` = 0 every block is a cell, and the normal equations are exact. A single block
        has no neighbour, and no ``color``.
        """
        blocks, log_n = t_s.size, float(np.log(n).sum())
        joined = np.zeros(0, dtype=bool)
        if color and blocks > 1:
            joined = np.diff(t_s) < JOINED * float(np.median(np.diff(t_s)))
            log_n += color.log_determinant(joined)
        even = bool(np.ptp(n) == 0)
        each = float(n[0]) if even else 1.0
        cell = np.floor((t_s - t_s[0]) / cell_s + ROUNDING) if cell_s > 0 else np.arange(blocks)
        start = np.flatnonzero(np.concatenate([[True], np.diff(cell) > 0]))
        exact = start.size == blocks
        total = n if exact else np.add.reduceat(n, start)
        grams, withins, means = [], [], []
        for some in _stacked(columns):
            if joined.size:
                some = color.whitened(some.reshape(-1, blocks), joined).reshape(some.shape)
            weighted: Array = some if even else some * n
            if exact:
                mean, within = some, np.zeros((*some.shape[:2], some.shape[1]))
                gram: Array = weighted @ some.swapaxes(-1, -2) * each
            else:
                mean = np.add.reduceat(weighted, start, axis=-1) * (each / total)
                about: Array = some - np.repeat(mean, np.diff(start, append=blocks), axis=-1)
                within = (about if even else about * n) @ about.swapaxes(-1, -2) * each
                gram = within + mean * total @ mean.swapaxes(-1, -2)
            grams.append(gram)
            withins.append(within)
            means.append(mean)
        centre_s = t_s if exact else np.add.reduceat(t_s * n, start) / total
        gram, within, mean = (np.concatenate(parts) for parts in (grams, withins, means))
        return Summed(gram, within, mean, centre_s, total, blocks, log_n)

    def of_columns(self, rows: np.ndarray[Any, np.dtype[np.intp]]) -> Summed:
        """The same sums for a selection of the columns."""
        gram, within = (products[:, rows][:, :, rows] for products in (self.gram, self.within))
        owed = None if self.owed is None else self.owed[:, rows][:, :, rows]
        return replace(self, gram=gram, within=within, means=self.means.take(rows, axis=1), owed=owed)

    @staticmethod
    def joined(runs: Sequence[tuple[Summed, int]], later_s: Sequence[float]) -> Summed:
        """The sums over runs that follow each other, as of one run: its drift goes on from each to the next.

        Each of ``runs`` is the number of one within its sums, whose times are ``later_s`` after those of the first, s.
        """
        gram, within = (sum(getattr(of, name)[i : i + 1] for of, i in runs) for name in ("gram", "within"))
        t_s = np.concatenate([of.t_s + by_s for (of, _), by_s in zip(runs, later_s, strict=True)])
        return Summed(
            gram, within, np.concatenate([of.means[i : i + 1] for of, i in runs], axis=-1), t_s,
            np.concatenate([of.n for of, _ in runs]), sum(of.blocks for of, _ in runs), sum(of.log_n for of, _ in runs),
        )  # fmt: skip

    def less(self, products: Array) -> Summed:
        """The same sums less ``products`` [runs, q, q], which columns owe to a noise of their own that is white.

        Whitening takes a part of that noise with the drift, and only what is left of it is taken out of the normal equations.
        """
        return replace(self, gram=self.gram - products, owed=products if self.owed is None else self.owed + products)

    @cached_property
    def _distinct(self) -> tuple[Index, Index]:
        """The rows of all runs' means that differ, and which of them each row is the same as, shape [runs, q].

        Bias and, on a table that turns evenly, scale have the same column in many runs.
        """
        rows = self.means.reshape(-1, self.t_s.size)
        constant = (rows == rows[:, :1]).all(axis=1)
        own, level = np.flatnonzero(~constant), np.flatnonzero(constant)
        _, first, which = np.unique(rows[level, 0], return_index=True, return_inverse=True)
        same = np.empty(len(rows), dtype=np.intp)
        same[own], same[level] = np.arange(own.size), own.size + which
        return np.concatenate([own, level[first]]), same.reshape(self.means.shape[:2])

    @cached_property
    def _rows(self) -> tuple[Array, Array]:
        """The rows [r, k] of the means that differ, and their differences from cell to cell [r, k - 1]."""
        rows = self.means.reshape(-1, self.t_s.size)[self._distinct[0]]
        return rows, np.diff(rows)

    @cached_property
    def _apart_s(self) -> Array:
        """The times from cell to cell, shape [k - 1], s."""
        return np.diff(self.t_s)

    @cached_property
    def _even(self) -> bool:
        return bool(np.ptp(self.n) == 0)

    def normal_equations(self, noise: Noise) -> tuple[Array, float]:
        """``C V^-1 C'`` of each run [runs, q, q] and ``log det V`` of one run, where V is the covariance of the noise."""
        grams, logdets = self.near(noise, ())
        return grams[0], float(logdets[0])

    def near(self, noise: Noise, others: Sequence[Noise]) -> tuple[Array, Array]:
        """The normal equations [1 + o, runs, q, q] and log-determinants [1 + o] of a noise and of ``others`` near it.

        White noise has a diagonal covariance D. The drift is a Markov process, so its inverse covariance Q is tridiagonal. It
        starts stationary in each run. Woodbury's identity gives ``V^-1 = D^-1 - D^-1 Z (Q + N)^-1 Z' D^-1``, where Z assigns
        each block to its cell and ``N = Z' D^-1 Z``. Gaps and unequal blocks therefore do not raise the cost. The part between
        cells is computed as ``N (Q + N)^-1 Q``: for a bias far above the noise, ``N - N (Q + N)^-1 N`` would be a small
        difference of large numbers, and its rounding would hide the slopes by which the noise is searched. For the same reason
        the part within cells is a sum of products about the cells' means, not the rest of ``gram`` beside them.

        The other noises have the same white level, and their normal equations are correct to first order. With the drift
        ``H = (Q + N)^-1 N C`` that the columns imply, the derivative of ``C' V^-1 C`` is that of ``H' Q H`` by Q alone.
        """
        from scipy.linalg.lapack import dpttrs

        precision = 1 / noise.white_sd_dps**2
        of_white = -self.blocks * float(np.log(precision)) - self.log_n
        if noise.ou_sd_dps <= 0.0:
            return self.gram[None] * precision, np.array([of_white])
        known = self.n * precision
        drifts = [_Drift.of(one, self._apart_s, known) for one in (noise, *others)]
        drift, (rows, differences) = drifts[0], self._rows
        left = dpttrs(drift.pivots, drift.factors, drift.whitened(rows, differences).T, overwrite_b=True)[0].T
        gram = self.within * precision
        if self.owed is not None:
            gram -= self.owed * (precision * self._left_white(drift, known))
        gram += precision * (self.n[0] * self._product(rows, left) if self._even else self._product(rows * self.n, left))
        grams = np.repeat(gram[None], len(drifts), axis=0)
        if others:
            np.subtract(rows, left, out=left)
            of_growth, of_rate = self._slopes(drift, left)
            for one, gram in zip(drifts[1:], grams[1:], strict=True):
                gram += np.log(one.growth / drift.growth) * of_growth + np.log(one.rate / drift.rate) * of_rate
                if self.owed is not None:
                    gram -= self.owed * (precision * (self._left_white(one, known) - self._left_white(drift, known)))
        return grams, np.array([of_white + one.logdet for one in drifts])

    def left_white(self, noise: Noise) -> float:
        """The part of the power of white noise in a column that :meth:`normal_equations` leaves, beside that without drift."""
        if noise.ou_sd_dps <= 0.0:
            return 1.0
        known = self.n / noise.white_sd_dps**2
        return self._left_white(_Drift.of(noise, self._apart_s, known), known)

    def _left_white(self, drift: _Drift, known: Array) -> float:
        """``1 - trace((Q + N)^-1 N) / blocks``: the trace of V^-1 beside that of D^-1, for blocks of equal length."""
        return 1.0 - float(known @ drift.uncertain) / self.blocks

    def _slopes(self, drift: _Drift, rows: Array) -> tuple[Array, Array]:
        """Derivatives [runs, q, q] of the normal equations by the logarithms of the drift's growth and rate.

        ``rows`` [r, k] are the drifts that the distinct columns imply. The growth scales the variance that each step adds; the
        rate also changes what each step keeps.
        """
        steps = drift.steps(rows, np.diff(rows))
        steps /= drift.driven
        added = -drift.driven
        added[1:] += 2 * drift.variance * drift.ages * drift.kept**2
        other = -0.5 * added * steps
        other[:, 1:] += drift.ages * drift.kept * rows[:, :-1]
        half = self._product(steps, other)
        return -self._product(steps, steps * drift.driven), half + half.swapaxes(-1, -2)

    def _product(self, left: Array, right: Array) -> Array:
        """Products [runs, q, q] of rows [r, k] that stand for the distinct columns."""
        same = self._distinct[1]
        runs = max(1, AT_ONCE // (same.shape[1] * self.t_s.size))
        parts = (same[first : first + runs] for first in range(0, len(same), runs))
        return np.concatenate([left[part] @ right[part].swapaxes(-1, -2) for part in parts])


def _stacked(columns: Iterable[Array]) -> Iterator[Array]:
    """Columns [q, m] of many runs, as many of these at once as fit into the processor's cache, [runs, q, m]."""
    rest = iter(columns)
    for first in rest:
        yield np.stack([first, *islice(rest, AT_ONCE // max(1, first.size))])


@dataclass(frozen=True)
class _Drift:
    """The drift over k cells: its growth (dps^2/s) and rate (1/s), and the factors of ``Q + N``.

    ``diagonal`` [k] is that of ``Q + N``. ``ages`` [k - 1] are the times between cells in correlation times, ``kept`` and
    ``forgotten`` [k - 1] the parts of the drift that remain and that go over them, and ``driven`` [k] the variances that are
    added, the first of which is stationary. ``logdet`` is the drift's part of the log-determinant.
    """

    growth: float
    rate: float
    variance: float
    ages: Array
    kept: Array
    forgotten: Array
    driven: Array
    diagonal: Array
    pivots: Array
    factors: Array
    logdet: float

    @staticmethod
    def of(noise: Noise, apart_s: Array, known: Array) -> _Drift:
        """The drift of a noise at k cells that are ``apart_s`` [k - 1] from each other, s.

        White noise shows it there with the precisions ``known`` [k].
        """
        from scipy.linalg.lapack import dpttrf

        variance, ages = noise.ou_sd_dps**2, apart_s / noise.ou_tau_s
        kept = np.exp(-ages)
        driven = np.empty(known.size)
        driven[0], driven[1:] = variance, -variance * np.expm1(-2 * ages)
        precision = 1 / driven
        carried = kept * precision[1:]
        diagonal = known + precision
        diagonal[:-1] += kept * carried
        coupling = -carried if carried.size else np.zeros(1)  # LAPACK needs one element even for a single cell
        pivots, factors, _ = dpttrf(diagonal, coupling)
        logdet = float(np.log(driven * pivots).sum())
        growth, rate = variance / noise.ou_tau_s, 1 / noise.ou_tau_s
        return _Drift(growth, rate, variance, ages, kept, -np.expm1(-ages), driven, diagonal, pivots, factors, logdet)

    @cached_property
    def uncertain(self) -> Array:
        """The diagonal [k] of ``(Q + N)^-1``: the variance of the drift at each cell beside the readings, dps^2.

        Of a tridiagonal matrix it is ``1 / (p + r - d)`` with the pivots p from the first row on, r from the last row on, and
        the diagonal d (Meurant, SIAM J. Matrix Anal. 13 (1992) 707).
        """
        from scipy.linalg.lapack import dpttrf

        coupling = self.pivots[:-1] * self.factors if self.diagonal.size > 1 else np.zeros(1)
        backward = dpttrf(self.diagonal[::-1].copy(), coupling[::-1].copy())[0][::-1]
        return np.asarray(1 / (self.pivots + backward - self.diagonal))

    def steps(self, rows: Array, differences: Array) -> Array:
        """What rows of values at cells [r, k] are beside what is kept of the cell before, [r, k].

        ``differences`` [r, k - 1] are those from cell to cell.
        """
        out = np.empty(rows.shape)
        out[:, 0] = rows[:, 0]
        np.multiply(rows[:, :-1], self.forgotten, out=out[:, 1:])
        out[:, 1:] += differences
        return out

    def whitened(self, rows: Array, differences: Array) -> Array:
        """``rows·Q`` [r, k]: rows of values at cells times the inverse covariance of the drift."""
        out = self.steps(rows, differences)
        out /= self.driven
        out[:, :-1] -= self.kept * out[:, 1:]
        return out


def normal_equations(columns: Array, t_s: Array, n: Array, noise: Noise) -> tuple[Array, float]:
    """Exact normal equations [runs, q, q] of columns [runs, q, m], and the log-determinant of one run; see :class:`Summed`."""
    return Summed.of(columns, t_s, n).normal_equations(noise)
