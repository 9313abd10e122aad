"""The search for drift and for the spread of the scale finds what was planted, whatever the bias and the run's length."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy.signal import butter, sosfilt

from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.error_model.model import Model
from gyrocal.inference.blocks import reduce_run
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import Solution, Spreads, solve
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift, ou_noise
from gyrocal.noise.power_cycles import TurnOnBias
from gyrocal.recording.session import Session
from gyrocal.simulation.production import Production
from make_runs import make_run, make_session

WHITE_DPS, SD_DPS, TAU_S = 0.007, 0.003, 50.0


def at_rest(seconds: float, bias_dps: float, rate_hz: float = 5.0) -> Session:
    rng = np.random.default_rng(5)
    t_s = np.arange(round(seconds * rate_hz)) / rate_hz
    gyro = rng.normal(bias_dps, WHITE_DPS, (t_s.size, 3)) + ou_noise(t_s.size, 1 / rate_hz, SD_DPS, TAU_S, 3, rng)
    return make_session(make_run(t_s, gyro, table_rate_dps=0.0))


@pytest.mark.parametrize("bias_dps", [0.0, 4.0])
def test_a_drift_much_shorter_than_the_run_is_found_beside_any_bias(bias_dps: float) -> None:
    """A drift that is fitted before the bias takes it for its own size, and ends as a random walk of a hundred times that."""
    session = at_rest(6000.0, bias_dps)
    for axis in fit(session, Model.open(None)).axes.values():
        assert 0.5 * TAU_S < axis.noise.ou_tau_s < 2 * TAU_S
        assert axis.noise.ou_sd_dps == pytest.approx(SD_DPS, rel=0.3)
    for level in measure(session).per_axis.values():
        assert level.rms_dps == pytest.approx(level.floor_dps, rel=0.01)


def swings(cycles: int, scale_sd: float, seed: int) -> Session:
    """One run of a swing in each power cycle, which has an offset and a scale of its own."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(4000) / 50.0
    runs = []
    for k in range(cycles):
        w = 70 * np.sin(2 * np.pi * t_s / rng.uniform(4, 12) + rng.uniform(0, 6))
        gyro = rng.normal(0, 0.03, (t_s.size, 3)) + rng.normal(0, 0.01, 3)
        gyro[:, 2] += (1.004 + rng.normal(0, scale_sd)) * w
        runs.append(make_run(t_s, gyro, scenario=f"s{k}", rate_ref_dps=w))
    return make_session(*runs)


@pytest.mark.parametrize("cycles", [2, 3, 8])
def test_power_cycles_show_their_own_scale_within_one_run(cycles: int) -> None:
    """The scale's error then holds the spread of the power cycles, which white noise alone makes far too small."""
    z = []
    for seed in range(12):
        terms = fit(swings(cycles, 1e-4, seed), Model.open(None), axes="z").axes["z"].terms
        (scale,) = (term for term in terms if term.effect_id == "scale")
        z.append((scale.values["scale"] - 0.004) / scale.se["scale"])
    assert np.median(np.abs(z)) < 1.3


def _fitted(drift: tuple[float, float] | None = None) -> AxisFit:
    """A board of the production line on z, its drift searched for or known."""
    noise = AxisNoise(drift=Drift(known=drift), turn_on_bias=TurnOnBias())
    model = replace(Model.open(), noise=dict.fromkeys("xyz", noise))
    return fit(Production(seconds=3.0, seed=2).board(0), model, axes=("z",)).axes["z"]


def test_a_known_drift_is_kept_and_the_rest_is_fitted_beside_it() -> None:
    free = _fitted()
    beside = _fitted((free.noise.ou_sd_dps / free.noise.white_sd_dps, free.noise.ou_tau_s))
    assert beside.noise.ou_sd_dps / beside.noise.white_sd_dps == pytest.approx(free.noise.ou_sd_dps / free.noise.white_sd_dps)
    assert beside.noise.ou_tau_s == free.noise.ou_tau_s
    assert beside.noise.white_sd_dps == pytest.approx(free.noise.white_sd_dps, rel=1e-3)
    assert free.loglik - 1e-3 < beside.loglik < free.loglik + 0.1  # a search ends before the very maximum
    off = np.abs(beside.solution.beta - free.solution.beta)
    assert (off < 0.02 * np.sqrt(np.diag(free.solution.cov))).all()


