"""A dead band: small rates read as zero."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Case, Effect, Looks, Mask, Objection, Parameter, Refinement, Tried, Values, stack
from gyrocal.effects.quantities import rate_about
from gyrocal.noise.sample import white_sd_dps
from gyrocal.parameter import POSITIVE
from gyrocal.recording.once import once
from gyrocal.recording.outliers import Index, in_readings, outliers
from gyrocal.recording.session import Array, Run

WIDTHS_DPS = tuple(float(w) for w in np.geomspace(0.03, 10.0, 12))
LEAST_DEPTH = 0.5
"""Part of the small rates that a dead band takes away at least. Filters round its edges, and the fit's depth is below 1."""
MOST_DEPTH = 1.5
"""The same at most: a band that takes away more than the rate would reverse it. A fit's depth is above 1 by its error alone."""
FIRST_SIGHT = 5.0
"""Standard errors that the lost part of small rates must have before a fit is tried."""

LEAST_LOST = LEAST_DEPTH / 3
"""Part of the rates just below a tried width that is lost at least. Widths go in steps of 1.7, energy as width³."""
BEYOND = 1 / 8
"""Part of it that rates between a width and twice that may lose. The own error of a smoothed reference falls by less from one
to the other: by a factor of 2 to 5 in what was measured."""


