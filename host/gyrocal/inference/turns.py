"""Turns of a known angle whose angle is not exact: by hand, a turn ends some degrees from where it should.

The error of each turn is a random part of its mean rate. Its size is stated (``turn_se_deg``), or found from the scatter of
repeated turns about the line through them and the rests. Found from few turns it is itself uncertain, and the errors of the
coefficients that rest on the turns are those of Student's t.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyrocal import tails
from gyrocal.inference.blocks import Blocks
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import fit_noise
from gyrocal.noise.sample import weight_beside
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

LARGEST = 0.3
"""The error of a turn, as a fraction of its angle, with which the search begins."""
ROUNDS = 4
"""The scatter and the weights of the turns are found in turn."""
SETTLED, MOST_ROUNDS = 0.02, 12
"""Relative change of the white noise beside which the weights of turns stay, and the most rounds until then."""
LEAST_FREE = 0.05
"""Degrees of freedom below which turns do not show their scatter."""


def with_errors_of_turns(current: AxisFit) -> AxisFit:
    """The fit in which turns about the axis weigh by the error of their angle; the fit itself if they show and state none."""
    turns = _turns(current)
    known = {i: turns[i].run.turn_se_deg for i in turns}
    stated = {i: float(se) for i, se in known.items() if se is not None}
    if any(stated.values()):
        current = _settled(current, stated)
    return _scattered(current, turns, stated) if len(turns) - len(stated) > 1 else current


def beside_leaks(current: AxisFit) -> AxisFit:
    """The fit in which turns about other axes weigh by what they leak into this one; the fit itself if they show no leak.

    Such a turn tells the bias only if the axes are aligned and the hand does not tilt. Rests tell it directly.
    """
    axis = current.design.axis
    others = {
        i: b for i, b in enumerate(current.design.blocks) if b.run.rate_is_mean and b.run.axis_index != axis and b.t_s.size
    }
    return _scattered(current, others, {}) if others else current


def reweighed(fitted: AxisFit) -> AxisFit:
    """The fit of a richer model, in which turns of a stated error weigh by it beside the white noise that is left.

    A weight is relative to that noise. Where a term explains a part of the noise, the error of a turn would shrink with it.
    """
    stated = {i: float(b.run.turn_se_deg) for i, b in _turns(fitted).items() if b.weight is not None and b.run.turn_se_deg}
    return _settled(fitted, stated) if stated else fitted


def _settled(fitted: AxisFit, errors_deg: dict[int, float]) -> AxisFit:
    """The fit with weights of turns that fit to its white noise."""
    for _ in range(MOST_ROUNDS):
        before = fitted.noise.white_sd_dps
        fitted = _weighing(fitted, errors_deg)
        if abs(fitted.noise.white_sd_dps - before) < SETTLED * before:
            break
    return fitted


def _scattered(current: AxisFit, turns: dict[int, Blocks], stated: dict[int, float]) -> AxisFit:
    """The fit in which turns weigh by their scatter, or by a ``stated`` error; the fit itself if they show no scatter."""
    # drift would take the scatter for its own, so the search begins where the turns say nothing of it
    trial = _weighing(current, {i: stated.get(i, LARGEST * abs(b.run.turn_deg or 0.0)) for i, b in turns.items()})
    for _ in range(ROUNDS):
        scatter_deg = _scatter_deg(trial, [i for i in turns if i not in stated])
        if not scatter_deg:
            return current
        trial = _weighing(trial, {i: stated.get(i, scatter_deg) for i in turns})
    return trial if trial.loglik > current.loglik + POLICY.noise_shape_gain else current


def widening_by_turns(current: AxisFit) -> Array:
    """The factor [p] on the standard error of each shared coefficient for a scatter that was found from few turns."""
    cov = current.solution.cov
    scattered = [i for i, b in _turns(current).items() if b.weight is not None and b.run.turn_se_deg is None]
    free = _free(current, scattered)
    if free < LEAST_FREE:
        return np.ones(len(cov))
    share = np.zeros(len(cov))
    for i in scattered:
        share += (cov @ _column(current, i)) ** 2 / _variance(current, i)
    share = np.clip(share / np.diag(cov), 0.0, 1.0)
    return np.asarray(np.sqrt(1 + share * (tails.widening_to_95(free) ** 2 - 1)))


def _turns(current: AxisFit) -> dict[int, Blocks]:
    """The runs about the axis of which only the net angle is known, by their number."""
    axis = current.design.axis
    return {i: b for i, b in enumerate(current.design.blocks) if b.run.rate_is_mean and b.run.axis_index == axis and b.t_s.size}


def _weighing(current: AxisFit, errors_deg: dict[int, float]) -> AxisFit:
    """The fit with the weights of turns with these errors of their angles."""
    design, white = current.design, float(np.sqrt(_white_dps2(current)))
    blocks = list(design.given)
    for i, error_deg in errors_deg.items():
        weight = weight_beside(blocks[i].n, white, error_deg / blocks[i].run.duration_s)
        blocks[i] = replace(blocks[i], weight=weight)
    return fit_noise(design.over(blocks))


def _scatter_deg(current: AxisFit, turns: list[int]) -> float:
    """The scatter of the angles of turns beyond their other noise, deg; 0 if they leave no degree of freedom."""
    free = _free(current, turns)
    if free < LEAST_FREE:
        return 0.0
    left_deg = [current.block_residuals(i)[0] * current.design.blocks[i].run.duration_s for i in turns]
    of_noise = float(np.mean([_noise_deg2(current, i) for i in turns]))
    return float(np.sqrt(max(float(np.sum(np.square(left_deg))) / free - of_noise, 0.0)))


def _noise_deg2(current: AxisFit, i: int) -> float:
    """Variance that white noise and drift give the angle of a turn, deg^2."""
    b = current.design.blocks[i]
    return float(_white_dps2(current) / b.n[0] + current.noise.ou_sd_dps**2) * b.run.duration_s**2


def _white_dps2(current: AxisFit) -> float:
    """Variance of the white noise of a sample where blocks stand alone, dps^2."""
    return float(current.noise.white_sd_dps**2 * current.design.color.level)


def _free(current: AxisFit, turns: list[int]) -> float:
    """Degrees of freedom of the scatter of turns: their number less what the shared coefficients take of them."""
    taken = [_column(current, i) @ current.solution.cov @ _column(current, i) / _variance(current, i) for i in turns]
    return float(len(turns) - np.sum(taken))


def _column(current: AxisFit, i: int) -> Array:
    """The shared columns [p] of a turn, which is one block."""
    return np.asarray(current.design.columns(i)[1 : 1 + len(current.design.layout.fixed), 0])


def _variance(current: AxisFit, i: int) -> float:
    """Variance of the mean rate of a turn, dps^2."""
    return float(_white_dps2(current) / current.design.blocks[i].precision[0] + current.noise.ou_sd_dps**2)
