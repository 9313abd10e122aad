"""A bias that walks on from run to run of a power cycle is no effect of what moves slowly beside it."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.likelihood_ratio import _ratio, likelihood_ratio
from gyrocal.inference.walk import Walk, Walks, _Offsets, _steps
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

RATE_HZ, SECONDS, PAUSE_S, WHITE_DPS = 25.0, 40.0, 10.0, 0.03
RATES_DPS = (45.0, -45.0, 90.0, -90.0, 20.0, -20.0, 120.0)


def session(
    seed: int, walk: float = 0.0, offset_dps: float = 0.0, per_c: float = 0.0, runs: int = 14, stated: bool = True
) -> Session:
    """One power cycle of many runs, warming up by 5 degC. The bias is a random walk of ``walk`` deg/s per root second; each run
    may have an ``offset_dps`` of its own (sd), and the bias of z a coefficient ``per_c`` of temperature, deg/s per degC."""
    rng, n = np.random.default_rng((41, seed)), round(SECONDS * RATE_HZ)
    whole_s = np.arange(round(runs * (SECONDS + PAUSE_S) * RATE_HZ)) / RATE_HZ
    walked = np.cumsum(rng.normal(0, walk / RATE_HZ**0.5, (whole_s.size, 3)), axis=0)
    temp_c = 25 + 5 * (1 - np.exp(-whole_s / 300))
    made = []
    for k in range(runs):
        begin_s = k * (SECONDS + PAUSE_S)
        rows, rate_dps = slice(round(begin_s * RATE_HZ), round(begin_s * RATE_HZ) + n), RATES_DPS[k % len(RATES_DPS)]
        gyro = rng.normal(0, WHITE_DPS, (n, 3)) + walked[rows] + [0.3, -0.2, 0.1] + rng.normal(0, offset_dps, 3)
        gyro[:, 2] += 1.004 * rate_dps + per_c * (temp_c[rows] - 25)
        run = make_run(
            whole_s[:n], gyro, table_rate_dps=rate_dps, power_on_s=begin_s if stated else None, temp_c=temp_c[rows]
        )  # fmt: skip
        made.append(run.after(made))
    return make_session(*made)


@cache
def z_of(seed: int, walk: float = 0.0, offset_dps: float = 0.0, per_c: float = 0.0, term: str | None = None) -> AxisFit:
    model = Model.builtin("default")
    model = model if term is None else model.with_term(Term(term, "z"))
    return fit(session(seed, walk, offset_dps, per_c), model, axes="z").axes["z"]


@pytest.mark.wide
@pytest.mark.parametrize(("walk", "stated"), [(1e-3, True), (3e-3, False)])
def test_a_walk_over_one_power_cycle_is_noise(walk: float, stated: bool) -> None:
    """Each session was a misfit against temperature or time when the drift began anew in each run."""
    for seed in range(3):
        found = measure(session(seed, walk, stated=stated))
        assert found.verdict == "adequate", [(f.axis, f.against, f.note) for f in found.where]


def test_temperature_does_not_explain_a_walk_but_its_own_effect() -> None:
    seeds = range(6)
    walks = [(z_of(seed, walk=2e-3), z_of(seed, walk=2e-3, term="bias_temperature")) for seed in seeds]
    assert sum(_ratio(*pair, 1)[1] < 1e-3 for pair in walks) >= 2
    assert min(likelihood_ratio(*pair, 1)[1] for pair in walks) > 1e-3
    true = [(z_of(seed, per_c=0.02), z_of(seed, per_c=0.02, term="bias_temperature")) for seed in range(2)]
    assert max(likelihood_ratio(*pair, 1)[1] for pair in true) < 1e-6


def test_five_runs_show_a_walk_that_a_drift_explains_by_chance() -> None:
    """By chance its four steps have one sign. A robot's session of five runs was told a drift at 13 of its errors."""
    default = Model.builtin("default")
    models = (default, default.with_term(Term("drift", "z")))
    pairs = [[fit(session(seed, walk=1e-3, runs=5), m, axes="z").axes["z"] for m in models] for seed in (4, 7)]
    assert max(_ratio(*pair, 1)[1] for pair in pairs) < 1e-3
    assert min(likelihood_ratio(*pair, 1)[1] for pair in pairs) > 1e-3


@pytest.mark.wide
def test_the_likelihood_beside_a_walk_is_that_of_the_whole_covariance() -> None:
    """Against SciPy's density of all block means, the shared parameters by generalised least squares."""
    found = fit(session(0, walk=2e-3, runs=5), Model.builtin("default"), axes="z").axes["z"]
    design, noise, walks = found.design, found.noise, Walks.of(found.design)
    assert walks is not None
    at, step_dps = _Offsets.of(walks, found, noise), 0.02
    run = np.repeat(np.arange(len(design.blocks)), design.n_blocks)
    t_s, y, x = (np.concatenate(parts) for parts in (
        [b.t_s for b in design.blocks], [design.columns(i)[0] for i in range(len(design.blocks))],
        [design.columns(i)[1:].T for i in range(len(design.blocks))],
    ))  # fmt: skip
    covariance = np.diag(noise.white_sd_dps**2 / np.concatenate([b.precision for b in design.blocks]))
    apart = np.abs(np.subtract.outer(t_s, t_s)) / noise.ou_tau_s
    covariance += noise.ou_sd_dps**2 * np.exp(-apart) * np.equal.outer(run, run)
    root = step_dps * _steps(walks.times[0])
    covariance += (root @ root.T)[np.ix_(run, run)]
    whitened = np.linalg.solve(covariance, x)
    left = y - x @ np.linalg.solve(x.T @ whitened, whitened.T @ y)
    expected = multivariate_normal(cov=covariance).logpdf(left)
    modes = at._modes([root / step_dps])
    assert at._beside(modes, step_dps * np.array([0.5, 1.0]))[1] == pytest.approx(expected, abs=1e-3)


def walk_of(found: AxisFit) -> Walk | None:
    walks = Walks.of(found.design)
    assert walks is not None
    return walks.walk(found)


def test_a_walk_has_its_size() -> None:
    for seed in range(3):
        walk = walk_of(z_of(seed, walk=3e-3))
        assert walk is not None
        steps = np.diff(np.diag(walk.covariance))
        assert 0.5 < np.sqrt(steps.mean() / (SECONDS + PAUSE_S)) / 3e-3 < 2


def test_offsets_in_no_order_are_no_walk() -> None:
    assert sum(walk_of(z_of(seed, offset_dps=0.03)) is not None for seed in range(6)) <= 1


def test_few_runs_show_no_walk() -> None:
    few = fit(session(0, walk=3e-3, runs=4), Model.builtin("default"), axes="z").axes["z"]
    assert Walks.of(few.design) is None
