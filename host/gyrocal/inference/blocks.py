"""Block means of a session, to which slow effects are fitted.

All effects except tones and faults of the reading vary slowly compared with a tenth of a second. Means over blocks of that
length keep all information about them, because columns are averaged in the same way, and are about a dozen times fewer.
Outliers are moved back to their neighbours first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from gyrocal.effects.dead_band import outliers_of
from gyrocal.effects.earth_rate import known_dps as earth_dps
from gyrocal.noise.smoothed import smoothed_s
from gyrocal.policy import POLICY
from gyrocal.recording.first_readings import FIRST, first_apart, last_apart
from gyrocal.recording.session import AXES, GAP_PERIODS, Array, Run, Session
from gyrocal.recording.stamps import typical_step_s
from gyrocal.recording.timing import Timing

BLOCK_S = 0.1
OF_FILTER = 4.0
"""Length of the blocks in lengths of a slow filter: neighbours then share a twentieth of the noise."""
STATED = 0.05
"""The session's sample rate sets the number of samples of a block unless it is off that of the times by more than this."""

Index = np.ndarray[Any, np.dtype[np.intp]]
NOWHERE, NOTHING = np.zeros(0, dtype=np.intp), np.zeros(0)


@dataclass(frozen=True)
class Blocks:
    """One run in blocks of equally many samples. A block never spans a gap, and an incomplete last block is left out.

    ``start`` [m] is the first sample of each block, ``n`` [m] its number of samples, ``t_s`` [m] its mean time in s, and
    ``y_dps`` [m, 3] the mean of measured minus true rate. ``within_ss`` [3] is the sum of squares about the block means, dps^2,
    and ``within_n`` its degrees of freedom.
    """

    run: Run
    scenario: int
    start: Index
    n: Array
    t_s: Array
    y_dps: Array
    within_ss: Array
    within_n: int
    weight: Array | None = None
    """Relative precision [m] of a sample's noise in each block, if the level of the noise changes; None = equal."""
    strays: tuple[tuple[Index, Array], ...] = ((NOWHERE, NOTHING),) * 3
    """For each axis, the readings [k] that were moved back to their neighbours, and by how much, deg/s."""

    @property
    def precision(self) -> Array:
        """Number of samples of the usual noise that know as much as each block, shape [m]."""
        return self.n if self.weight is None else self.n * self.weight

    def mean(self, columns: Array) -> Array:
        """Block means of per-sample columns [n_samples, k], shape [m, k]."""
        if not self.start.size:
            return np.zeros((0, columns.shape[1]))
        if self.run.rate_is_mean:
            columns = columns * self.run.weights[:, None]
        if self.start.size == len(self.run):  # each sample is a block
            return columns
        stop = int(self.start[-1] + self.n[-1])
        sums = np.add.reduceat(columns[:stop], self._edges, axis=0)
        return (sums if self._edges is self.start else sums[self._picked]) / self.n[:, None]

    @cached_property
    def samples(self) -> float:
        """Number of samples in all blocks."""
        return float(self.n.sum())

    @cached_property
    def step_s(self) -> float:
        """Usual time between blocks, s; infinite for a single one."""
        return float(np.median(np.diff(self.t_s))) if self.t_s.size > 1 else np.inf

    @cached_property
    def rate_dps(self) -> Array:
        """Mean true rate about the run's axis in each block, shape [m], deg/s."""
        return self.mean(self.run.rate_dps[:, None])[:, 0]

    @cached_property
    def _edges(self) -> Index:
        # reduceat sums up to the next edge, so the end of each block is also an edge if samples between blocks are left out
        stops = (self.start + self.n.astype(np.intp))[:-1]
        apart = np.flatnonzero(stops != self.start[1:])
        return np.insert(self.start, apart + 1, stops[apart]) if apart.size else self.start

    @cached_property
    def _picked(self) -> Index:
        return np.searchsorted(self._edges, self.start)

    def select(self, kept: np.ndarray[Any, np.dtype[np.bool_]]) -> Blocks:
        """A selection of the blocks, with the corresponding fraction of the scatter within blocks."""
        share = float(kept.mean())
        return Blocks(
            self.run, self.scenario, self.start[kept], self.n[kept], self.t_s[kept], self.y_dps[kept],
            self.within_ss * share, round(self.within_n * share), None if self.weight is None else self.weight[kept],
            self.strays,
        )  # fmt: skip

    def about(self, axis: str) -> Blocks:
        """The same blocks with the true rate about another axis of the sensor, if the reference has three axes."""
        run = self.run.about(axis)
        return self if run is self.run else replace(self, run=run)

    def timed(self, timing: Timing) -> Blocks:
        """The same blocks against the true rate of another timing; a block that shows an unrecorded moment is left out."""
        run = self.run.timed(timing)
        if run is self.run:
            return self
        whole = self.mean(run.reached[:, None].astype(float))[:, 0] == 1.0
        size = round(float(self.n[0])) if self.n.size else 1
        weight = None if self.weight is None else self.weight[whole]
        return replace(_blocks_of(run, self.scenario, self.start[whole], size), weight=weight)


