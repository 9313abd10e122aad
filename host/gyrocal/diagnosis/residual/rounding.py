"""Rounding of readings whose noise is less than half a count: an error of the chip's count and not of the model.

The mean of noisy readings after rounding is off by ``sum over k of a_k sin(2 pi k x / count)`` with
``a_k = count / (pi k) exp(-2 (pi k sd / count)^2)`` (Widrow and Kollar, Quantization Noise, 2008, chapter 4). It is the same
for all samples of one level and does not average out.
"""

from __future__ import annotations

import numpy as np

from gyrocal.effects.quantities import DECIMALS
from gyrocal.effects.quantization import coarse_step_dps
from gyrocal.error_model.model import Term
from gyrocal.inference import heldout
from gyrocal.inference.fitted import AxisFit, Fit
from gyrocal.inference.noise_search import carried, fit_noise
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.variables.rate import Rate
from gyrocal.variables.shapes import Columns, Index

LARGEST_NOISE = 0.5
"""Noise in counts above which rounding averages out to less than 0.3 % of a count."""
LEAST = 1e-3
"""Smallest amplitude of a harmonic, in counts, that is not left out."""
HARMONICS = 3
"""Number of harmonics. The third is left out from a noise of 0.16 counts on."""


def amplitudes_dps(count_dps: float, variance: float) -> Array:
    """Amplitudes [k] of the error of rounding to ``count_dps``, for rounded readings of this variance, dps^2; empty if it
    averages out."""
    sd = np.sqrt(max(variance - count_dps**2 / 12, 0.0)) / count_dps
    if sd >= LARGEST_NOISE:
        return np.zeros(0)
    k = np.arange(1, HARMONICS + 1)
    sizes = np.exp(-2 * (np.pi * k * sd) ** 2) / (np.pi * k)
    return np.asarray(count_dps * sizes[sizes >= LEAST])


def rounding_power(fitted: AxisFit) -> float:
    """Mean square of the error that rounding can make of levels anywhere between two counts, dps^2."""
    return float(np.sum(_of_axis(fitted)[1] ** 2)) / 2


def is_of_reference(against: str, amplitude_dps: float, fitted: AxisFit) -> bool:
    """True if what depends on a variable is a function of the rate, and no larger than rounding of the reference makes one."""
    return against == Rate.name and amplitude_dps**2 / 2 <= _reference_power(fitted)


def _reference_power(fitted: AxisFit) -> float:
    """Largest mean square, dps^2, of a function of the rate that rounding of the recorded true rate makes.

    A motion that is repeated meets the same rounding again at the same rates. It averages out over the rates that occur, each
    counted by its samples, and not over the samples. Steps whose rounding is more than all that the model leaves are none: the
    table was set to these rates.
    """
    mine = [b.run.measured_rates for b in fitted.design.blocks if b.run.axis_index == fitted.design.axis]
    recorded = [r.rates_dps[r.known] for r in mine if r is not None and not r.derived and not r.three_axes]
    if not recorded:
        return 0.0
    rates_dps, samples = np.unique(np.concatenate(recorded), return_counts=True)
    digits = 10.0**DECIMALS
    step_dps = float(np.gcd.reduce(np.rint(rates_dps * digits).astype(np.int64))) / digits
    if step_dps**2 / 12 > _left_power(fitted):
        return 0.0
    different = float(samples.sum()) ** 2 / float(samples @ samples)
    return step_dps**2 / 12 * min(1.0, POLICY.rounding_errors**2 / different)


def _left_power(fitted: AxisFit) -> float:
    """Mean square, dps^2, of the samples beside the model."""
    blocks, axis = fitted.design.blocks, fitted.design.axis
    of_means = sum(float(b.n @ fitted.block_residuals(i) ** 2) for i, b in enumerate(blocks))
    return (of_means + sum(float(b.within_ss[axis]) for b in blocks)) / max(1.0, sum(float(b.n.sum()) for b in blocks))


