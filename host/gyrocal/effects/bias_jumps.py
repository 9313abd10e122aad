"""Jumps of the bias, and outliers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal import tails
from gyrocal.effects.base import Looks, OfEachRun, Parameter, Tried, Values, elapsed_s
from gyrocal.effects.coding import Coding
from gyrocal.effects.dead_band import outliers_of as reading_outliers
from gyrocal.effects.optional import InWords
from gyrocal.effects.quantities import reading_error_dps
from gyrocal.effects.reading_fault import Detected, Fault
from gyrocal.effects.sampling_fault import stale
from gyrocal.effects.single_bits import may_be_single_power, single_power
from gyrocal.policy import POLICY
from gyrocal.recording.first_readings import without_ends
from gyrocal.recording.once import once
from gyrocal.recording.outliers import Index
from gyrocal.recording.session import Array, Run
from gyrocal.recording.tail import chance_of

MOST = 4
"""Largest number of jumps per run."""
WINDOW_S = 5.0
PARTS = 10
"""Parts of a window between which its noise is measured."""
MEDIAN_CHI2 = 0.4549
"""Median of a chi-square variable of one degree of freedom."""
SWINGS = 0.05
"""Change of the rate, as a fraction of the fastest, from which on it is a motion and not the noise of a reference."""
DIFFERENCED_S = 0.5
SHOWN = 1e-3
"""Probability under noise above which outliers are no fault."""
PROPORTIONAL = 0.75
"""Part of the jumps' mean square that follows the rate if the scale jumps and not the bias."""
SHUFFLES = 1000
NEAR = 0.1
"""Distance in time, as a part of the window, within which jumps of different runs are at the same time."""
REPEATED = 3
"""Least number of jumps that are at the time of another."""
STANDS_OUT = 6.0
"""Standard errors by which the means before and after must differ, and also do so beside a slope. Noise does not reach this
over all times of a session."""


def jumps(run: Run, axis: int) -> list[int]:
    """Rows, in order, at which the mean of the following seconds differs from that of the preceding seconds.

    At most ``MOST`` rows are returned, the most significant ones.
    """
    return [row for row, _ in _sized_jumps(run, axis)]


def _sized_jumps(run: Run, axis: int) -> list[tuple[int, float]]:
    """The rows of :func:`jumps` with the differences of the means after and before, deg/s."""
    return _searched((run,), axis)


@once
def _searched(runs: Sequence[Run], axis: int) -> list[tuple[int, float]]:
    """The jumps of a single run, which every fit of the effect needs again."""
    (run,) = runs
    if run.rate_is_mean:
        return []
    known = np.flatnonzero(run.reached)
    error_dps = without_ends(reading_error_dps(run, axis)[known], float(run.step_dps[axis]))
    y = _without_swing(error_dps, run.rate_dps[known], run.duration_s)
    width = round(_window_s(run) * run.sample_rate_hz)
    if width < 4 or y.size < 4 * width:
        return []
    total = np.concatenate([[0.0], np.cumsum(y)])
    mean = (total[width:] - total[:-width]) / width
    step = mean[width:] - mean[:-width]
    beside = step - width * _slope(y, width)  # twice as uncertain
    drifts = np.abs(beside) > 2 * np.abs(step)
    score = np.where(drifts, np.abs(beside) / 2, np.minimum(np.abs(step), np.abs(beside))) / (_error(total, width) + 1e-300)
    step = np.where(drifts, beside, step)
    found: list[tuple[int, float]] = []
    while len(found) < MOST and score.max(initial=0.0) > STANDS_OUT:
        k = int(np.argmax(score))
        found.append((int(known[k + width]), float(step[k])))
        score[max(0, k - width) : k + width] = 0.0
    return sorted(found)


def follow_the_rate(runs: Sequence[Run], axis: int) -> bool:
    """True if the jumps are in proportion to the true rate, as those of the scale are: none at rest, of the rate's sign.

    The first jump of each run has one ratio to the rate, the second another, and so on. The sizes are then given to other runs
    and with other signs at random (Fisher's test): jumps of the bias follow the rate no less often in that way.
    """
    steady = [r for r in runs if not r.rate_is_mean]
    sizes_dps = np.zeros((len(steady), MOST))
    for i, run in enumerate(steady):
        found = [size for _, size in _sized_jumps(run, axis)]
        sizes_dps[i, : len(found)] = found
    rates_dps = np.array([float(np.mean(r.rate_dps)) for r in steady])
    whole = float(np.sum(sizes_dps**2) * np.sum(rates_dps**2))
    if not whole:
        return False

    def followed(sizes_dps: Array) -> float:
        return float(np.sum((rates_dps @ sizes_dps) ** 2)) / whole

    share = followed(sizes_dps)
    if share < PROPORTIONAL:
        return False
    rng = np.random.default_rng(0)
    shuffled = (rng.permutation(sizes_dps) * rng.choice((-1.0, 1.0), (len(steady), 1)) for _ in range(SHUFFLES))
    return sum(followed(other) > share - 1e-9 for other in shuffled) < POLICY.needless * SHUFFLES


