"""Errors beside a misfit: they contain how much the values depend on which part of the data there is."""

import numpy as np
import pytest
from scipy.stats import kstest

from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.error_model.model import Model
from gyrocal.inference.contradictions import _Refit, misfit_factor
from gyrocal.inference.fit import beside_misfit, fit
from gyrocal.inference.fitted import AxisFit
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from make_runs import make_run, make_session

SCALE, BIAS_DPS = 0.004, -0.05
SPIN_UP = ("spin_up", {"A": 0.01, "tau_s": 2.0})
WARMUP = ("warmup", {"A_dps": 0.1, "tau_s": 20.0})
CUBIC = ("scale_nonlinearity", {"k3": 3e-7})
RIPPLE = ("table_ripple", {"amplitude_1": 0.01})
LAG = ("lag", {"tau_s": 0.02})


def recorded(planted: list, campaign: str, cycles: int, seconds: float, seed: int) -> Session:
    every = [("scale", {"scale": SCALE}), ("bias", {"bias_dps": BIAS_DPS}), *planted]
    return simulate(None, campaign, every, seed, scenarios=cycles, seconds=seconds, turn_on_sd_dps=0.005)[0]


def plain(session: Session) -> AxisFit:
    return fit(session, Model.builtin("default"), axes=["z"]).axes["z"]


@pytest.mark.parametrize(
    ("planted", "campaign", "cycles", "seconds", "before", "after"),
    [
        (SPIN_UP, "paper", 6, 30.0, 3.0, 2.0), (SPIN_UP, "full", 1, 20.0, 2.5, 2.0), (CUBIC, "full", 1, 20.0, 7.0, 2.0),
        (LAG, "swing", 2, 15.0, 3.5, 2.0), (WARMUP, "paper", 6, 30.0, 3.0, 2.5),
    ],
)  # fmt: skip
def test_an_effect_that_the_model_lacks_is_in_the_error_of_the_scale(
    planted: tuple, campaign: str, cycles: int, seconds: float, before: float, after: float
) -> None:
    """The warm-up goes on after the runs, so that no part of them shows all of it."""
    off = []
    for seed in range(4):
        fitted = fit(recorded([planted], campaign, cycles, seconds, 7100 + seed), Model.builtin("default"), axes=["z"])
        lines = [f.model.line("scale", "z") for f in (fitted, beside_misfit(fitted, ["z"]))]
        off.append([(line.values["scale"] - SCALE) / line.se["scale"] for line in lines])
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    assert rms[0] > before
    assert rms[1] < after


def test_compare_states_the_wider_error_where_its_tests_find_a_misfit() -> None:
    session = recorded([SPIN_UP], "full", 1, 20.0, 7100)
    found = measure(session, Model.builtin("default"))
    lines = [f.model.line("scale", "z") for f in (fit(session, Model.builtin("default")), found.fit)]
    errors, off = [line.se["scale"] for line in lines], [abs(line.values["scale"] - SCALE) for line in lines]
    assert "z" in {f.axis for f in found.where}
    assert errors[1] > 2 * errors[0]
    assert off[1] < 2 * errors[1]
    assert off[1] < off[0] / 3  # a drift of the spin-up's size weighs the first seconds of each run


def test_where_the_model_fits_the_parts_differ_as_noise_says() -> None:
    """The change of a value without a part, over its standard deviation, is standard normal (Hausman's identity)."""
    z = []
    for seed in range(40):
        rng, t_s = np.random.default_rng(seed), np.arange(600) / 20.0
        rates = (-60.0, -20.0, 20.0, 60.0)
        runs = [make_run(t_s, rng.normal(rate, 0.05, (t_s.size, 3)) * [0, 0, 1], table_rate_dps=rate) for rate in rates]
        current = plain(make_session(*runs, axis="z"))
        labels = [np.full(b.t_s.size, i) for i, b in enumerate(current.design.blocks)]
        moved, increase = _Refit(current).without_each(labels)
        z.append(moved[0] / np.sqrt(increase[0]))
        assert misfit_factor(current) == pytest.approx(1.0), seed
    assert kstest(np.ravel(z), "norm").pvalue > 0.01


def test_leaving_out_a_run_is_the_session_without_it() -> None:
    session = recorded([RIPPLE], "full", 1, 12.0, 5)
    current = plain(session)
    labels = [np.full(b.t_s.size, int(i == 2)) for i, b in enumerate(current.design.blocks)]
    moved, _ = _Refit(current).without_each(labels)
    others = current.subset(np.arange(len(labels)) != 2)
    assert moved[1] == pytest.approx(others.beta - current.solution.beta, rel=1e-3, abs=1e-7)
