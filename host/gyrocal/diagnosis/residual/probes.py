"""Probes: tests that find the variable on which a misfit depends, without naming a cause.

A probe fits one shape of a variable (``variables/``) together with the model and the noise. It then tests the fitted
coefficients against their covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.residual.drawn_size import described, described_of_each_run
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.error_model.model import Term
from gyrocal.inference.design import Design
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.likelihood_ratio import likelihood_ratio
from gyrocal.inference.noise_search import carried, fit_noise, with_noise
from gyrocal.inference.reml import unknown_spreads
from gyrocal.noise.whitening import Noise
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.variables.base import variables
from gyrocal.variables.shapes import Shape, ShapeOfEachRun, Steps

LARGEST_CONDITION = 1e6
"""Condition number of columns above which they are not fitted together."""


def beside(current: AxisFit, axis: str, shapes: Sequence[Shape]) -> AxisFit:
    """The model fitted together with shapes: the noise that remains when the probes' findings are removed."""
    terms = [Term(f"probe_{i}", axis, dict.fromkeys(s.linear, 0.0), own=s) for i, s in enumerate(shapes)]
    design = current.design.changed([*current.design.terms, *terms])
    return fit_noise(design, start=carried(current, design))


def with_curves(current: AxisFit, shapes: Sequence[Shape], curve: Callable[[Steps], Shape]) -> list[Shape]:
    """The shapes; steps of a variable that changes within them with the ``curve`` that they follow only roughly.

    Curves that the other columns determine are left out.
    """
    blocks, axis = current.design.blocks, current.design.axis

    def columns(shape: Shape) -> Array:
        return np.concatenate([b.mean(shape.columns(b.run, axis, {})) for b in blocks])

    out = list(shapes)
    known = np.column_stack([np.ones(int(current.design.n_blocks.sum())), *map(columns, out)])
    for shape in shapes:
        if isinstance(shape, Steps):
            beyond = curve(shape)
            more = np.column_stack([known, columns(beyond)])
            if np.linalg.cond(more / np.maximum(np.linalg.norm(more, axis=0), 1e-300)) < LARGEST_CONDITION:
                out, known = [*out, beyond], more
    return out


def of_session(session: Session, axis: int) -> list[tuple[str, list[Shape]]]:
    """The shapes that a session allows on one axis, each with the variable that it depends on."""
    if all(r.rate_is_mean for r in session.runs):
        return []
    runs = session.about(AXES[axis]).runs
    return [(name, variable(runs).shapes(axis)) for name, variable in variables().items()]


def probe(current: AxisFit, axis: str, against: str, shape: Shape, alarm: float) -> Finding | None:
    """Fit a shape together with the model and judge it. None if the session cannot separate it from the model's own terms.

    The first judgement assumes no drift, which makes every shape look more significant, so it rejects only shapes that are
    certainly absent. A shape that passes is judged again with drift and spreads estimated together with the probe.
    """
    current = _where_known(current, shape)
    term = Term("probe", axis, dict.fromkeys(shape.linear, 0.0), own=shape)
    design = current.design.changed([*current.design.terms, term])
    mine = len(design.terms) - 1
    if isinstance(shape, ShapeOfEachRun):
        return _probe_each_run(current, design, axis, against, shape)
    columns = [j for j, (i, _) in enumerate(design.layout.fixed) if i == mine]
    if not columns:
        return None
    white = Noise(current.noise.white_sd_dps)
    statistic = _wald(with_noise(design, white, current.spreads), columns)
    chance = float(tails.chi_square(statistic, len(columns)))
    if chance < alarm:
        # the probe may have reduced the noise estimate, on which Wald's statistic depends; the likelihood ratio does not
        fitted = fit_noise(design, start=with_noise(design, current.noise, current.spreads))
        statistic, chance = likelihood_ratio(current, fitted, len(columns))
    amplitude, note = described(current, shape) if chance < alarm else (0.0, "")
    strength = float(np.sqrt(max(0.0, statistic - len(columns))))
    return Finding(axis, against, strength, chance, amplitude, note, shape)


def _where_known(current: AxisFit, shape: Shape) -> AxisFit:
    """The fit to the runs that have the variable of a shape."""
    blocks = [b for b in current.design.blocks if not shape.lacks(b.run)]
    if len(blocks) in (0, len(current.design.blocks)):
        return current
    design = current.design.over(blocks)
    return fit_noise(design, start=with_noise(design, current.noise, unknown_spreads(design)))


def _probe_each_run(current: AxisFit, design: Design, axis: str, against: str, shape: ShapeOfEachRun) -> Finding | None:
    """Judge a shape whose size differs from run to run by the likelihood that its spread gains."""
    start = carried(current, design)
    gain = start.loglik - current.loglik
    if gain < POLICY.wave_gain and current.noise.ou_sd_dps == 0:
        return None
    fitted = fit_noise(design, start=start) if gain > POLICY.refit_gain else start
    without = with_noise(current.design, fitted.noise, current.spreads).loglik
    gain = max(0.0, fitted.loglik - max(current.loglik, without))
    sd = float(fitted.spreads.run[-1])
    amplitude, note = described_of_each_run(fitted, shape)
    chance = float(0.5 * tails.chi_square(2 * gain, 1)) if sd > 0 else 1.0
    return Finding(axis, against, float(np.sqrt(2 * gain)), chance, amplitude, note, shape)


def _wald(fit: AxisFit, columns: Sequence[int]) -> float:
    beta = fit.solution.beta[list(columns)]
    cov = fit.solution.cov[np.ix_(columns, columns)]
    return float(beta @ np.linalg.solve(cov, beta))