def repeat_in_runs(runs: Sequence[Run], axis: int) -> bool:
    """True if jumps are at the same times in several runs, as where the table changes its rate.

    Those of the bias are anywhere.
    """
    steady = [r for r in runs if not r.rate_is_mean]
    times_s = [elapsed_s(r)[jumps(r, axis)] for r in steady]
    within_s = NEAR * min((_window_s(r) for r in steady), default=0.0)
    repeated = int(np.count_nonzero(np.diff(np.sort(np.concatenate([np.zeros(0), *times_s]))) < within_s))
    if repeated < REPEATED:
        return False
    number = np.array([t_s.size for t_s in times_s])
    pairs = (number.sum() ** 2 - np.sum(number**2)) / 2  # of different runs
    return tails.poisson(repeated, pairs * 2 * within_s / max(r.duration_s for r in steady)) < POLICY.name_alarm


def _without_swing(y_dps: Array, rate_dps: Array, duration_s: float) -> Array:
    """Readings [n] without what a rate that changes explains: errors of scale, alignment, linearity and time are no jumps.

    Differences of means over 0.5 s are fitted. A jump is in one of them, and in half of the readings.
    """
    largest_dps = float(np.abs(rate_dps).max(initial=0.0))
    if np.ptp(rate_dps) < SWINGS * largest_dps or not largest_dps:
        return y_dps
    w = rate_dps / largest_dps
    swing = np.column_stack([w, np.abs(w), w**3, np.gradient(w)])
    swing /= np.maximum(np.linalg.norm(swing, axis=0), 1e-12)
    parts = np.array_split(np.column_stack([y_dps, swing]), max(2, round(duration_s / DIFFERENCED_S)))
    moved = np.diff([part.mean(axis=0) for part in parts], axis=0)
    return np.asarray(y_dps - swing @ np.linalg.lstsq(moved[:, 1:], moved[:, 0], rcond=1e-6)[0])


def _slope(y_dps: Array, width: int) -> Array:
    """The common slope of the windows before and after each row [n - 2 width + 1], deg/s from sample to sample.

    A bias that drifts has it all along; what it explains is no jump.
    """
    y = y_dps - y_dps.mean()
    at = np.arange(y.size) - 0.5 * y.size
    total, moment = (np.concatenate([[0.0], np.cumsum(x)]) for x in (y, at * y))
    middle = at[: y.size - width + 1] + 0.5 * (width - 1)
    of_window = (moment[width:] - moment[:-width]) - middle * (total[width:] - total[:-width])
    return np.asarray((of_window[:-width] + of_window[width:]) / (width * (width**2 - 1) / 6))


