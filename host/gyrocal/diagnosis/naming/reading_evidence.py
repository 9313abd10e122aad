"""The evidence for a fault of the reading: the improvement in the prediction of held-out readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.explained import explained
from gyrocal.diagnosis.naming.gains import total
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.reading_tests import SHEPPARD
from gyrocal.effects.base import Effect
from gyrocal.effects.reading_fault import Detected
from gyrocal.error_model.model import Term
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import carried, fit_noise


@dataclass(frozen=True)
class RunPower:
    """Sum of squares of one run's residuals, dps^2, and their number."""

    squares: float
    samples: int


def judge_reading(current: Current, effect: Effect, fault: Detected) -> Candidate:
    """Judge a fault that the effect detected in the values of the readings."""
    term = Term(effect.id, current.axis, fault.values, fault.se)
    known = current.fit
    kind = effect.fault_of(fault.values)
    if kind is not None and kind.step_dps(fault.values) > 0:  # no waves of rounding beside the rounding
        known = current.comparison.likeliest.axes[current.axis]
    design = known.design.over(current.comparison.fit.blocks, [*known.design.terms, term])
    fitted = fit_noise(design, start=carried(known, design))
    before, after = (_run_powers(current, fit) for fit in (known, fitted))
    noise = max(_mean_power(after), _rounding_power(current))
    gains = np.array([_power_gain(before[file], after[file], noise) for file in before])
    gain, gain_se = total(gains)
    excess = explained(current, fitted, np.zeros(0), fault.chance)
    return Candidate(
        effect, current.axis, "reject", fault.values, fault.se, gain=gain, gain_se=gain_se, chance=fault.chance, parameters=1,
        next_measurement=effect.measure_next_in(current.runs), unit_gains=gains, explained=excess.part,
        excess_drop_dps=excess.drop_dps, excess_drop_se_dps=excess.drop_se_dps,
        enough=True,  # the codes show it, so it need not raise the error above the floor
    )  # fmt: skip


def _mean_power(powers: dict[str, RunPower]) -> float:
    """Mean square of the residuals beside the fault, dps^2. All of it counts as noise, not only the white part."""
    return sum(p.squares for p in powers.values()) / max(1, sum(p.samples for p in powers.values()))


def _rounding_power(current: Current) -> float:
    """Mean square of the rounding to the readings' own steps, dps^2, which is a lower bound for any prediction."""
    steps = [run.step_dps[current.index] for run in current.comparison.fit.session.runs]
    return float(min((s for s in steps if s > 0), default=0.0)) ** 2 * SHEPPARD


def _power_gain(before: RunPower, after: RunPower, noise: float) -> float:
    """Gain in log-likelihood when the power of a run decreases, at a noise of mean square ``noise``, dps^2.

    The excess is treated as additional noise: the gain is ``samples/2·log(1 + change/noise)``. For small changes this equals
    the Gaussian gain at known noise. For large changes it grows only logarithmically, as readings of finite range and step
    carry limited information.
    """
    change = (before.squares - after.squares) / (before.samples * noise)
    return 0.5 * before.samples * float(np.copysign(np.log1p(abs(change)), change))


def _run_powers(current: Current, fitted: AxisFit) -> dict[str, RunPower]:
    """The power of each run's held-out residuals by file. The residuals are in sample if nothing can be held out."""
    powers: dict[str, RunPower] = {}
    for p in current.predictions(fitted):
        old = powers.get(p.run.file, RunPower(0.0, 0))
        squares = old.squares + float(np.sum(p.residual_dps**2))
        powers[p.run.file] = RunPower(squares, old.samples + p.residual_dps.size)
    return powers
