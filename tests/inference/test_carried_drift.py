"""The error of a slow effect where the bias goes on from run to run of a power cycle, and where it begins anew in each."""

from dataclasses import replace

import numpy as np
import pytest

from gyrocal.error_model.model import Model, Term
from gyrocal.inference.carried_drift import carried_factor
from gyrocal.inference.fit import fit
from gyrocal.inference.standard_errors import finish
from gyrocal.noise.drift import ou_noise
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

RATE_HZ, RUN_S, PAUSE_S = 20.0, 10.0, 5.0
K_DPS_PER_C = -0.02
MODEL = Model.builtin("default").with_term(Term("bias_temperature", "z", {}))


def session(seed: int, goes_on: bool, sd_dps: float = 0.01, white_dps: float = 0.03) -> Session:
    """Four power cycles of ten runs, at rates of either sign, in which the sensor warms up."""
    rng, runs, t_s = np.random.default_rng(seed), [], np.arange(RUN_S * RATE_HZ) / RATE_HZ
    every = round((RUN_S + PAUSE_S) * RATE_HZ)
    for cycle in range(4):
        since_s = 3.0 + every / RATE_HZ * np.arange(10)[:, None] + t_s
        whole = ou_noise(10 * every, 1 / RATE_HZ, sd_dps, 120.0, 1, rng).reshape(10, every)[:, : t_s.size]
        drift = whole if goes_on else ou_noise(t_s.size, 1 / RATE_HZ, sd_dps, 120.0, 10, rng).T
        offset_dps = rng.normal(0.4, 0.05)
        for at_s, own, rate in zip(since_s, drift, np.resize([60.0, 0.0, -80.0], 10), strict=True):
            temp_c = 22.0 + 6.0 * (1 - np.exp(-at_s / 150.0))
            z = 1.01 * rate + offset_dps + K_DPS_PER_C * (temp_c - 25.0) + own + rng.normal(0, white_dps, t_s.size)
            gyro = np.column_stack([np.zeros((t_s.size, 2)), z])
            runs.append(make_run(
                t_s, gyro, table_rate_dps=float(rate), scenario=f"s{cycle:03d}", power_on_s=float(at_s[0]), temp_c=temp_c,
                rate_hz=RATE_HZ,
            ))  # fmt: skip
    return make_session(*runs)


@pytest.mark.wide
@pytest.mark.slow
@pytest.mark.parametrize(("goes_on", "seeds"), [(True, 16), pytest.param(True, 40, marks=pytest.mark.wide), (False, 40)])
def test_the_error_of_a_slow_effect_is_its_scatter(goes_on: bool, seeds: int) -> None:
    """It was half of it where the bias goes on."""
    ratios = []
    for seed in range(seeds):
        term = fit(session(seed, goes_on), MODEL, axes="z").axes["z"].terms[-1]
        ratios.append((term.values["k1_dps_per_c"] - K_DPS_PER_C) / term.se["k1_dps_per_c"])
    assert 0.7 < float(np.sqrt(np.mean(np.square(ratios)))) < 1.7


def test_where_the_bias_goes_on_its_slow_effects_are_known_less_well() -> None:
    axis = fit(session(1, True), MODEL, axes="z").axes["z"]
    ids = [axis.terms[t].effect_id for t, _ in axis.design.layout.fixed]
    factor = dict(zip(ids, carried_factor(axis), strict=True))
    assert factor["bias_temperature"] > 1.3
    assert factor["scale"] == pytest.approx(1.0, abs=0.1)
    unreported = finish(axis).terms[-1].se
    assert axis.terms[-1].se["k1_dps_per_c"] > 1.3 * unreported["k1_dps_per_c"]


def test_times_that_tell_no_order_say_nothing_of_a_drift_that_goes_on() -> None:
    runs = [replace(run, power_on_s=3.0) for run in session(1, True).runs]
    axis = fit(make_session(*runs), MODEL, axes="z").axes["z"]
    assert carried_factor(axis) == pytest.approx(1.0, abs=0.4)


def test_white_noise_adds_nothing() -> None:
    assert carried_factor(fit(session(1, True, sd_dps=0.0), MODEL, axes="z").axes["z"]) == pytest.approx(1.0, abs=0.1)
