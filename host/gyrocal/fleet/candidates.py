"""Columns of the effects that a model may lack, on a grid of their nonlinear parameters that is the same for all boards.

An estimate of a nonlinear parameter and its curvature are meaningless if the amplitude is zero. At fixed values of the
parameter the likelihood is quadratic in the amplitude, so score and information on a common grid can be added over boards.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from gyrocal.effects.base import Effect, Values, effects
from gyrocal.effects.timing import TimingEffect
from gyrocal.inference.blocks import Blocks
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import integrate
from gyrocal.noise.whitening import Noise, Summed
from gyrocal.recording.session import AXES, Array, Run

GRID = 4
"""Number of values of each nonlinear parameter, evenly spaced in its logarithm over its typical range."""


def pooled_effects(taken: Sequence[str]) -> list[Effect]:
    """The effects whose size can be added over boards: those that are the same in all runs of a board, linear in their size.

    Faults of the reading, tones, effects of time and what differs from run to run are left to the diagnosis of one board.
    """
    return [
        kind for kind in effects().values()
        if kind.role is None and kind.scope == "session" and kind.linear and not kind.fast and kind.fault is None
        and not isinstance(kind, TimingEffect) and kind.id not in taken
    ]  # fmt: skip


def grid(kind: Effect) -> list[Values]:
    """The values of the nonlinear parameters at which an effect is tried."""
    points = [np.geomspace(*kind.parameter(name).typical, GRID).tolist() for name in kind.nonlinear]
    return [dict(zip(kind.nonlinear, point, strict=True)) for point in product(*points)]


def name_of(kind: Effect, axis: str, parameter: str, values: Values) -> str:
    """``effect.axis.parameter``, and the nonlinear values after a semicolon."""
    at = ",".join(f"{name}={value:.6g}" for name, value in values.items())
    return f"{kind.id}.{axis}.{parameter}" + (f";{at}" if at else "")


def _tried(runs: Sequence[Run], axis: int, taken: Sequence[str]) -> Iterator[tuple[Effect, Values]]:
    """The effects that this session could show, each with the names of its simplest variant and the grid's values."""
    for kind in pooled_effects(taken):
        if kind.missing(runs, axis) is None and not any(kind.lacks(run) for run in runs):
            variants = kind.variants(runs, axis)
            if variants:
                linear = {name: 0.0 for name in variants[0] if name in kind.linear}
                yield from ((kind, {**linear, **point}) for point in grid(kind))


def cycle_equations(fitted: AxisFit, noises: Sequence[Noise]) -> tuple[list[str], Array]:
    """The names of the candidates' columns, and the normal equations [noises, cycles, q, q] of ``[y | model | candidates]``.

    They are whitened with each of ``noises``. Coefficients that differ from run to run are integrated out with their fitted
    spreads.
    """
    design = fitted.design
    runs = [b.run for b in design.blocks]
    tried = list(_tried(runs, design.axis, [t.effect_id for t in design.terms]))
    names = [
        name_of(kind, AXES[design.axis], parameter, {n: v for n, v in values.items() if n in kind.nonlinear})
        for kind, values in tried for parameter in kind.coding.used(values)
    ]  # fmt: skip
    columns = [np.vstack([design.columns(i), _means(tried, b, design.axis)]) for i, b in enumerate(design.blocks)]
    q = 1 + len(design.layout.fixed) + len(design.layout.run) + len(names)
    grams = np.zeros((len(noises), len(runs), q, q))
    for index in design.alike:
        b = design.blocks[index[0]]
        summed = Summed.of((columns[i] for i in index), b.t_s, b.precision, design.cell_s, design.color)
        grams[:, index] = [summed.normal_equations(noise)[0] for noise in noises]
    p, own = len(design.layout.fixed), len(design.layout.run)
    if own:
        keep = np.r_[np.arange(1 + p), np.arange(1 + p + own, q)]
        sd = fitted.spreads.run[list(design.layout.run_group)]
        grams = integrate(grams, np.arange(1 + p, 1 + p + own), keep, sd).grams
    members = design.scenarios[None] == np.unique(design.scenarios)[:, None]
    return names, np.stack([grams[:, of].sum(axis=1) for of in members], axis=1)


def _means(tried: Sequence[tuple[Effect, Values]], b: Blocks, axis: int) -> Array:
    """Block means of the candidates' columns in one run, shape [k, m]."""
    if not tried:
        return np.zeros((0, b.t_s.size))
    return b.mean(np.column_stack([kind.columns(b.run, axis, values) for kind, values in tried])).T
