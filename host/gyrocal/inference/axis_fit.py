"""The fit of one axis: generalised least squares of any list of effects, jointly with the noise, by REML.

On block means: ``y = X·beta + Z_run·u + Z_scenario·v + drift + white``. ``beta`` are the parameters that all runs share; ``u``
coefficients of a run's own (a phase, an onset), random with spreads that are estimated; ``v`` the offset (and scale) of a power
cycle. Nonlinear parameters are found about it: on a grid, then refined, and where runs differ, run by run.

The steps are functions that take an :class:`~gyrocal.inference.fitted.AxisFit` or a design and return a new fit; ``diagnosis``
composes the same ones: ``structure.choose_variant`` adds a term, ``nonlinear.refine`` moves its nonlinear parameters,
``runs_apart.runs_apart`` lets them differ between runs, ``noise_search.fit_noise`` searches the noise, and
``standard_errors.finish`` names the parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gyrocal.effects.base import Values
from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.model import Term
from gyrocal.inference.blocks import Blocks, by_sample
from gyrocal.inference.design import SLOW_S, Design
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import fit_noise, with_noise
from gyrocal.inference.noise_shape import reshaped, shaped
from gyrocal.inference.nonlinear import refine
from gyrocal.inference.reml import unknown_spreads
from gyrocal.inference.runs_apart import runs_apart
from gyrocal.inference.standard_errors import finish
from gyrocal.inference.structure import choose_variant
from gyrocal.inference.timing import settle, started
from gyrocal.noise.axis import AxisNoise

MANY_BLOCKS = 5000
"""Below this many blocks, the exact noise model is used. Above it, drift is constant within short cells of time."""
NEGLIGIBLE_DRIFT = 0.01
"""Largest contribution of drift beyond the cell rate, as a fraction of the white noise's spectral density."""
LONGEST_CELL_S = SLOW_S / 4


def fit_axis(
    blocks: Sequence[Blocks], axis: int, terms: Sequence[Term], noise_model: AxisNoise,
    about: Mapping[str, Values] | None = None,
) -> AxisFit:  # fmt: skip
    """Fit one axis: structure and nonlinear parameters by grid and refinement, noise and spreads by REML.

    ``about``: see :class:`gyrocal.inference.design.Design`.
    """
    terms = started([_prepared(t, blocks, axis) for t in terms], [b.run for b in blocks], axis)
    if any(t.effect.fast for t in terms):
        blocks = by_sample(blocks)
    pending = [i for i, t in enumerate(terms) if _needs_choice(t)]
    settled = [t for i, t in enumerate(terms) if i not in pending]
    current = settle(fit_noise(Design(blocks, axis, settled, noise_model, about=about)))
    settled = list(current.design.terms)
    cell_s = _drift_cell_s(current) if current.design.n_blocks.sum() > MANY_BLOCKS else 0.0
    if cell_s:
        design = Design(blocks, axis, settled, noise_model, cell_s, like=current.design, about=about)
        current = fit_noise(design, start=with_noise(design, current.noise, current.spreads))
    current = shaped(current)
    for i in pending:
        current = choose_variant(current, terms[i])
    current = reshaped(current, blocks) if pending else current
    order = {t.effect_id: i for i, t in enumerate(terms)}
    current = _in_order(current, order, bool(pending))
    return finish(settle(runs_apart(refine(current))), reported=True)


def _prepared(term: Term, blocks: Sequence[Blocks], axis: int) -> Term:
    """A term whose values are open, with those of the fault of the reading that shows, or with its only variant.

    The noise is first fitted beside all terms that leave no choice. Beside a bias that is missing, drift would swallow it.
    """
    runs = [b.run for b in blocks]
    if term.values or isinstance(term.effect, TimingEffect):
        return term
    if term.effect.fault is not None:
        found = term.effect.fault.detect(runs, axis)
        return term if found is None else replace(term, values=found.values, se=found.se)
    variants = term.effect.variants(runs, axis)
    return replace(term, values=variants[0]) if len(variants) == 1 else term


def _needs_choice(term: Term) -> bool:
    return not term.values and term.fault is None


def _drift_cell_s(current: AxisFit) -> float:
    """How long drift may be taken to be constant, s: what it does in less is a hundredth of the white noise there; 0 = a block.

    The drift's spectral density at the highest frequency that such cells hold, pi / cell_s, against that of the white noise.
    Cells are whole blocks: else a cell that is a thousandth longer would part the blocks in another way, and two models whose
    noise hardly differs would differ in log-likelihood by several units.
    """
    noise, n = current.noise, float(np.median(np.concatenate([b.n for b in current.design.blocks])))
    block_s = current.design.extent_s[1]
    white = noise.white_sd_dps**2 * block_s / n
    drift = 2 * noise.ou_sd_dps**2 / (np.pi**2 * noise.ou_tau_s)
    cell_s = float(np.sqrt(NEGLIGIBLE_DRIFT * white / drift)) if drift > 0 else LONGEST_CELL_S
    blocks = round(min(cell_s, LONGEST_CELL_S) / block_s)
    return blocks * block_s if blocks > 1 else 0.0


def _in_order(current: AxisFit, order: dict[str, int], chosen: bool) -> AxisFit:
    """The terms in the model's order; where some were ``chosen`` one by one, the noise is fitted anew beside all of them."""
    terms = sorted(current.design.terms, key=lambda t: order[t.effect_id])
    if list(current.design.terms) == terms and not (chosen and current.design.noise_model.components):
        return current
    design = current.design.changed(terms)
    return fit_noise(design, start=with_noise(design, current.noise, unknown_spreads(design)))
