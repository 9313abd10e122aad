"""Rectification of vibration: a rate that grows with the square of the acceleration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import AtSample, Case, Effect, Law, Parameter, Values
from gyrocal.effects.optional import OwnLine
from gyrocal.effects.quantities import acceleration_g, squares_of_tenths
from gyrocal.recording.once import once_a_run
from gyrocal.recording.session import Array, Run

TOTAL = "k_dps_per_g2"
ALONG = {"kx_dps_per_g2": 0, "ky_dps_per_g2": 1, "kz_dps_per_g2": 2}
ALL = 3
"""The first argument of the C twin if the acceleration of all three axes counts."""
LOST, FAST = "lost_dps_per_g2", 4
SLOW_S = 1.0
"""Time over which the squared acceleration is averaged for the part of it that every low-pass passes, s."""
LEAST_CHANGE_G2 = 0.05
LINE, LINE_HZ = 100.0, 0.2
"""Power of a line over the median of the spectrum, and the distance in Hz within which two lines are one."""


class G2Sensitivity(Effect, OwnLine):
    id = "g2_sensitivity"
    title = "Rectified vibration"
    cause = (
        "The suspension of the vibrating mass and its electrodes respond to acceleration with a curve instead of a line. "
        "Vibration averages out in a linear response, but its square does not, so the bias is different while a motor or a "
        "shaker runs. Gravity alone adds a constant in each pose."
    )
    equation = (
        "k_dps_per_g2·(ax^2 + ay^2 + az^2), or kx_dps_per_g2·ax^2 + ky_dps_per_g2·ay^2 + kz_dps_per_g2·az^2; "
        "a low-pass takes lost_dps_per_g2·(a^2 - its mean over 1 s) away"
    )
    looks_like = (
        "centripetal, where the table's rate makes the acceleration; bias_jumps, if a motor is switched on within a run; "
        "g_sensitivity, if the part is only turned over between poses"
    )
    measure_next = (
        "the part at rest on a shaker or beside a running motor at two levels and switched off, with the accelerometer at the "
        "gyroscope's rate; the error is four times as large at twice the level"
    )
    parameters = tuple(
        Parameter(
            name, "dps/g^2", (1e-4, 0.01),
            "ADXRS646 datasheet: vibration rectification of 1e-4 dps/g^2; consumer parts up to 100 times as much", default,
        )
        for name, default in ((TOTAL, 0.01), *((name, 0.0) for name in (*ALONG, LOST)))
    )  # fmt: skip
    linear = (TOTAL, *ALONG, LOST)
    on_device, device_columns = True, {TOTAL: ALL, **ALONG}  # what a low-pass takes away needs the samples of a second
    origin_free = True  # gravity alone is a constant
    law = Law({TOTAL: 0.01, "kx_dps_per_g2": 0.002}, "0.01*(ax**2 + ay**2 + az**2) + 0.002*ax**2")
    cases = (Case({TOTAL: 0.01}, (TOTAL,), "shaker"),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        measured = bool(runs) and all(r.acc_g is not None for r in runs)
        if measured and self._moving(runs):
            return None
        return "ax_g, ay_g and az_g columns in every run, and vibration at two levels or poses on different axes"

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        """The square of the whole acceleration, or of the components that change.

        The low-pass of the readings, which the accelerometer lacks, may take away the fast part of the square, which is a line
        at twice the frequency of a vibration. The slow part then determines the coefficient.
        """
        along = [name for name in self._moving(runs) if name in ALONG]
        chosen = [(TOTAL,), *((name,) for name in along), *([tuple(along)] if len(along) > 1 else [])]
        if any(np.std(_fast_g2(run)) >= LEAST_CHANGE_G2 for run in runs):
            chosen.append((TOTAL, LOST))
        return [dict.fromkeys(names, 0.0) for names in chosen]

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        acc_g = acceleration_g(run)
        if acc_g is None:
            return np.zeros((len(run), len(self.coding.used(values))))
        squares = np.column_stack([acc_g**2, (acc_g**2).sum(axis=1), -_fast_g2(run)])
        return np.asarray(squares[:, [{**ALONG, LOST: FAST}.get(name, ALL) for name in self.coding.used(values)]])

    def at_sample(self, values: Mapping[str, float]) -> AtSample | None:
        if not self.runs_on_device(values):
            return None
        x, y, z = (values.get(TOTAL, 0.0) + values.get(name, 0.0) for name in ALONG)
        return lambda rate_dps, temp_c, power_on_s, acc_g: x * acc_g[0] ** 2 + y * acc_g[1] ** 2 + z * acc_g[2] ** 2

    def line_dps(self, runs: Sequence[Run], axis: int, values: Values, low_hz: float, high_hz: float) -> float:
        """That of the whole squared acceleration. The gyroscope's low-pass weakens and delays it, not the rectified part."""
        whole = {name: value for name, value in values.items() if name != LOST}
        ratios, squares = [], []
        for run in runs:
            window = np.hanning(len(run))
            term = self.term(run, axis, whole)
            power = np.abs(np.fft.rfft((term - term.mean()) * window)) ** 2
            frequency_hz = np.fft.rfftfreq(len(run), 1 / run.sample_rate_hz)
            near = (frequency_hz > low_hz - LINE_HZ) & (frequency_hz < high_hz + LINE_HZ)
            ratios.append(float(power[near].max(initial=0.0)) / max(float(np.median(power)), 1e-300))
            squares.append(4 * float(power[near].sum()) / (len(run) * float(window @ window)))
        return float(np.sqrt(np.mean(squares))) if max(ratios, default=0.0) > LINE else 0.0

    def _moving(self, runs: Sequence[Run]) -> list[str]:
        """The names whose mean square over a tenth of a run changes between or within runs."""
        means = [tenths for r in runs if (tenths := squares_of_tenths(r)) is not None]
        squares_g2 = np.vstack(means) if means else np.zeros((1, 3))
        moved_g2 = np.ptp(np.column_stack([squares_g2, squares_g2.sum(axis=1)]), axis=0)
        return [name for name, i in {TOTAL: ALL, **ALONG}.items() if moved_g2[i] >= LEAST_CHANGE_G2]


@once_a_run
def _fast_g2(run: Run) -> Array:
    """The squared acceleration less its mean over ``SLOW_S``, shape [n], g^2; at the ends of a run that over what is there."""
    acc_g = acceleration_g(run)
    if acc_g is None:
        return np.zeros(len(run))
    square_g2 = (acc_g**2).sum(axis=1)
    rows, half = np.arange(len(run)), round(SLOW_S * run.sample_rate_hz / 2)
    first, end = np.maximum(rows - half, 0), np.minimum(rows + half + 1, len(run))
    sums = np.concatenate([[0.0], np.cumsum(square_g2)])
    return np.asarray(square_g2 - (sums[end] - sums[first]) / (end - first))
