"""The fit that is told and drawn where an effect is missing: its drift is at most what is left beside the misfit.

With an effect missing, the likeliest drift is the effect itself. A transient at the start of each run becomes a drift of the
transient's size, by which least squares then weighs: the model follows some seconds of each run and misses the others, and its
excess is not that of the effect. Beside the shapes that the tests of the residual have found, the drift is that of the sensor.
With it the model is the one that a person would draw through the readings. Effects are compared at the likeliest noise all the
same, so that naming one does not use this fit.
"""

from __future__ import annotations

from dataclasses import replace

from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import with_noise
from gyrocal.inference.reml import Equations, Spreads
from gyrocal.inference.standard_errors import finish
from gyrocal.noise.whitening import Noise


def bounded(current: AxisFit, clean: AxisFit) -> AxisFit:
    """The model of ``current`` by least squares, with the noise and the spreads over power cycles of ``clean``.

    ``clean`` is the fit beside the misfit. The weights are those of white noise: weights of drift prefer the ends of runs,
    where a transient is. Errors stay those of ``current``.
    """
    design = current.design
    same = clean.spreads.scenario.size == current.spreads.scenario.size
    spreads = Spreads(current.spreads.run, clean.spreads.scenario if same else current.spreads.scenario)
    grams, logdet = design.grams(replace(clean.noise, ou_sd_dps=0.0))
    equations = Equations(design.layout, grams, logdet, design.scenarios, int(design.n_blocks.sum()))
    solution = replace(equations.solve(spreads), cov=current.solution.cov)
    drawn = replace(current, noise=clean.noise, spreads=spreads, solution=solution, grams=grams, logdet=logdet)
    pairs = zip(current.terms, finish(drawn).terms, strict=True)
    return replace(drawn, terms=tuple(replace(term, values=found.values) for term, found in pairs))


def at_most(fitted: AxisFit, bound: Noise) -> AxisFit:
    """A fit whose drift moves a run by no more than that of the ``bound`` does; the fit itself if it does not."""
    longest_s = fitted.design.extent_s[0]
    if fitted.noise.drift_within(longest_s) <= bound.drift_within(longest_s):
        return fitted
    found = with_noise(fitted.design, bound, fitted.spreads)
    return replace(found, terms=fitted.terms, noise_model=fitted.noise_model)