def known_dps(run: Run, axis: int) -> Array:
    """Known true rate about an axis, shape [n], deg/s: the table's, plus the Earth's if the latitude is given."""
    run = run.about(AXES[axis])
    known = _as_read(run) if axis == run.axis_index else np.zeros(len(run))
    return known if run.latitude_deg is None else known + earth_dps(run, axis, run.latitude_deg)


def _as_read(run: Run) -> Array:
    """The true rate about the run's axis [n], deg/s. What varies of a single rate is as large as the readings show it.

    The scale is the mean rate's alone, and must not be left of a true wobble. What the readings do not follow is an error
    of the reference and stays as it is.
    """
    rate_dps, mean_dps = run.rate_dps, run.one_rate_dps
    if mean_dps is None:
        return rate_dps
    varies_dps = np.where(run.reached, rate_dps - mean_dps, 0.0)
    power = float(varies_dps @ varies_dps)
    follows = float(varies_dps @ run.gyro_dps[:, run.axis_index]) / power if power > 0 else 1.0
    return rate_dps + (follows - 1) * varies_dps if abs(follows - 1) < POLICY.largest_scale else rate_dps


def residual_dps(run: Run) -> Array:
    """Measured minus true rate, shape [n, 3], deg/s."""
    return run.gyro_dps - np.column_stack([known_dps(run, axis) for axis in range(3)])


def begins_apart(run: Run, axis: int, y_dps: Array) -> Array:
    """Deviation of the first readings of a residual [n] from the following ones, shape [FIRST], deg/s, for a warning.

    It is zero where the first readings have no reference, as beside the start of a measured angle.
    """
    return _apart(run, axis, y_dps, slice(FIRST + 2), first_apart)


def ends_apart(run: Run, axis: int, y_dps: Array) -> Array:
    """Deviation of the last readings of a residual [n] from the preceding ones, shape [FIRST], as :func:`begins_apart`."""
    return _apart(run, axis, y_dps, slice(-FIRST - 2, None), last_apart)


def _apart(run: Run, axis: int, y_dps: Array, near: slice, apart: Callable[[Array, float, float], Array]) -> Array:
    run = run.about(AXES[axis])
    if not run.reached[near].all():
        return np.zeros(min(FIRST, y_dps.size))
    moves_dps = 2 * float(np.ptp(run.rate_dps[near])) if axis == run.axis_index else 0.0
    return apart(y_dps, float(run.step_dps[axis]), moves_dps)


def reduce_run(run: Run, scenario: int, block_s: float = BLOCK_S) -> Blocks:
    """Blocks of one run. A run of which only the net angle is known is a single block."""
    n = len(run)
    period_s = typical_step_s(run.sample_s)
    stated = abs(period_s * run.sample_rate_hz - 1) <= STATED
    size = n if run.rate_is_mean else min(n, max(1, round(block_s * (run.sample_rate_hz if stated else 1 / period_s))))
    gaps = np.diff(run.sample_s) > GAP_PERIODS * period_s
    gap = np.concatenate([[0], np.cumsum(gaps)]) if size < n else np.zeros(n, dtype=int)
    starts = []
    for first, length in _stretches(gap):
        whole = length // size
        starts.append(first + size * np.arange(whole))
    start = np.concatenate(starts).astype(np.intp) if starts else np.zeros(0, dtype=np.intp)
    if start.size == 0:  # only gaps: every sample is a block
        size, start = 1, np.arange(n, dtype=np.intp)
    if not run.reached.all():  # a block without a reference has no residual
        start = start[run.reached[start[:, None] + np.arange(size)].all(axis=1)]
    return _blocks_of(run, scenario, start, size)


