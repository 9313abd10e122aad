"""Sessions of few power cycles: what differs from cycle to cycle alone is evidence of as many values as there are cycles."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import Diagnosis, diagnose
from gyrocal.error_model.model import Model
from gyrocal.inference import heldout
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Session
from known import ON_X, ON_Z, add_measured
from make_runs import make_run, make_session

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("known_answers", "tests_alone")]
RATE_HZ, WHITE_DPS, TURN_ON_DPS = 52.0, 0.04, 0.02
Extra = Callable[[np.ndarray, np.ndarray], np.ndarray]


def nothing(rate_dps: np.ndarray, temp_c: np.ndarray) -> np.ndarray:
    return np.zeros((rate_dps.size, 3))


def pairs(seed: int, cycles: int, extra: Extra = nothing, rates_dps: tuple[float, ...] = (78.0,)) -> Session:
    """Up and down in each power cycle, which has an offset and a temperature (15 to 35 degC) of its own."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(20 * RATE_HZ)) / RATE_HZ
    runs = []
    for cycle in range(cycles):
        offset, start_c = rng.normal(0.1, TURN_ON_DPS, 3), rng.uniform(15, 35)
        for face, sign in (("up", 1.0), ("down", -1.0)):
            table_dps = rates_dps[cycle % len(rates_dps)]
            rate, temp_c = np.full(t_s.size, sign * table_dps), start_c + 0.5 * (1 - np.exp(-t_s / 30))
            gyro = rng.normal(offset, WHITE_DPS, (t_s.size, 3)) + extra(rate, temp_c)
            gyro[:, 2] += 1.004 * rate
            noisy_c = np.round((temp_c + rng.normal(0, 0.02, t_s.size)) * 256) / 256
            runs.append(
                make_run(
                    t_s, gyro, table_rate_dps=table_dps, face=face, scenario=f"s{cycle}", day=1, rate_hz=RATE_HZ,
                    temp_c=noisy_c,
                )
            )  # fmt: skip
    return make_session(*runs)


def named(found: Diagnosis) -> list[tuple[str, str]]:
    return [(c.effect.id, c.axis) for c in found.candidates if c.decision == "add"]


@pytest.mark.wide
@pytest.mark.parametrize("cycles", [3, *(pytest.param(cycles, marks=pytest.mark.wide) for cycles in (4, 5))])
def test_offsets_that_happen_to_lie_along_the_temperature_are_no_effect(cycles: int, library: dict[str, Any]) -> None:
    """Chi-square for the likelihood ratio takes them for bias_temperature, and often.

    The whole library is tried once. In the other sessions it has no effects but those of the temperature, which are fewer
    tests, so that the alarm of each is easier.
    """
    for seed in range(8):
        found = diagnose(pairs(seed, cycles))
        for other in [i for i, kind in library.items() if kind.role is None and "temperature" not in i]:
            del library[other]
        assert found.verdict == "adequate", (seed, named(found), found.unknown)


def of_temperature(rate_dps: np.ndarray, temp_c: np.ndarray) -> np.ndarray:
    return np.outer(0.02 * (temp_c - 25), [0.0, 0.0, 1.0])


def test_an_effect_that_many_cycles_show_is_found_and_has_no_more_orders_than_they_support() -> None:
    session = pairs(1, 12, of_temperature)
    found = diagnose(session, ON_Z)
    assert named(found)[:1] == [("bias_temperature", "z")]
    best = found.candidates[0]
    assert set(best.values) == {"k1_dps_per_c"}
    assert abs(best.values["k1_dps_per_c"] - 0.02) < 4 * best.se["k1_dps_per_c"]
    before, after, _ = add_measured(session, ON_Z, "bias_temperature")
    assert after.per_axis["z"].excess_dps < 0.3 * before.per_axis["z"].excess_dps


def pulled(rate_dps: np.ndarray, temp_c: np.ndarray) -> np.ndarray:
    return np.outer(8e-6 * rate_dps**2, [1.0, 0.0, 0.0])


def test_the_table_s_rate_is_held_against_the_other_axes_too() -> None:
    session = pairs(2, 16, pulled, rates_dps=(0.0, 50.0, 100.0, 150.0))
    found = diagnose(session, ON_X)
    assert "rate" in {f.against for f in found.comparison.where}
    assert found.best is not None
    assert found.best.effect.id == "centripetal"
    assert abs(found.best.values["k"] - 8e-6) < 4 * found.best.se["k"]


def test_cycles_that_happen_to_agree_do_not_foretell_the_next() -> None:
    """By the spread of the three that agree, the fourth is some hundred of its errors away, and a chance of exp(-5000)."""
    rng, t_s = np.random.default_rng(3), np.arange(round(20 * RATE_HZ)) / RATE_HZ
    apart = np.array([0.0, 0.0, 0.0, 0.1])
    runs = [
        make_run(t_s, rng.normal(offset, WHITE_DPS, (t_s.size, 3)), face=face, scenario=f"s{i}", rate_hz=RATE_HZ)
        for i, offset in enumerate(apart) for face in ("up", "down")
    ]  # fmt: skip
    fitted = fit(make_session(*runs), Model.builtin("default"), axes=["x"])
    all_steps = list(heldout.steps(fitted.axes["x"], heldout.folds(fitted)))
    gains = {cycle: gain for step in all_steps for cycle, gain in step.gain.items()}
    assert sorted(gains) == ["s0", "s1", "s2", "s3"]
    # by the spread of all four it is less than two errors away; the rest is the scatter of the white noise
    assert gains["s3"] > min(gains[f"s{i}"] for i in range(3)) - 25
