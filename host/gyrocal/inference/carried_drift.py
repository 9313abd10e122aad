"""What a drift that goes on from run to run adds to the errors of the shared coefficients.

The drift of the noise model begins anew in each run, so that the runs of a power cycle are independent of one another. The bias
of a real sensor goes on from one run to the next. A slow effect, as of the temperature, is then known less well than many
independent runs would tell, and the drift within short runs says little of its size and of its correlation time. The errors are
therefore averaged over both accounts and over correlation times, each with the weight of its likelihood (REML). That there is
no drift has the prior probability of all of them together. A drift that goes on is one Markov process over the time of a power
cycle; one that begins anew is the same process over runs that are infinitely far apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from gyrocal.effects.quantities import cycle_time_s
from gyrocal.inference.design import Design
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import Equations, Solution, Spreads
from gyrocal.noise.whitening import Noise, Summed
from gyrocal.recording.session import Array

TIMES = 2.0 ** np.arange(-2, 5)
"""Correlation times that are tried, of the fitted one. The growth of the drift in time, which short runs show, is as fitted."""
APART_S = 1e7
"""Time between runs whose drift begins anew: far more than any correlation time."""


def carried_factor(current: AxisFit) -> Array:
    """The factor [p] on the standard error of each shared coefficient; at least 1, and 1 where the fit has no drift.

    It does not go below 1: the coefficients have the weights of a drift that begins anew in each run.
    """
    own = np.diag(current.solution.cov)
    if current.noise.ou_sd_dps <= 0 or not own.size:
        return np.ones(own.size)
    known = list(times_of_cycles(current.design))
    accounts = [[_summed(current, runs, _apart(times)) for runs, times in known]]
    if follow_each_other(known):
        accounts.append([_summed(current, runs, times) for runs, times in known])
    noises = [_slower(current.noise, times) for times in TIMES.tolist()]
    white = _solved(current, accounts[0], [replace(current.noise, ou_sd_dps=0.0)])
    found = [*white, *(one for cycles in accounts for one in _solved(current, cycles, noises))]
    logliks = np.array([one.loglik for one in found])
    logliks[0] += np.log(len(found) - 1)
    solved = np.isfinite(logliks)
    if not solved.any():
        return np.ones(own.size)
    weights = np.exp(logliks[solved] - logliks[solved].max())
    variances = np.array([np.diag(one.cov) for one in found])[solved]
    return np.asarray(np.sqrt(np.maximum(weights @ variances / weights.sum() / own, 1.0)))


def times_of_cycles(design: Design) -> Iterator[tuple[list[int], list[Array]]]:
    """The runs of each power cycle in the order of time, and the times [m] of their blocks, s."""
    for cycle in np.unique(design.scenarios):
        runs = [i for i in np.flatnonzero(design.scenarios == cycle).tolist() if design.blocks[i].t_s.size]
        times = {i: design.blocks[i].mean(cycle_time_s(design.blocks[i].run)[:, None])[:, 0] for i in runs}
        runs.sort(key=lambda i: float(times[i][0]))
        if runs:
            yield runs, [times[i] for i in runs]


def follow_each_other(known: Sequence[tuple[Sequence[int], Sequence[Array]]]) -> bool:
    """True if a power cycle has several runs, and no two of one are at the same time.

    ``known`` holds the runs of each cycle and the times [m] of their blocks, s.
    """
    ordered = all((np.diff(np.concatenate(times)) > 0).all() for _, times in known)
    return ordered and any(len(runs) > 1 for runs, _ in known)


def _apart(times: Sequence[Array]) -> list[Array]:
    return [t - t[0] + APART_S * k for k, t in enumerate(times)]


def _summed(current: AxisFit, runs: Sequence[int], times: Sequence[Array]) -> Summed:
    """The sums over one power cycle of the readings, less what each run has of its own, and of the shared columns."""
    design, beta = current.design, current.solution.beta
    shared = 1 + beta.size
    columns, products = [], np.zeros((shared, shared))
    for i in runs:
        of_run = design.columns(i)
        of_run[0] -= current.run_coefficients(i, beta, current.spreads) @ of_run[shared:]
        columns.append(of_run[:shared])
        products += design.noise_products[i, :shared, :shared]
    precision = np.concatenate([design.blocks[i].precision for i in runs])
    return Summed.of([np.hstack(columns)], np.concatenate(times), precision, design.cell_s, design.color).less(products)


def _slower(noise: Noise, times: float) -> Noise:
    """The noise with another correlation time of the drift, whose variance grows as fast within short runs."""
    return replace(noise, ou_sd_dps=noise.ou_sd_dps * times**0.5, ou_tau_s=noise.ou_tau_s * times)


def _solved(current: AxisFit, cycles: Sequence[Summed], noises: Iterable[Noise]) -> list[Solution]:
    layout = current.design.layout.shared
    spreads, n = Spreads(np.zeros(0), current.spreads.scenario), int(current.design.n_blocks.sum())
    out = []
    for noise in noises:
        grams, logdet = zip(*(cycle.normal_equations(noise) for cycle in cycles), strict=True)
        equations = Equations(layout, np.concatenate(grams), np.array(logdet), np.arange(len(cycles)), n)
        out.append(equations.solve(spreads))
    return out