def _error(total: Array, width: int) -> Array:
    """Standard error of the difference of the means after and before each row [n - 2 width + 1], from cumulative sums.

    The scatter of means over a tenth of a window counts, because a low-pass filter makes neighbouring samples alike; and that
    of the run or of the window's own time, whichever is larger, because the level of the noise may change.
    """
    part = max(1, width // PARTS)
    mean = np.diff(total[::part]) / part
    square = np.diff(mean) ** 2 / 2
    usual = float(np.median(square)) / MEDIAN_CHI2
    summed = np.concatenate([[0.0], np.cumsum(square)])
    centre = np.arange(width, total.size - width) // part
    per_window = width // part

    def scatter(first: Index, stop: Index) -> Array:
        first, stop = (np.clip(edge, 0, square.size) for edge in (first, stop))
        return (summed[stop] - summed[first]) / np.maximum(stop - first, 1)

    sides = (scatter(centre - per_window, centre - 1), scatter(centre + 1, centre + per_window))
    return np.asarray(np.sqrt(sum(np.maximum(side, usual) for side in sides) * part / width))


def _window_s(run: Run) -> float:
    return min(WINDOW_S, run.duration_s / 6)


def outliers_of(run: Run, axis: int) -> Array:
    """Deviation of each outlier from its neighbours, shape [n], deg/s; zero for all other readings.

    A repeated reading that stands out is an old one, and no outlier.
    """
    out = np.zeros(len(run))
    if not run.rate_is_mean:
        rows, apart_dps = reading_outliers(run, axis, reading_error_dps(run, axis))
        out[rows] = apart_dps
        out[1:][stale(run)] = 0.0
    return out


class Outliers(Fault):
    """Outliers: the part of the effect that is a fault of the reading."""

    def describes(self, values: Mapping[str, float]) -> bool:
        return values.get("outliers", 0.0) > 0

    def detect(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """Detect outliers, at least two. Those that all have the size of one bit are wrongly assembled codes.

        Where they may be, they are no sure outliers of another cause.
        """
        if single_power(runs, axis) is not None:
            return None
        apart_dps = np.concatenate([outliers_of(r, axis) for r in runs])
        found = apart_dps[apart_dps != 0]
        if found.size < 2:
            return None
        steady = [r for r in runs if not r.rate_is_mean]
        errors_dps = [reading_error_dps(r, axis)[r.reached] for r in steady]
        chance = chance_of(errors_dps, max(float(r.step_dps[axis]) for r in steady))
        if chance > SHOWN:
            return None
        values = {
            "n": found.size / len(runs), "size_dps": float(np.sqrt(np.mean(found**2))), "outliers": found.size / apart_dps.size
        }  # fmt: skip
        return Detected(values, {}, max(chance, SHOWN if may_be_single_power(runs, axis) else 0.0))

    def respond(self, run: Run, axis: int, modelled_dps: Array, values: Mapping[str, float], white_sd_dps: float) -> Array:
        return modelled_dps + outliers_of(run, axis)

    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """Readings with single deviations of ``size_dps`` of either sign on the run's own axis."""
        out = y_dps.copy()
        rows = np.flatnonzero(rng.random(len(run)) < values["outliers"])
        out[rows, run.axis_index] += values["size_dps"] * rng.choice((-1.0, 1.0), rows.size)
        return out

    def throws_out(self, values: Mapping[str, float]) -> bool:
        return values.get("outliers", 0.0) > 0


class _UpOrDown(Coding):
    """The steps of a run's jumps, which are up or down by one size."""

    def coefficients(self, values: Mapping[str, float]) -> Array:
        return np.full(MOST, values["size_dps"])

    def named(self, coefficients: Array, values: Mapping[str, float]) -> Values:
        return {"size_dps": float(np.mean(coefficients))}

    def spread(self, values: Mapping[str, float]) -> Array:
        return np.full(MOST, values["size_dps"])

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        return {"size_dps": float(spread[0])}

    def groups(self, values: Mapping[str, float]) -> list[int]:
        return [0] * MOST


class BiasJumps(OfEachRun, InWords):
    id = "bias_jumps"
    title = "Jumps of the bias"
    cause = (
        "The bias steps to a new value between two samples and stays there. A trapped charge or a stress in the "
        "package is released, a knock moves the mount, or the chip's own calibration changes a trim value. Single "
        "readings far from their neighbours (outliers), of any size, come from a disturbed supply or bus."
    )
    equation = "±size_dps from each of n times on"
    looks_like = "drift and colored_noise in averaged data; turn_on_bias if the bias jumps between runs"
    measure_next = "repeat the recording, in which jumps occur at other times, and look for knocks in the accelerometer data"
    parameters = (
        Parameter("n", "jumps a run", (1.0, 5.0), "rare: parts that jump more often are faulty", 1.0),
        Parameter("size_dps", "dps", (0.01, 0.2), "consumer MEMS gyroscopes' random telegraph steps", 0.05),
        Parameter("first", "fraction of the run", (0.2, 0.8), "time of the first jump, which can be any"),
        Parameter("outliers", "fraction of the samples", (1e-5, 1e-3), "single readings off by size_dps on a bad bus", 0.0),
    )
    linear, chosen = ("size_dps",), ("n",)
    fault = Outliers()
    shown_against = "time"

    def told(self, values: Mapping[str, float], shown: Mapping[str, str]) -> str:
        if "n" not in values or "size_dps" not in values:  # nothing was found
            return ""
        size = shown["size_dps"].removeprefix("-")
        if self.fault_of(values):
            return f"{shown['outliers']} are single readings that are off, by {size} (root mean square)"
        count = "1 jump" if values["n"] == 1 else f"{values['n']:.3g} jumps"
        return f"{count} a run, each up or down by {size} (root mean square)"

    def draw(self, values: Mapping[str, float], rng: np.random.Generator) -> Values:
        drawn = super().draw(values, rng)
        return {**drawn, "size_dps": drawn["size_dps"] * float(rng.choice((-1.0, 1.0)))}

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        found = [len(jumps(r, axis)) for r in runs if not r.rate_is_mean]
        return [{"n": float(np.mean(found)) if found else 0.0, "size_dps": 0.0}]

    def tried_on(self, runs: Sequence[Run], axis: int, line_chance: float) -> Tried:
        """Not tried if the jumps are in proportion to the rate or at the same times in several runs: a bias does neither."""
        return None if follow_the_rate(runs, axis) or repeat_in_runs(runs, axis) else "blocks"

    def looks(self, runs: Sequence[Run], axis: int) -> Looks:
        """The times from which those of the jumps were chosen."""
        steady = [r for r in runs if not r.rate_is_mean]
        moments = sum(round(r.duration_s / _window_s(r)) for r in steady)
        found = sum(len(jumps(r, axis)) for r in runs)
        return Looks(max(1, moments) ** min(20, found), found)

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        """One step function for each jump in this run, shape [n, MOST]; unused columns are zero."""
        out = np.zeros((len(run), MOST))
        for k, row in enumerate(jumps(run, axis)):
            out[row:, k] = 1.0
        return out

    @property
    def coding(self) -> Coding:
        return _UpOrDown(self.linear)

    def term(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        """Alternating jumps, shape [n], deg/s, evenly spaced from the first jump to the end of the run."""
        n = round(values["n"])
        at_s = run.duration_s * np.linspace(values["first"], 1.0, n, endpoint=False)
        jumps_so_far = np.searchsorted(at_s, elapsed_s(run), side="right")
        return values["size_dps"] * (jumps_so_far % 2).astype(np.float64)
