"""How much better a richer model of an axis explains the session, and the chance that noise gains as much."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal import tails
from gyrocal.effects.base import Effect, elapsed_s
from gyrocal.effects.coding import Coding, OneSpread
from gyrocal.error_model.model import Term
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import carried, fit_noise, with_noise
from gyrocal.inference.reml import Spreads, SpreadScale
from gyrocal.inference.same_blocks import on_same_blocks
from gyrocal.inference.walk import Walks
from gyrocal.recording.session import AXES, Array, Run

FREE = 1e3
"""Of a spread, or what one power cycle knows of it: wide enough to say nothing."""
WIDEST = 1e6
"""Of what one power cycle knows of its offset: in a wider spread, the offset's information is lost in rounding."""
LEAST_CHANCE = 0.05
"""More is no finding, whatever the test."""
LONG = 20.0
"""Of the drift's correlation time: in longer runs, noise over decades moves more slowly than the fitted drift can."""
HALF_WAVES = 10


class _Wander(Effect):
    """Slow noise of each run: an offset, and ``HALF_WAVES`` cosines whose variances fall as the inverse of frequency."""

    id, title, cause, equation, looks_like, measure_next = "wander", "", "", "", "", ""
    parameters, scope = (), "run"
    linear = tuple(f"c{k}" for k in range(HALF_WAVES + 1))

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        k = np.arange(HALF_WAVES + 1)
        waves = np.cos(np.pi * k * elapsed_s(run)[:, None] / max(run.duration_s, 1e-9)) / np.sqrt(np.maximum(k, 1))
        return np.asarray(waves * (not run.rate_is_mean))

    @property
    def coding(self) -> Coding:
        return OneSpread(self.linear)


def likelihood_ratio(current: AxisFit, fitted: AxisFit, parameters: int) -> tuple[float, float]:
    """Twice the log-likelihood that a richer model's parameters gain, and the chance that noise gains as much.

    Both at their own noise, the poorer one also at the richer one's, whichever suits it. Chi-square takes the spread of power
    cycles for known, and a few cycles say little of it: what differs from cycle to cycle alone has to pass an F test of as many
    values as there are cycles. What shows within them has to pass chi-square with each cycle's own offset left free. The better
    of the two counts, twice, for there were two. In runs far longer than the drift's correlation time, the gain must also
    remain beside slow noise of each run, and where a power cycle has many runs, beside a bias that walks on from run to run.
    Both are held against the blocks that both see.
    """
    current, fitted = on_same_blocks(current, fitted)
    statistic, chance = _ratio(current, fitted, parameters)
    if chance < LEAST_CHANCE and current.design.extent_s[0] > LONG * current.noise.ou_tau_s and current.noise.ou_sd_dps > 0:
        slow, richer = _beside_wander(current), _beside_wander(fitted)
        chance = max(chance, _ratio(slow, richer, parameters)[1])
    if chance < LEAST_CHANCE and (walks := Walks.of(current.design)) is not None:
        chance = max(chance, _beside_walk(walks, current, fitted, parameters))
    return statistic, chance


def _beside_walk(walks: Walks, current: AxisFit, fitted: AxisFit, parameters: int) -> float:
    """The chance that noise gains as much beside a bias that walks on from run to run."""
    noises = (current.noise, fitted.noise)
    pairs = zip(walks.likeliest(fitted, noises), walks.likeliest(current, noises), strict=True)
    walking, within = (max(0.0, 2 * (richer - poorer)) for richer, poorer in pairs)
    left = walks.count - len(current.design.layout.fixed) - parameters
    return max(float(tails.chi_square(walking, parameters)), _of_few(walking, within, parameters, walks.count, left))


def _beside_wander(fit: AxisFit) -> AxisFit:
    axis = AXES[fit.design.axis]
    wander = Term("wander", axis, dict.fromkeys(_Wander.linear, 0.0), own=_Wander())
    design = fit.design.changed([*fit.design.terms, wander])
    return fit_noise(design, start=carried(fit, design))


def _ratio(current: AxisFit, fitted: AxisFit, parameters: int) -> tuple[float, float]:
    """The ratio and the chance with the drift as the only slow noise of runs."""
    poorer = [current]
    if fitted.noise != current.noise:
        poorer.append(with_noise(current.design, fitted.noise, current.spreads))
    statistic = max(0.0, 2 * (fitted.solution.profile_loglik - max(one.solution.profile_loglik for one in poorer)))
    chance = float(tails.chi_square(statistic, parameters))
    layout, cycles = current.design.layout, current.design.cycles
    if not layout.scenario or chance > LEAST_CHANCE:
        return statistic, chance
    within = 2 * (_of_free_cycles(fitted, cycles) - max(_of_free_cycles(one, cycles) for one in poorer))
    left = cycles - len(layout.fixed) - parameters
    return statistic, max(chance, _of_few(statistic, within, parameters, cycles, left))


def _of_few(statistic: float, within: float, parameters: int, count: int, left: int) -> float:
    """The chance of a gain between ``count`` power cycles or runs, by F with ``left`` degrees of freedom, or within them."""
    ratio = float(np.expm1(min(statistic / count, 500.0))) * left / parameters
    between = float(tails.f_ratio(ratio, parameters, left)) if left > 0 else 1.0
    return min(1.0, 2 * min(float(tails.chi_square(within, parameters)), between))


def _of_free_cycles(fitted: AxisFit, cycles: int) -> float:
    """Profile log-likelihood with the offset (and scale) of each power cycle free: what runs say by themselves.

    Each fit has spreads that are wide at its own noise, because one of them may explain far more than the other. The density of
    an offset falls in inverse proportion to its spread, which is taken back, so that the result does not depend on the width.
    """
    known = SpreadScale.of(fitted.design, fitted.grams).unit[fitted.spreads.run.size :]
    wide = np.minimum(FREE * np.maximum(fitted.spreads.scenario, known), WIDEST * known)
    free = fitted.equations().solve(Spreads(fitted.spreads.run, wide))
    return free.profile_loglik + cycles * float(np.sum(np.log(wide[wide > 0])))