def _blocks_of(run: Run, scenario: int, start: Index, size: int) -> Blocks:
    """The blocks of ``size`` samples that begin at the samples ``start`` [m]."""
    y = residual_dps(run)
    read = y.copy()
    if run.rate_is_mean:
        y *= run.weights[:, None]
        read = y
    else:
        for axis in range(3):
            y[:FIRST, axis] -= begins_apart(run, axis, y[:, axis])
            y[-FIRST:, axis] -= ends_apart(run, axis, y[:, axis])
            rows_out, apart_dps = outliers_of(run.about(AXES[axis]), axis, y[:, axis])
            y[rows_out, axis] -= apart_dps
    rows = start[:, None] + np.arange(size)
    grouped = y[rows]
    means = grouped.mean(axis=1)
    means[:, run.axis_index] -= _angle_left_dps(run, start, size)
    within = ((grouped - means[:, None, :]) ** 2).sum(axis=(0, 1))
    counted = 0 if run.rate_is_mean else start.size * (size - 1)
    return Blocks(
        run, scenario, start, np.full(start.size, float(size)), run.sample_s[rows].mean(axis=1), means,
        within if counted else np.zeros(3), counted, strays=tuple(_moved(read[:, axis], y[:, axis]) for axis in range(3)),
    )  # fmt: skip


def _moved(before: Array, after: Array) -> tuple[Index, Array]:
    rows = np.flatnonzero(before != after)
    return rows, before[rows] - after[rows]


def _angle_left_dps(run: Run, start: Index, size: int) -> Array:
    """What smoothing has taken from the mean rates of blocks of a run whose angle is measured, [m], deg/s.

    With it, the mean rate is the difference of the angles at both ends of a block over its length. Each is averaged over half a
    block on either side, so that the noise of one end is shared by the two blocks beside it and by no other.
    """
    left_deg = None if run.measured_rates is None else run.measured_rates.left_deg
    half = size // 2
    if left_deg is None or half == 0:
        return np.zeros(start.size)
    known = np.isfinite(left_deg)
    summed, count = (np.concatenate([[0.0], np.cumsum(x)]) for x in (np.where(known, left_deg, 0.0), known))
    ends = np.stack([start, start + size])
    lower, upper = (np.clip(ends + by, 0, known.size) for by in (-half, half))
    at_ends = (summed[upper] - summed[lower]) / np.maximum(count[upper] - count[lower], 1.0)
    return np.asarray(np.diff(at_ends, axis=0)[0] / (size * typical_step_s(run.sample_s)))


def reduce_session(session: Session, block_s: float | None = None) -> list[Blocks]:
    """Blocks of every run, with its power cycle numbered in order, of a given length or of that which the noise asks for."""
    number, block_s = {name: i for i, name in enumerate(session.scenarios)}, block_s or _block_s(session)
    return [reduce_run(run, number[run.scenario], block_s) for run in session.runs]


def _block_s(session: Session) -> float:
    """The length of the blocks, s: longer where a slow filter would leave their means more alike than
    :class:`~gyrocal.noise.color.Color` describes.
    """
    filter_s = float(np.median([smoothed_s(session.runs, axis, BLOCK_S) for axis in range(3)]))
    longest_s = min(run.duration_s for run in session.runs) / POLICY.least_blocks
    return max(BLOCK_S, min(OF_FILTER * filter_s, longest_s))


def step_s(blocks: Sequence[Blocks]) -> float:
    """Shortest usual time between the blocks of a run, s; 1 where each run is a single block."""
    least_s = min((b.step_s for b in blocks), default=np.inf)
    return least_s if np.isfinite(least_s) else 1.0


def by_sample(blocks: Sequence[Blocks]) -> list[Blocks]:
    """The same runs with each sample as a block, for effects that vary from sample to sample."""
    return [b if b.run.rate_is_mean else reduce_run(b.run, b.scenario, 0.0) for b in blocks]


def _stretches(label: np.ndarray[Any, Any]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(label)) + 1
    bounds = np.concatenate([[0], edges, [label.size]])
    return [(int(a), int(b - a)) for a, b in pairwise(bounds)]