class DeadBand(Effect):
    id = "dead_band"
    title = "Dead band"
    cause = (
        "A driver or the chip's own drift compensation sets small rates to zero, or friction and rounding in a loop hold the "
        "output until the rate exceeds a threshold. Slow turning is lost completely, and integrated angles stop. Faster "
        "rates are read correctly."
    )
    equation = "-depth·w where abs(w) < width_dps, else 0"
    looks_like = (
        "bias_jumps, if only the steps at the edges of the band are seen; scale_nonlinearity, which acts on large rates; "
        "quantization, whose steps are everywhere and not only about zero"
    )
    measure_next = "turn the table very slowly through zero, and record its encoder as rate_ref_dps; or steps of 0.1 dps"
    parameters = (
        Parameter(
            "width_dps", "dps", (0.05, 2.0), "drivers and fusion libraries set rates below 0.1-1 dps to zero", 1.0, POSITIVE,
            search=(0.02, 20.0), sized=False,
        ),
        Parameter("depth", "fraction", (0.5, 1.0), "1: small rates read as zero", 1.0),
    )  # fmt: skip
    linear = ("depth",)
    nonlinear = ("width_dps",)
    fast = True
    cases = (Case({"width_dps": 2.0}, ("width_dps",), "swing"),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        rates = (np.abs(r.rate_dps) for r in runs if r.axis_index == axis and not r.rate_is_mean)
        if any(np.any((w > 0) & (w < WIDTHS_DPS[-1])) for w in rates):
            return None
        return "a run about this axis with true rates below 10 dps (swing the table slowly through zero)"

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        """The widths at which the lost part of the rate is largest in standard errors."""
        scores = _scores(runs, axis)
        best = int(np.argmax(scores))
        return [{"width_dps": WIDTHS_DPS[k], "depth": 0.0} for k in range(max(0, best - 1), min(len(WIDTHS_DPS), best + 2))]

    def looks(self, runs: Sequence[Run], axis: int) -> Looks:
        return Looks(len(WIDTHS_DPS))

    def tried_on(self, runs: Sequence[Run], axis: int, line_chance: float) -> Tried:
        return "samples" if float(_scores(runs, axis).max()) > FIRST_SIGHT else None

    def objections(
        self, values: Values, runs: Sequence[Run], axis: int, known: Sequence[tuple[Effect, Values]]
    ) -> Iterable[Objection]:
        """Rounding makes a band narrower than the step of the readings.

        Where small rates are not lost for the most part, or are reversed, the error in this range is another effect's. There is
        no edge where rates are lost above it by more than its width: noise of the reference is a rate that is not read.
        """
        if values["width_dps"] <= min((float(r.step_dps.max()) for r in runs), default=0.0):
            yield Objection.UNSEEN
        takes_most = LEAST_DEPTH <= values["depth"] <= MOST_DEPTH
        if not takes_most or (runs and _beyond_the_edge_dps(runs, axis, values["width_dps"]) > values["width_dps"]):
            yield Objection.CONTRADICTED

    def refinement(self, name: str, values: Mapping[str, float], runs: Sequence[Run], axis: int) -> Refinement:
        """The edge of the band lies anywhere between the nearest rates below and above it: their distance over sqrt(12).

        A measured rate is known there as well as smoothing agrees with the reference where the rate passes the edge, which it
        does not at the corners of a motion, and as well as samples on the other side of the edge are clearly read or lost.
        """
        width = values["width_dps"]
        rates = np.concatenate([np.abs(rate_about(r, axis)) for r in runs if not r.rate_is_mean])
        below, above = rates[rates < width].max(initial=0.0), rates[rates >= width].min(initial=np.inf)
        between = float((above - below) / np.sqrt(12)) if np.isfinite(above) else 0.0
        known = np.linalg.norm([between, _beyond_the_edge_dps(runs, axis, width), _smoothed_dps(runs, axis, width)])
        return Refinement(0.1, float(known))

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        w_dps = rate_about(run, axis)
        return stack(np.where(np.abs(w_dps) < values["width_dps"], -w_dps, 0.0))


def _beyond_the_edge_dps(runs: Sequence[Run], axis: int, width_dps: float) -> float:
    """Largest distance from a width of true rates that are read although they are below it, or lost although above, deg/s."""
    clear_dps = 2 * FIRST_SIGHT * white_sd_dps(runs, axis)
    largest = 0.0
    for run in (r for r in runs if r.axis_index == axis and not r.rate_is_mean):
        reached = run.reached
        w_dps, y_dps = rate_about(run, axis)[reached], run.gyro_dps[reached, axis]
        inside = np.abs(w_dps) < width_dps
        if not inside.any() or np.count_nonzero(~inside) < 2:
            continue
        slope, offset = np.polyfit(w_dps[~inside], y_dps[~inside], 1)
        lost = np.abs(y_dps - offset) < np.abs(y_dps - offset - slope * w_dps)
        other = (lost != inside) & (np.abs(slope * w_dps) > clear_dps)
        largest = max(largest, float(np.max(np.abs(np.abs(w_dps[other]) - width_dps), initial=0.0)))
    return largest


def _smoothed_dps(runs: Sequence[Run], axis: int, width_dps: float) -> float:
    """The most that smoothing takes from measured rates within two samples of an edge (rms over passages), deg/s.

    It is 0 without a measured rate.
    """
    taken = [np.empty(0)]
    for run in (r for r in runs if r.axis_index == axis and r.smooth_rate is not None):
        w_dps = rate_about(run, axis)
        passes = np.flatnonzero(np.diff(np.abs(w_dps) < width_dps))
        around = np.clip(passes[:, None] + np.arange(-1, 3), 0, len(run) - 1)
        taken.append(np.max(np.abs(run.rate_dps - w_dps)[around], axis=1, initial=0.0))
    squares = np.concatenate(taken) ** 2
    return float(np.sqrt(squares.mean())) if squares.size else 0.0


def outliers_of(run: Run, axis: int, y_dps: Array) -> tuple[Index, Array]:
    """Rows [k] of one run's outliers and their deviations [k], deg/s, without the readings that a dead band set to zero.

    What stands out of the reference alone is none, and where the reference was not recorded there is none. ``y_dps`` [n] is
    measured minus true or modelled rate about the axis.
    """
    known = np.flatnonzero(run.reached)
    rows, apart_dps = outliers(y_dps[known], run.step_dps[axis])
    rows = known[rows]
    if rows.size and not in_readings(run.gyro_dps[:, axis], rows, apart_dps):
        return rows[:0], apart_dps[:0]
    if not rows.size or axis != run.axis_index or run.rate_is_mean:
        return rows, apart_dps
    scores = _scores([run], axis)
    best = int(np.argmax(scores))
    if scores[best] < FIRST_SIGHT:
        return rows, apart_dps
    other = np.abs(run.rate_dps[rows]) > WIDTHS_DPS[min(best + 1, len(WIDTHS_DPS) - 1)]
    return rows[other], apart_dps[other]


@once
def _scores(runs: Sequence[Run], axis: int) -> Array:
    """The lost part of the rates below each width divided by its standard error, shape [widths]; 0 where no edge is seen.

    Offset and scale of each run are taken from its larger rates, or from all of them if there are no larger ones. Noise of the
    true rate is in no reading and looks like a rate that is lost. Its fast part is taken off by its power. A slow wander of
    the reference at rest is lost at all rates that it reaches, and a dead band has an edge: rates of half the width and more,
    or of a steady turn, are lost, and rates of up to twice the width are read.
    """
    lost, norm = np.zeros((3, len(WIDTHS_DPS))), np.zeros((3, len(WIDTHS_DPS)))
    for run in runs:
        if run.rate_is_mean or run.axis_index != axis or not np.any(run.rate_dps):
            continue
        w_dps, y_dps = rate_about(run, axis), run.gyro_dps[:, axis]
        known = np.column_stack([np.ones(len(run)), w_dps])
        for k, width in enumerate(WIDTHS_DPS):
            inside = np.abs(w_dps) < width
            if not inside.any() or inside.all():
                continue
            fit = np.linalg.lstsq(known[~inside], y_dps[~inside], rcond=None)[0]
            beyond = ~inside & (np.abs(w_dps) < 2 * width)
            inside &= _no_corner(run, w_dps, 2 * width)
            below = inside & ((np.abs(w_dps) >= width / 2) | _steady(w_dps, inside))
            for part, among in enumerate((inside, below, beyond)):
                residual = y_dps[among] - known[among] @ fit
                lost[part, k] -= float(w_dps[among] @ residual) + np.count_nonzero(among) * _noise_power(w_dps, among)
                norm[part, k] += float(w_dps[among] @ w_dps[among])
    norm = np.maximum(norm, 1e-300)
    (inner, below, beyond), error = lost / norm, white_sd_dps(runs, axis) / np.sqrt(norm)
    edge = (below >= LEAST_LOST) & (beyond + 2 * error[2] < BEYOND * below)
    return np.asarray(np.where(edge, inner / error[0], 0.0))


def _no_corner(run: Run, w_dps: Array, least_dps: float) -> Mask:
    """True for the samples [n] whose true rate is no slope over a corner, at which the table begins or ends to turn faster.

    The smooth curve through measured angles is round there, so that its slope is a small rate that the table never had.
    """
    from scipy.ndimage import maximum_filter1d

    if run.measured_rates is None or not run.measured_rates.derived:
        return np.ones(len(run), dtype=bool)
    return np.asarray(maximum_filter1d(np.abs(w_dps), 2 * run.measured_rates.reach + 1, mode="nearest") < least_dps)


def _steady(w_dps: Array, inside: Mask) -> Mask:
    """True for the samples [n] of stretches inside a band in which the mean of the true rate is three times its scatter."""
    starts = np.flatnonzero(np.r_[True, inside[1:] != inside[:-1]])
    counts = np.diff(np.r_[starts, inside.size])
    means, squares = (np.add.reduceat(values, starts) / counts for values in (w_dps, w_dps**2))
    return np.asarray(np.repeat(means**2 > 9 * (squares - means**2), counts) & inside)


def _noise_power(w_dps: Array, inside: Mask) -> float:
    """The mean square of the noise of true rates [n] inside a band, by second differences, which slow turning hardly has."""
    bends = np.diff(w_dps, 2)[inside[:-2] & inside[1:-1] & inside[2:]]
    return float(np.mean(bends**2)) / 6 if bends.size else 0.0