def _of_axis(fitted: AxisFit) -> tuple[float, Array]:
    """The step of an axis's readings, a count or a coarser one, deg/s, and the amplitudes [k] of the error of rounding."""
    runs, axis = [b.run for b in fitted.design.blocks], fitted.design.axis
    count_dps = max((run.count_dps(axis) for run in runs), default=0.0)
    count_dps = max(count_dps, coarse_step_dps(runs, axis))
    return count_dps, amplitudes_dps(count_dps, fitted.noise.white_sd_dps**2) if count_dps > 0 else np.zeros(0)


def beside_rounding(fitted: Fit, axis: str) -> AxisFit:
    """The fit of an axis with the error of rounding beside the model; the fit itself where rounding averages out.

    Amplitudes are free because the noise is known only roughly. The fit is returned as it is where they exceed what rounding
    can do, because the error then has another cause, and where the readings stay too near one level to determine the first.
    """
    current = fitted.axes[axis]
    count_dps, allowed_dps = _of_axis(current)
    if not allowed_dps.size:
        return current
    rounded, shape, again = current, Columns(lambda run: np.zeros((len(run), 0)), 0), True
    while allowed_dps.size:
        shape = _waves(_levels(fitted.on(axis, rounded), axis, shape), count_dps, allowed_dps.size)
        term = Term("rounding", axis, dict.fromkeys(shape.linear, 0.0), own=shape)
        design = current.design.changed([*current.design.terms, term])
        rounded = fit_noise(design, start=carried(current, design))
        known = _determined(rounded, allowed_dps)
        if known == allowed_dps.size and not again:
            return rounded if _plausible(rounded, allowed_dps) else current
        again = known < allowed_dps.size  # the rounding error moves bias and scale, and with them the level
        allowed_dps = allowed_dps[:known]
    return current


def _waves(levels_dps: dict[int, Array], count_dps: float, harmonics: int) -> Columns:
    """Cosines and sines of the level [n] of each run's readings before rounding."""

    def of(run: Run) -> Array:
        if run.index not in levels_dps:
            return np.zeros((len(run), 2 * harmonics))
        turn = 2 * np.pi * levels_dps[run.index][:, None] / count_dps * np.arange(1, harmonics + 1)
        return np.hstack([np.cos(turn), np.sin(turn)])

    return Columns(of, 2 * harmonics)


def _levels(fitted: Fit, axis: str, shape: Columns) -> dict[int, Array]:
    """The modelled reading [n] of each run, deg/s, with what its power cycle adds and without a term of this ``shape``."""
    current = fitted.axes[axis]
    of_run = {b.run.index: i for i, b in enumerate(fitted.blocks)}
    size = np.zeros(len(shape.linear))
    for (i, j), value in zip(current.design.layout.fixed, current.solution.beta, strict=True):
        if current.design.terms[i].own is shape:
            size[j] = value
    return {
        p.run.index: p.modelled_dps + current.of_cycle(of_run[p.run.index]) - shape.columns(p.run, AXES.index(axis), {}) @ size
        for p in heldout.fitted(fitted)
    }


def _determined(rounded: AxisFit, allowed_dps: Array) -> int:
    """How many harmonics, from the first one, have smaller errors than what rounding can do. The others cannot be seen."""
    harmonic, _, errors = _amplitudes(rounded, allowed_dps)
    unseen = harmonic[errors >= allowed_dps[harmonic]]
    return int(unseen.min(initial=allowed_dps.size)) if harmonic.size else 0


def _plausible(rounded: AxisFit, allowed_dps: Array) -> bool:
    """True if no amplitude of the last term is surely more than rounding can do."""
    harmonic, sizes, errors = _amplitudes(rounded, allowed_dps)
    return bool(np.all(sizes < POLICY.rounding_size * allowed_dps[harmonic] + POLICY.rounding_errors * errors))


def _amplitudes(rounded: AxisFit, allowed_dps: Array) -> tuple[Index, Array, Array]:
    """Of each coefficient [k] of the last term that is fitted: its harmonic from 0, size and standard error, deg/s."""
    last = len(rounded.design.terms) - 1
    mine = [n for n, (i, _) in enumerate(rounded.design.layout.fixed) if i == last]
    harmonic = [rounded.design.layout.fixed[n][1] % allowed_dps.size for n in mine]
    cov = np.diag(rounded.solution.cov)
    return np.array(harmonic, dtype=np.intp), np.abs(rounded.solution.beta[mine]), np.sqrt(cov[mine])
