"""Steps of the reading that are coarser than the session states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Parameter
from gyrocal.effects.reading_fault import Detected, ReadingFault
from gyrocal.noise.sample import white_sd_dps
from gyrocal.recording.once import once
from gyrocal.recording.session import Array, Run

LEAST_RATIO = 1.5
"""Step over count from which on readings are coarse. Counts that were logged with barely enough digits lie below."""
OFF = 0.02
"""Part of a step by which a reading may be off a whole multiple of it."""
WRITTEN_DPS = 1e-5
"""Half a digit of a log, deg/s, by which a multiple of a step may be off, too."""
NEAR, MOST_VALUES = 0.03, 500
"""Part of the mean gap by which a step may differ from it, and the number of values that are compared with each step."""
HALF_COUNT, LEAST_AGAIN = 0.6, 3.0
"""Counts by which a multiple that was rounded to counts again may be off, and the least counts of such a step."""
WHOLE = 0.01
"""Part of a number of counts by which it may deviate from a whole number."""
LEAST_LEVELS, HIDES = 8, 0.5
"""Fewest values that show a grid without a stated count, and the noise in steps (with rounding) up to which a step hides it."""
SHOWN = 1e-4
"""Probability that readings on a finer grid differ by multiples of the step by chance, above which no grid is told."""


@once
def coarse_step_dps(runs: Sequence[Run], axis: int) -> float:
    """The step of the grid of all readings of an axis, deg/s; 0 if it is not coarser than the count that the session states.

    The step need be no multiple of the count: a log with one decimal has steps of 0.1 deg/s. The largest and the smallest
    reading may be off the grid, as clipped ones are.
    """
    stated = [r.lsb_dps for r in runs if r.lsb_dps is not None]
    if not runs or len(stated) < len(runs):
        return 0.0
    values = np.unique(np.concatenate([r.gyro_dps[:, axis] for r in runs]))
    values = values[1:-1] if values.size > 4 else values
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-6]
    if not gaps.size:
        return 0.0
    step_dps = float(gaps[gaps < 1.5 * gaps.min()].mean())
    if step_dps < LEAST_RATIO * min(stated):
        return 0.0
    multiples = np.rint(values / _in_phase(values, step_dps))
    step_dps = float(multiples @ values) / (float(multiples @ multiples) or 1.0)
    allowed_dps = max(OFF * step_dps, WRITTEN_DPS, HALF_COUNT * min(stated) if step_dps > LEAST_AGAIN * min(stated) else 0.0)
    changes = sum(int(np.count_nonzero(np.diff(r.gyro_dps[:, axis]))) for r in runs)
    by_chance = (max(min(stated), 2 * allowed_dps) / step_dps) ** min(max(changes, gaps.size), 300)
    off_dps = float(np.abs(values - multiples * step_dps).max())
    return round(step_dps, 9) if by_chance < SHOWN and off_dps < allowed_dps else 0.0


def _in_phase(values: Array, step_dps: float) -> float:
    """The step near ``step_dps`` of which values [n] are multiples: their gaps may be off by what was rounded again."""
    some = values[:: max(1, values.size // MOST_VALUES)]
    tried = step_dps * np.linspace(1 - NEAR, 1 + NEAR, 2 * int(np.ceil(4 * NEAR * float(np.abs(values).max()) / step_dps)) + 1)
    return float(tried[np.argmax([float(np.cos(2 * np.pi / s * some).mean()) for s in tried])])


@once
def bare_step_dps(runs: Sequence[Run], axis: int) -> float:
    """The step of an axis's readings, deg/s, where no run states its count and the step hides the noise; else 0.

    Any sensor's readings are whole counts. Only if the noise is below half a count does averaging not remove the rounding.
    """
    if not runs or any(r.lsb_dps is not None for r in runs):
        return 0.0
    values = np.unique(np.concatenate([r.gyro_dps[:, axis] for r in runs]))
    step_dps = max((float(r.step_dps[axis]) for r in runs), default=0.0)
    if values.size < LEAST_LEVELS or step_dps <= 0 or white_sd_dps(runs, axis) > HIDES * step_dps:
        return 0.0
    off_dps = float(np.abs(values - np.rint(values / step_dps) * step_dps).max())
    return round(step_dps, 9) if off_dps < max(OFF * step_dps, WRITTEN_DPS) else 0.0


def is_whole(counts: float) -> bool:
    """True if a step of so many counts is a whole number of them, so that its readings have codes of their own."""
    return abs(counts - round(counts)) <= WHOLE * counts


class Quantization(ReadingFault):
    id = "quantization"
    title = "Coarse steps"
    cause = (
        "The readings lie on a grid that is coarser than one count. The chip is set to a larger range than "
        "expected, low bits are lost in a conversion or a shift, or the log was written with too few digits. "
        "If the noise is smaller than a step, averaging does not reduce the error."
    )
    equation = "lsb_dps·round(y/lsb_dps) - y"
    looks_like = (
        "white noise of lsb_dps/√12, if the noise is larger than a step; a stuck bit, which omits steps"
    )
    measure_next = (
        "a histogram of the readings at rest; read the range register back and compare its count with the grid"
    )
    parameters = (
        Parameter(
            "lsb_dps",
            "dps",
            (0.004375, 0.07),
            "LSM6DSO datasheet, table 2: 4.375-70 mdps a count at 125-2000 dps",
            0.07,
        ),
    )

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        if all(r.lsb_dps is not None for r in runs) or bare_step_dps(runs, axis) > 0:
            return None
        return "lsb_dps in session.toml, the size of one count"

    def detect(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """The grid on which all readings of the axis lie, if it is coarser than the stated count, or than the noise."""
        step_dps = coarse_step_dps(runs, axis) or bare_step_dps(runs, axis)
        return Detected({"lsb_dps": step_dps}, {}, 1e-300) if step_dps > 0 else None

    def respond(self, run: Run, axis: int, modelled_dps: Array, values: Mapping[str, float], white_sd_dps: float) -> Array:
        """The mean of a noisy rate after rounding, shape [n], deg/s. Noise above half a step hides the grid (dither)."""
        step = values["lsb_dps"]
        own_sd = np.sqrt(max(white_sd_dps**2 - step**2 / 12, (0.05 * step) ** 2))
        turn = 2 * np.pi * modelled_dps / step
        out = modelled_dps.copy()
        for k in range(1, 9):
            weight = step / (np.pi * k) * np.exp(-2 * (np.pi * k * own_sd / step) ** 2)
            out += (-1) ** k * weight * np.sin(k * turn)
        return out

    def step_dps(self, values: Mapping[str, float]) -> float:
        return values.get("lsb_dps", 0.0)

    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """The readings [n, 3] with this fault, deg/s."""
        return np.round(y_dps / values["lsb_dps"]) * values["lsb_dps"]
