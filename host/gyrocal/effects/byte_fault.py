"""The code of a reading is put together wrongly: a carry is lost between two parts of it, or a part is of another sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gyrocal import tails
from gyrocal.effects.base import Effect, Looks, Mask, Parameter, Tried, Values, stack
from gyrocal.effects.quantities import rate_about
from gyrocal.effects.reading_fault import Detected, Fault
from gyrocal.effects.single_bits import BITS, apart_of, codes_of, count_dps_of, noise_of, single_power
from gyrocal.recording.once import once
from gyrocal.recording.session import Array, Run
from gyrocal.recording.torn import Torn, expected_shift, torn

HALF = 0.5
"""Part of the low bits' range that is not negative where they are taken for a signed number."""
BELOW = tuple(k / 8 for k in range(1, 8))
"""Parts of the range of the low bits that were tried as those after a lost carry."""
STANDS_OUT = 8.0
"""Standard deviations of the noise that a step must exceed. Below, noise itself correlates with the bits of a reading."""
MARGIN = 0.3
"""Fraction of the carry's size by which a reading may be off it."""
MOSTLY = 0.8
"""Fraction of the readings that stand off which must do so by the size of the carry."""
NEAR = 0.05
"""Fraction by which a fitted step may deviate from a power of two of counts."""
SMOOTHER = 0.8
"""Part of the crossings that must become smoother when the step is taken away."""
LEAST_CROSSINGS, LEAST_RUNS = 20, 3
MOST_SAMPLES = 40_000
LEAST_GAIN = 25.0
"""Gain in log-likelihood over other borders from which on hidden readings are torn. A density that is not quite that of the
noise gains up to 15 at one border and not at the others (480 axes without a fault)."""


