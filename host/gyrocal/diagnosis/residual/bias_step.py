"""Steps of the bias at moments of single runs.

No other run can confirm what happened once, so that no effect is named from it. It is an error of the model all the same,
though a drift of the same size would describe it.
"""

from __future__ import annotations

import numpy as np

from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.probes import beside
from gyrocal.effects.bias_jumps import BiasJumps, jumps
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.likelihood_ratio import likelihood_ratio
from gyrocal.units import rate_text
from gyrocal.variables.shapes import StepsOfRuns
from gyrocal.variables.time import Time


def steps_of_runs(current: AxisFit, axis: str, alarm: float, alone: bool) -> Finding | None:
    """Test for steps of the bias at moments of single runs. The chance counts the moments among which they were chosen.

    ``alone`` is True if nothing else is found. Returns None without a finding, and where several runs, half of them or more,
    step and something else is found: what most runs do is rarely a single event.
    """
    runs = [b.run for b in current.design.blocks]
    at = [(run, row) for run in runs for row in jumps(run, current.design.axis)]
    stepping = len({run.file for run, _ in at})
    if not at or (not alone and stepping > 1 and 2 * stepping >= len(runs)):
        return None
    shape = StepsOfRuns([(run.file, float(run.sample_s[row])) for run, row in at])
    fitted = beside(current, axis, [shape])
    mine = len(fitted.design.terms) - 1
    columns = [j for j, (i, _) in enumerate(fitted.design.layout.fixed) if i == mine]
    if len(columns) < len(at):
        return None
    statistic, chance = likelihood_ratio(current, fitted, len(at))
    chance = min(1.0, chance * BiasJumps().looks(runs, current.design.axis).shapes)
    if chance >= alarm:
        return None
    sizes_dps = fitted.solution.beta[columns]
    k = int(np.argmax(np.abs(sizes_dps) / np.sqrt(np.diag(fitted.solution.cov)[columns])))
    run, row = at[k]
    note = f"a step of {rate_text(sizes_dps[k], '+')} {run.sample_s[row] - run.sample_s[0]:.4g} s after the start of {run.file}"
    others = len(at) - 1
    if others:
        note += f", and {others} other{'s' * (others > 1)}"
    elif len(runs) > 1:
        note += ", in no other run"
    strength = float(np.sqrt(max(0.0, statistic - len(at))))
    return Finding(axis, Time.name, strength, chance, abs(float(sizes_dps[k])), note, shape)
