"""Standard errors with few power cycles: those of Student's t, because the cycles also have to show their own spread."""

import numpy as np
import pytest
from scipy.stats import t

from gyrocal.error_model.model import Model
from gyrocal.inference.blocks import by_sample
from gyrocal.inference.few_cycles import widening
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import AxisFit
from make_runs import make_run, make_session

NOISE_DPS, SAMPLES = 0.01, 200


def offsets(cycles: int, seed: int, spread_dps: float = 0.05, runs: int = 1) -> AxisFit:
    """Short runs at rest whose offsets differ from power cycle to power cycle, usually by far more than the noise of a run."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(SAMPLES) / 20.0
    made = [
        make_run(t_s, rng.normal(offset, NOISE_DPS, (t_s.size, 3)), table_rate_dps=0.0, scenario=f"s{k}")
        for k, offset in enumerate(rng.normal(0, spread_dps, cycles)) for _ in range(runs)
    ]  # fmt: skip
    return fit(make_session(*made), Model.open(None), axes="x").axes["x"]


@pytest.mark.parametrize("cycles", [3, 4, 6, 12])
def test_the_error_of_the_bias_is_that_of_students_t(cycles: int) -> None:
    assert widening(offsets(cycles, cycles))[-1] == pytest.approx(t.ppf(0.975, cycles - 1) / 1.96, rel=0.1)


def test_one_power_cycle_says_nothing_of_others() -> None:
    assert np.all(widening(offsets(1, 0, runs=4)) == 1.0)


def test_errors_of_four_power_cycles_cover_the_truth() -> None:
    """A spread that is fitted too small, or as zero, leaves no estimate many errors off."""
    z = []
    for seed in range(40):
        (bias,) = (term for term in offsets(4, seed).terms if term.effect_id == "bias")
        z.append(bias.values["bias_dps"] / bias.se["bias_dps"])
    assert np.mean(np.abs(z) < 1.96) > 0.85
    assert np.std(z) < 1.2


@pytest.mark.parametrize("seeds", [60, pytest.param(120, marks=pytest.mark.wide)])
@pytest.mark.parametrize("ratio", [0, 2])
def test_errors_are_honest_whether_cycles_agree_or_not(ratio: float, seeds: int) -> None:
    """Four cycles whose offsets are equal, or differ by twice the error with which one of them shows its own.

    There it is hardest to tell cycles that agree from cycles that do not.
    """
    z = []
    for seed in range(1000, 1000 + seeds):
        (bias,) = (term for term in offsets(4, seed, ratio * NOISE_DPS / SAMPLES**0.5).terms if term.effect_id == "bias")
        z.append(bias.values["bias_dps"] / bias.se["bias_dps"])
    assert 0.75 < np.std(z) < 1.2
    assert np.mean(np.abs(z) < 1.96) > 0.9


def test_a_turn_beside_turns_about_other_axes_shows_the_scale_of_a_power_cycle_in_blocks_and_in_samples() -> None:
    """What the model varies from power cycle to power cycle does not hang on how finely the readings are summed."""
    rng = np.random.default_rng(3)
    t_s = np.arange(2000) / 100.0
    runs = [
        make_run(t_s, np.outer(np.ones(t_s.size), 78.0 * np.eye(3)[axis]) + rng.normal(0, 0.1, (t_s.size, 3)),
                 table_rate_dps=78.0, axis="xyz"[axis], scenario=f"s{cycle}")
        for cycle in range(2) for axis in (0, 2)
    ]  # fmt: skip
    of_blocks = fit(make_session(*runs), Model.open(None), axes="z").axes["z"].design
    of_samples = of_blocks.over(by_sample(of_blocks.given))
    assert of_samples.layout == of_blocks.layout
    assert len(of_samples.layout.scenario) == 2