class TornReadings(Fault):
    """Single readings that are off by a power of two of counts, and what the simulator plants."""

    def describes(self, values: Mapping[str, float]) -> bool:
        """A lost carry that was fitted has columns and a step for each reading. All else is a fault of single readings."""
        return "below" not in values

    def detect(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """Detect outliers that all deviate by the value of one bit. By chance, one in ten has such a size.

        Where noise hides single readings, their likelihood shows that some are torn.
        """
        found = single_power(runs, axis)
        if found is None:
            return _hidden(runs, axis)
        bit, number = found
        carry = lost_carry(runs, axis)
        if carry is not None and number < 0.5 * _carries(runs, axis, carry):
            return None  # whole stretches lack the carry, which the step describes
        values = {"bit": float(bit), "step_dps": 2.0**bit * count_dps_of(runs, axis), "fraction": number / sum(map(len, runs))}
        return Detected(values, {}, 10.0 ** -min(number, 100))

    def respond(self, run: Run, axis: int, modelled_dps: Array, values: Mapping[str, float], white_sd_dps: float) -> Array:
        rows, apart_dps = apart_of(run, axis)
        out = modelled_dps.copy()
        if values["step_dps"] < STANDS_OUT * white_sd_dps:
            count_dps = 2.0 ** -values["bit"] * values["step_dps"]
            codes, rest = codes_of(run, axis, count_dps), (run.gyro_dps[:, axis] - modelled_dps) / count_dps
            return out + count_dps * expected_shift(codes, rest, round(values["bit"]), values["fraction"])
        out[rows] += apart_dps
        return out

    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """Readings [n, 3] in which a fraction of the carries into ``bit`` is lost on all axes, deg/s."""
        count_dps = run.lsb_dps or 2.0 ** -values["bit"] * abs(values["step_dps"])
        on = carried(y_dps, count_dps, round(values["bit"]), values.get("below", 0.5))
        return y_dps + values["step_dps"] * (on & (rng.random(y_dps.shape) < values["fraction"]))

    def throws_out(self, values: Mapping[str, float]) -> bool:
        return True


class ByteFault(Effect):
    id = "byte_fault"
    title = "Wrongly assembled codes"
    cause = (
        "The driver builds a code from two bytes, or adds a correction to it, and loses the carry from the low to the high "
        "part. The reading is then too small by a power of two of counts whenever the low bits have just passed zero. If the "
        "bytes are read at different times, single readings at such a border have one byte of another sample. On a disturbed "
        "bus, single readings have one wrong bit."
    )
    equation = "step_dps in a fraction of the readings whose bits below `bit` have just carried, step_dps = -2^bit·lsb_dps"
    looks_like = (
        "misalignment or scale_nonlinearity, if there are only a few constant rates; bias_jumps, where single readings stand "
        "out; a stuck bit"
    )
    measure_next = (
        "turn the table slowly through the border, and plot the residual against the code modulo 2^bit; read both bytes in one "
        "burst and compare"
    )
    parameters = (
        Parameter("bit", "bit number", (4.0, 12.0), "8 if bytes are joined wrongly; any if words are shifted or added", 7.0),
        Parameter("step_dps", "dps", (0.1, 40.0), "2^bit counts of 4.375-70 mdps", -1.12, sized=False),
        Parameter("fraction", "fraction", (0.001, 1.0), "1 if each carry is lost, less if it depends on the time", 1.0),
        Parameter("below", "fraction", (0.125, 0.875), "part of the low bits' range that follows a carry", 0.5),
    )
    linear, chosen = ("step_dps",), ("bit", "below", "fraction")
    fault = TornReadings()
    acts_on = "all"

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if np.isfinite(count_dps_of(runs, axis)) else "readings on a grid of counts, or lsb_dps in session.toml"

    def draw(self, values: Mapping[str, float], rng: np.random.Generator) -> Values:
        """What is planted is a fault of the readings. ``below`` belongs to it only where it is given."""
        drawn = super().draw(values, rng)
        return drawn if "below" in values else {name: v for name, v in drawn.items() if name != "below"}

    def tried_on(self, runs: Sequence[Run], axis: int, line_chance: float) -> Tried:
        return None if lost_carry(runs, axis) is None else "blocks"

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        carry = lost_carry(runs, axis) or Carry(7, 0.5, 1.0, 0.0)
        return [{"bit": float(carry.bit), "below": carry.below, "fraction": carry.fraction, "step_dps": 0.0}]

    def looks(self, runs: Sequence[Run], axis: int) -> Looks:
        return Looks(len(BITS) * len(BELOW))

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        count_dps = count_dps_of([run], axis)
        if "below" not in values or not np.isfinite(count_dps):
            return np.zeros((len(run), 1))
        on = carried(run.gyro_dps[:, axis], count_dps, round(values["bit"]), values["below"])
        return stack(np.where(on, values["fraction"], 0.0))


@dataclass(frozen=True)
class Carry:
    """A lost carry: the bit that lacks it, the part of the low bits' range after it, how often, and the step's t value.

    ``signed`` is True if the low part was added as a signed number: the upper half of its range then lacks the carry.
    """

    bit: int
    below: float
    fraction: float
    t: float
    signed: bool = False

    def words(self, count_dps: float) -> str:
        """The fault in words, with the step of the reading in deg/s, from one count."""
        step_dps = 2.0**self.bit * count_dps
        if self.signed:
            return f"the bits below bit {self.bit} of the reading are added as a signed number, a step of {step_dps:+.3g} dps"
        return f"a carry into bit {self.bit} of the reading is lost, a step of {-step_dps:+.3g} dps"


def carried(y_dps: Array, count_dps: float, bit: int, below: float) -> Mask:
    """Mask [n] of the readings whose bits under ``bit`` are in the part ``below`` of their range, so that they have carried."""
    low = np.rint(y_dps / count_dps).astype(np.int64) & (2**bit - 1)
    mask: Mask = low < below * 2**bit
    return mask


@once
def lost_carry(runs: Sequence[Run], axis: int) -> Carry | None:
    """The lost carry that the residual shows, regressed on each bit's carry beside the true rates; None if there is none.

    The bias of each power cycle is its own: where a cycle has one code, its bias is no carry.
    """
    if not runs:
        return None
    count_dps, noise_dps = count_dps_of(runs, axis), noise_of(runs, axis)
    steady = [r for r in runs if not r.rate_is_mean]
    if not steady or not np.isfinite(count_dps):
        return None
    thin = max(1, sum(map(len, steady)) // MOST_SAMPLES)
    y_dps = np.concatenate([r.gyro_dps[::thin, axis] for r in steady])
    rates = [np.concatenate([r.rate_dps[::thin] * (r.axis_index == other) for r in steady]) for other in range(3)]
    of_runs = np.unique([r.scenario for r in steady], return_inverse=True)[1]
    cycle = np.repeat(of_runs, [-(-len(r) // thin) for r in steady])
    count = np.bincount(cycle)

    def beside(column: Array) -> Array:
        """A column [n] less its mean over each power cycle."""
        return np.asarray(column - (np.bincount(cycle, column) / count)[cycle])

    known = [beside(w) for w in rates if np.any(w)]
    basis = np.linalg.qr(np.column_stack(known))[0] if known else np.zeros((y_dps.size, 0))

    def left_of(column: Array) -> Array:
        own = beside(column)
        return np.asarray(own - basis @ (basis.T @ own))

    rest_dps = left_of(y_dps)
    best: Carry | None = None
    for bit in (b for b in BITS if 2.0**b * count_dps > STANDS_OUT * noise_dps):
        for below in BELOW:
            on = carried(y_dps, count_dps, bit, below).astype(float)
            column = left_of(on)
            norm = float(column @ column)
            if norm < 1e-3 * y_dps.size:
                continue
            step_dps = float(column @ rest_dps) / norm
            left = float(np.mean((rest_dps - step_dps * column) ** 2))
            t = abs(step_dps) / np.sqrt(left / norm)
            full_dps = -(2.0**bit) * count_dps
            signed = step_dps > 0 and below == HALF
            part = abs(step_dps / full_dps) if signed else step_dps / full_dps
            if not STANDS_OUT * noise_dps / abs(full_dps) < part < 1 + NEAR or (signed and part < 1 - NEAR):
                continue
            if part < 1 - NEAR and not _one_step(rest_dps, on > 0, full_dps):
                continue
            carry = Carry(bit, below, part if part < 1 - NEAR else 1.0, t, signed)
            if (best is None or t > best.t) and _confirmed(steady, axis, count_dps, carry):
                best = carry
    return best


def _one_step(rest_dps: Array, on: Mask, step_dps: float) -> bool:
    """True if readings that stand off where the carry is due do so by its size, and not by any size as in a burst."""
    off_dps = rest_dps[on] - float(np.median(rest_dps[~on]))
    away = np.abs(off_dps) > MARGIN * abs(step_dps)
    return bool(away.any()) and float(np.mean(np.abs(off_dps[away] - step_dps) < MARGIN * abs(step_dps))) > MOSTLY


def _carries(runs: Sequence[Run], axis: int, carry: Carry) -> float:
    """The number of readings that lack the carry."""
    count_dps = count_dps_of(runs, axis)
    masks = (carried(r.gyro_dps[:, axis], count_dps, carry.bit, carry.below) for r in runs)
    return carry.fraction * sum(int(np.count_nonzero(mask)) for mask in masks)


def _confirmed(runs: Sequence[Run], axis: int, count_dps: float, carry: Carry) -> bool:
    """True if the readings become smoother where the carry comes and goes, or if it does so only between runs.

    A motion that the reference does not know correlates with the bits of the reading too, but it crosses them smoothly.
    """
    lacking_dps = 2.0**carry.bit * count_dps * (-1 if carry.signed else 1)
    smoother, crossings, states = 0, 0, []
    for run in runs:
        y_dps = run.gyro_dps[:, axis]
        on = carried(y_dps, count_dps, carry.bit, carry.below)
        states.append(float(on.mean()))
        rows = np.flatnonzero(on[1:] != on[:-1])
        if rows.size:
            rest_dps = y_dps - rate_about(run, axis)
            moved, mended = np.diff(rest_dps)[rows], np.diff(rest_dps + lacking_dps * on)[rows]
            crossings += rows.size
            smoother += int(np.count_nonzero(np.abs(mended) < np.abs(moved)))
    if crossings >= LEAST_CROSSINGS:
        return smoother > SMOOTHER * carry.fraction * crossings
    between = sum(s > 0.99 for s in states) >= LEAST_RUNS and sum(s < 0.01 for s in states) >= LEAST_RUNS
    return between and carry.fraction == 1.0


@once
def _torn(runs: Sequence[Run], axis: int) -> Torn | None:
    """Readings of steady runs that are torn, each run without its offset and scale; None if there are none."""
    count_dps, steady = count_dps_of(runs, axis), [r for r in runs if not r.rate_is_mean]
    if not steady or not np.isfinite(count_dps):
        return None
    rest = []
    for run in steady:
        known = np.column_stack([np.ones(len(run)), rate_about(run, axis)])
        y = run.gyro_dps[:, axis] / count_dps
        left = y - known @ np.linalg.lstsq(known, y, rcond=None)[0]
        if np.median(np.abs(np.diff(left))) > np.median(np.abs(np.diff(y))):
            return None  # the noise of a coarse encoder is in no reading, and hides what is
        rest.append(left)
    return torn([codes_of(r, axis, count_dps) for r in steady], rest)


def _hidden(runs: Sequence[Run], axis: int) -> Detected | None:
    """Torn readings that do not stand out singly."""
    found = _torn(runs, axis)
    if found is None or found.gain < LEAST_GAIN or lost_carry(runs, axis) is not None:
        return None
    chance = len(BITS) * 0.5 * float(tails.chi_square(2 * found.gain, 1))
    values = {"bit": float(found.bit), "step_dps": 2.0**found.bit * count_dps_of(runs, axis), "fraction": found.share}
    return Detected(values, {}, chance)
