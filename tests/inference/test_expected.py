"""The expected power of held-out residuals, held against dense Gaussian algebra."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from gyrocal.effects import base
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.blocks import Blocks
from gyrocal.inference.expected import expected
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.heldout import Fold
from gyrocal.inference.reml import Spreads
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate

Mask = NDArray[np.bool_]


def small(scenarios: int, effects: tuple[str, ...] = ()) -> Session:
    return simulate(None, "paper", list(effects), 4, scenarios=scenarios, seconds=6.0)[0]


def fitted(session: Session, *terms: str, noise: Noise, turn_on: tuple[float, ...] = (0.01, 1e-4)) -> AxisFit:
    """The z axis with given noise, so that the reference needs no search."""
    model = Model.open(None)
    for effect_id in terms:
        model = model.with_term(Term.of(base.effects()[effect_id], "z"))
    axis = fit(session, model, axes="z").axes["z"]
    own = np.full(axis.spreads.run.size, 3e-3)
    return replace(axis, noise=noise, spreads=Spreads(own, np.array(turn_on[: axis.spreads.scenario.size])))


def parts_of_a_run(b: Blocks, first: float, last: float) -> tuple[Mask, Mask]:
    """Masks [m] of what is left out, and of what stands beside it: a twentieth of the run on both sides, at most 2 s."""
    elapsed_s, beside_s = b.t_s - b.run.t_s[0], min(2.0, 0.05 * b.run.duration_s)
    start_s, stop_s = first * b.run.duration_s, last * b.run.duration_s
    inside = (start_s <= elapsed_s) & (elapsed_s < stop_s)
    return inside, ~inside & (start_s - beside_s <= elapsed_s) & (elapsed_s < stop_s + beside_s)


def dense(axis: AxisFit, folds: list[Fold]) -> tuple[float, float]:
    """Expected power and that within power cycles, by matrices of all blocks: conditional means of a joint Gaussian."""
    design, noise = axis.design, axis.noise
    p = len(design.layout.fixed)
    sizes = design.n_blocks
    start = np.concatenate([[0], np.cumsum(sizes)])
    rows = [slice(a, b) for a, b in pairwise(start.tolist())]
    m = int(start[-1])
    n, x = np.concatenate([b.n for b in design.blocks]), np.zeros((m, p))
    v, rate = np.diag(noise.white_sd_dps**2 / n), np.zeros(m)
    own = axis.spreads.run[list(design.layout.run_group)]
    k = own.size
    z, s = np.zeros((m, k * len(rows))), list(design.layout.scenario)
    of_cycle = np.zeros((m, m))
    for i, (r, b) in enumerate(zip(rows, design.blocks, strict=True)):
        columns = design.columns(i)[1:].T
        x[r], z[r, k * i : k * (i + 1)] = columns[:, :p], columns[:, p:]
        apart = np.abs(b.t_s[:, None] - b.t_s)
        v[r, r] += noise.ou_sd_dps**2 * np.exp(-apart / noise.ou_tau_s)
        rate[r] = b.run.rate_dps[0]
    same = np.repeat(design.scenarios, sizes)
    of_cycle = (same[:, None] == same) * ((x[:, s] * axis.spreads.scenario**2) @ x[:, s].T)
    prior = np.diag(np.tile(own**2, len(rows)))
    covariance = v + z @ prior @ z.T + of_cycle
    residual, held_all = np.zeros((0, m)), []
    for fold in folds:
        use, held = [], []
        for i, (r, b) in enumerate(zip(rows, design.blocks, strict=True)):
            inside, near = np.full((2, b.t_s.size), False)
            if fold.time is not None:
                inside, near = parts_of_a_run(b, *fold.time)
            elif i in fold.runs:
                inside[:] = True
            use += list(np.flatnonzero(~inside & ~near) + r.start)
            held += list(np.flatnonzero(inside) + r.start)
        inverse = np.linalg.inv(covariance[np.ix_(use, use)])
        beta = np.zeros((p, m))
        beta[:, use] = np.linalg.solve(x[use].T @ inverse @ x[use], x[use].T @ inverse)
        error = np.eye(m) - x @ beta
        if k:
            seen = use if fold.time is not None else range(m)
            for i, r in enumerate(rows):
                mine = [j for j in seen if r.start <= j < r.stop]
                zi = z[:, k * i : k * (i + 1)]
                inner = v + zi @ np.diag(own**2) @ zi.T + of_cycle
                gain = np.diag(own**2) @ zi[mine].T @ np.linalg.inv(inner[np.ix_(mine, mine)])
                error[r] -= zi[r] @ gain @ (np.eye(m) - x @ beta)[mine]
        residual = np.vstack([residual, error[held]])
        held_all += held
    spread = residual @ covariance @ residual.T
    weight = n[held_all]
    total = float(weight @ np.diag(spread))
    within = total
    for cycle in np.unique(same):
        o = np.column_stack([np.ones(len(held_all)), rate[held_all]]) * (same[held_all] == cycle)[:, None]
        within -= float(np.trace(np.linalg.pinv((o.T * weight) @ o) @ (o.T * weight) @ spread @ (o.T * weight).T))
    return total, within


DRIFTS = [Noise(0.04), Noise(0.04, 0.01, 5.0), Noise(0.04, 0.05, 4000.0)]


@pytest.mark.parametrize("noise", DRIFTS)
@pytest.mark.parametrize(("scenarios", "terms"), [(3, ()), (2, ()), (3, ("table_ripple",)), (1, ("table_ripple",))])
def test_it_is_that_of_dense_gaussian_algebra(noise: Noise, scenarios: int, terms: tuple[str, ...]) -> None:
    axis = fitted(small(scenarios, ("table_ripple",) if terms else ()), *terms, noise=noise)
    runs = range(len(axis.design.blocks))
    by_cycle = [Fold(str(c), tuple(i for i in runs if axis.design.scenarios[i] == c)) for c in range(scenarios)]
    by_run = [Fold(str(i), (i,)) for i in runs]
    by_time = [Fold("time", tuple(runs), (k / 3, (k + 1) / 3)) for k in range(3)]
    for folds in ([by_cycle, by_run] if scenarios > 1 else []) + [by_time]:
        got = expected(axis, folds)
        assert (got.squares, got.within) == pytest.approx(dense(axis, folds), rel=1e-6)
