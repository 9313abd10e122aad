"""The chance that slow noise gains as much as an effect: a line in time under flicker noise, which has no correlation time."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from gyrocal.benchmark import _module
from gyrocal.diagnosis.naming.judge import judge
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.effects.base import effect
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.likelihood_ratio import LONG, _ratio, likelihood_ratio
from gyrocal.recording.session import Session
from known import ON_Z
from make_runs import make_run, make_session

RATE_HZ, SECONDS, FLICKER_DPS, WHITE_DPS = 5.0, 1000.0, 0.005, 0.01


def flicker(rng: np.random.Generator, n: int, size_dps: float = FLICKER_DPS) -> np.ndarray:
    """Noise of the one-sided density ``B^2 / (2 pi f)`` down to an eighth of the lowest frequency of the run."""
    f = np.fft.rfftfreq(8 * n, 1 / RATE_HZ)[1:]
    size = np.sqrt(size_dps**2 / (2 * np.pi * f) * RATE_HZ * 8 * n / 4)
    phasors = size * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
    return np.asarray(np.fft.irfft(np.concatenate([[0], phasors]), 8 * n)[:n])


def with_and_without_drift(
    seed: int, slope_dps_per_s: float = 0.0, seconds: float = SECONDS, flicker_dps: float = FLICKER_DPS
) -> tuple[AxisFit, AxisFit]:
    """Fits to two runs at rest without and with a line in time, the x axis alone."""
    rng, t_s = np.random.default_rng(seed), np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    runs = []
    for i in range(2):
        x = flicker(rng, t_s.size, flicker_dps) + rng.normal(0, WHITE_DPS, t_s.size) + slope_dps_per_s * t_s
        runs.append(make_run(t_s, np.column_stack([x, x, x]), table_rate_dps=0.0, scenario=f"s{i}"))
    session, model = make_session(*runs), Model.builtin("default")
    poorer, richer = (fit(session, m, axes="x").axes["x"] for m in (model, model.with_term(Term("drift", "x"))))
    return poorer, richer


@pytest.mark.wide
def test_flicker_noise_is_hardly_ever_a_line_in_time() -> None:
    assert min(likelihood_ratio(*with_and_without_drift(seed), 1)[1] for seed in range(10)) > 1e-3


@pytest.mark.wide
def test_strong_flicker_noise_is_no_line_in_time_where_one_correlation_time_does_not_explain_it() -> None:
    fits = [with_and_without_drift(seed, seconds=3000.0, flicker_dps=0.015) for seed in range(4)]
    assert np.count_nonzero(np.array([_ratio(*fit, 1)[1] for fit in fits]) < 1e-3) >= 2
    assert min(likelihood_ratio(*fit, 1)[1] for fit in fits) > 1e-3


def test_a_line_that_noise_does_not_make_is_still_seen() -> None:
    for seed in range(3):
        poorer, richer = with_and_without_drift(seed, slope_dps_per_s=1e-4)
        assert poorer.design.extent_s[0] > LONG * richer.noise.ou_tau_s
        assert likelihood_ratio(poorer, richer, 1)[1] < 1e-6


@pytest.mark.parametrize("cycles", [5, 8])
def test_between_few_power_cycles_the_chance_is_that_of_a_line_through_their_means(cycles: int) -> None:
    """One temperature and one offset in each cycle: least squares knows the chance; the better of two tests costs twice it."""
    t_s, temp_c, compared = np.arange(400) / 20.0, np.linspace(15, 35, cycles), 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        offset_dps = rng.normal(0, 0.05, cycles) + 0.006 * (temp_c - 25)
        runs = [
            make_run(t_s, rng.normal(o, WHITE_DPS, (t_s.size, 3)), table_rate_dps=0.0, scenario=f"s{i}", temp_c=temp_c[i])
            for i, o in enumerate(offset_dps)
        ]
        model = Model.builtin("default")
        richer = model.with_term(Term("bias_temperature", "z", {"k1_dps_per_c": 0.0}))
        poor, rich = (fit(make_session(*runs), m, axes="z").axes["z"] for m in (model, richer))
        statistic, chance = likelihood_ratio(poor, rich, 1)
        if stats.chi2.sf(statistic, 1) < 0.05:  # elsewhere there is no finding, and no F test
            line = stats.linregress(temp_c, [run.gyro_dps[:, 2].mean() for run in runs])
            assert 2 * line.pvalue < chance < 2.8 * line.pvalue
            compared += 1
    assert compared >= 2


@pytest.mark.parametrize(("kind", "seed", "effect_id"), [("clock", 52000, "clock_error"), ("lag_filter", 52001, "lag")])
def test_noise_does_not_explain_an_error_because_it_is_large(kind: str, seed: int, effect_id: str, tmp_path: Path) -> None:
    """What the poorer model of two power cycles takes for drift is ten thousand times the noise beside the true cause."""
    _module("field").write(kind, seed, tmp_path / "s")
    current = Current.of(measure(Session.open(tmp_path / "s"), ON_Z), "z")
    assert judge(current, effect(effect_id)).chance < 1e-12