def test_the_likelihood_under_a_common_factor_of_all_noise_is_that_of_chi_square() -> None:
    """The search takes the slope by the white level from this law, where it would otherwise need two more evaluations."""
    one = _fitted()
    sd, n, p = np.array([0.03, 1e-4]), int(one.design.n_blocks.sum()), one.solution.beta.size

    def at(a: float) -> Solution:
        grams, logdet = one.design.grams(one.noise.times(np.exp(a)))
        return solve(one.design.layout, grams, logdet, one.design.scenarios, n, Spreads(one.spreads.run, sd * np.exp(a)))

    slope = (at(1e-4).loglik - at(-1e-4).loglik) / 2e-4
    assert slope == pytest.approx(at(0.0).chi2 - (n - p), rel=1e-5)


def test_many_spreads_at_once_are_each_alone() -> None:
    one = _fitted()
    many = np.array([[0.001, 1e-5], [0.02, 1e-4], [0.5, 1e-3]])
    equations = one.equations()
    together = equations.logliks(Spreads(one.spreads.run, many))
    assert together == pytest.approx([equations.solve(Spreads(one.spreads.run, sd)).loglik for sd in many], rel=1e-12)


def test_blocks_say_which_readings_they_moved_back() -> None:
    run = Production(seconds=3.0).board(0).runs[0]
    wild = run.table.with_columns(gz_dps=run.table["gz_dps"].set(pl.Series([i == 50 for i in range(len(run))]), 500.0))
    (none_x, _), _, (rows, apart_dps) = reduce_run(replace(run, frame=wild), 0).strays
    assert (none_x.size, rows.tolist()) == (0, [50])
    assert apart_dps[0] == pytest.approx(500.0 - run.gyro_dps[50, 2], abs=0.5)


@pytest.mark.parametrize("apart_dps", [0.02, 0.3, 2.0])
def test_the_spread_of_two_power_cycles_is_at_the_maximum_of_its_likelihood(apart_dps: float) -> None:
    """The search stopped where its slope was small beside the one at its start, at half of the spread."""
    rng, t_s = np.random.default_rng(5), np.arange(500) / 25
    runs = [
        make_run(t_s, rng.normal(0, 0.03, (t_s.size, 3)) + cycle * apart_dps, table_rate_dps=0.0, scenario=f"s{cycle}")
        for cycle in (0, 1) for _ in range(6)
    ]  # fmt: skip
    found = fit(make_session(*runs), Model.builtin("default"), axes="z").axes["z"]
    spreads = (Spreads(found.spreads.run, np.array([sd])) for sd in np.geomspace(0.1, 2, 60) * apart_dps)
    tried = [found.equations().solve(one).loglik for one in spreads]
    assert found.loglik > max(tried) - 0.01
    assert found.spreads.scenario[0] == pytest.approx(apart_dps / 2**0.5, rel=0.1)


@pytest.mark.parametrize("seed", [0, 1])
def test_behind_a_low_pass_a_fast_drift_does_not_pass_for_the_colour_of_samples(seed: int) -> None:
    """With a tone in the model, which is fitted to samples, the search ended at a drift of 48 mdps and 4 s. No slow effect was
    seen beside it.
    """
    rng, rate_hz, runs = np.random.default_rng(seed), 145.0, []
    t_s, sections = np.arange(round(23 * rate_hz)) / rate_hz, butter(2, 0.4, output="sos")
    for k in range(24):
        since_s = 5.0 + 30 * (k % 6) + t_s
        slow = -0.009 * np.exp(-since_s / 90.0) + 0.0008 * np.cos(2 * np.pi * 18.977 * (since_s + 300 * (k // 6)))
        noise = sosfilt(sections, rng.normal(0, 0.0017, (t_s.size + 200, 3)), axis=0)[200:]
        runs.append(make_run(
            t_s, 0.3 + noise + np.outer(slow, [0, 0, 1]), table_rate_dps=0.0, scenario=f"s{k // 6}", rate_hz=rate_hz,
            power_on_s=float(since_s[0]),
        ))  # fmt: skip
    axis = fit(make_session(*runs), Model.builtin("default").add("vibration_tone", "z"), axes="z").axes["z"]
    assert axis.noise.ou_sd_dps < 0.003
    assert axis.noise.white_sd_dps > 0.0017
