"""Noise whose level changes is noise: the floor holds all of it, and the error of the excess that of its loud stretches."""

from collections.abc import Callable

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.naming.candidates import candidates
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.recording.session import Array, Session
from known import ON_Y, ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")
RATE_HZ, WHITE_DPS = 100.0, 0.044
T_S = np.arange(3000) / RATE_HZ
Level = Callable[[np.random.Generator], Array]


def steps(rng: np.random.Generator) -> Array:
    """The level changes once, by a factor of up to three."""
    return np.where(rng.uniform(5, 25) < T_S, np.exp(rng.uniform(-1.1, 1.1)), 1.0)


def bursts(rng: np.random.Generator) -> Array:
    """In three stretches of up to two seconds it is three to eight times as loud."""
    level = np.ones(T_S.size)
    for _ in range(3):
        start = rng.integers(0, T_S.size)
        level[start : start + rng.integers(5, 200)] = rng.uniform(3, 8)
    return level


def session(level: Level, seed: int, error: Callable[[Array], Array] = np.zeros_like) -> Session:
    """Four power cycles, face up and down, with a further error of z over the time in the run."""
    rng, runs = np.random.default_rng(seed), []
    for cycle in range(4):
        offset = rng.normal(0, 0.005, 3)
        for face, sign in (("up", 1.0), ("down", -1.0)):
            gyro = 0.2 + offset + rng.normal(0, WHITE_DPS, (T_S.size, 3)) * level(rng)[:, None]
            gyro[:, 2] += 1.002 * 78.0 * sign + error(T_S)
            runs.append(make_run(T_S, gyro, face=face, scenario=f"s{cycle}", rate_hz=RATE_HZ))
    return make_session(*runs)


@pytest.mark.wide
@pytest.mark.parametrize(
    ("level", "seeds"), [(bursts, 2), *(pytest.param(level, 4, marks=pytest.mark.wide) for level in (steps, bursts))]
)
def test_the_floor_is_the_rms_where_the_level_of_the_noise_changes(level: Level, seeds: int) -> None:
    apart, sure = [], []
    for seed in range(seeds):
        found = compare(session(level, seed))
        for of_axis in found.per_axis.values():
            assert of_axis.rms_dps is not None
            assert of_axis.excess_dps is not None
            assert of_axis.excess_se_dps is not None
            assert of_axis.excess_dps <= 3.0 * of_axis.excess_se_dps * (1 + 1e-9)
            apart.append(of_axis.rms_dps / of_axis.floor_dps - 1)
        sure.append(found.verdict)
    assert abs(np.mean(apart)) < 0.01
    assert sure == ["adequate"] * seeds


@pytest.mark.wide
def test_a_slow_error_beside_noise_that_comes_and_goes_is_no_noise() -> None:
    """The floor takes the scatter within blocks and second differences of block means, in which it has no part."""
    planted = session(bursts, 3, lambda t_s: 0.05 * np.exp(-t_s / 6.0))
    excess = 0.05 * float(np.std(np.exp(-T_S / 6.0)))
    found = compare(planted, ON_Z)
    level = found.per_axis["z"]
    assert level.excess_dps is not None
    assert level.excess_se_dps is not None
    assert found.verdict == "misfit"
    assert level.excess_dps == pytest.approx(excess, abs=3 * level.excess_se_dps + 0.2 * excess)
    assert diagnose(planted, ON_Z).verdict != "adequate"


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.wide) for seed in (1, 2, 3))])
def test_noise_that_grows_with_the_rate_is_adequate_where_each_block_is_one_sample(seed: int) -> None:
    """Rests were taken for five times as noisy as they are, which made turns an excess of 40 to 90 errors on all axes."""
    rng, runs, t_s = np.random.default_rng([8, seed]), [], np.arange(317) / 10.0
    for cycle in range(4):
        offset = rng.normal(0, 0.008, 3)
        for k, rate_dps in enumerate((78.0, 78.0, -78.0, -78.0, 0.0, 0.0)):
            gyro = 0.2 + offset + rng.normal(0, np.hypot(0.009, 0.0024 * rate_dps), (t_s.size, 3))
            face, sign = (("up", 1), ("down", -1))[k % 2]
            gyro[:, 2] += 1.002 * rate_dps * sign
            runs.append(make_run(t_s, gyro, face=face, scenario=f"s{cycle}", rate_hz=10.0, table_rate_dps=rate_dps))
    found = compare(make_session(*runs))
    assert found.verdict == "adequate"
    for level in found.per_axis.values():
        assert level.rms_dps == pytest.approx(level.floor_dps, rel=0.03)


@pytest.mark.parametrize("seed", [3, 4])
def test_noise_that_grows_with_the_rate_is_in_the_errors_beside_turns_of_known_angle(seed: int) -> None:
    """The error of a misalignment was 1.8 times too small, and that of nothing was named: the means of turns show no level."""
    rng, runs, t_s = np.random.default_rng(seed), [], np.arange(1200) / 200.0
    for cycle in range(4):
        offset = rng.normal(0, 0.02, 3)
        for rate_dps in (0.0, -60.0, 0.0, 30.0, 0.0, -180.0, 0.0, 60.0, 0.0, -30.0, 180.0):
            gyro = offset + rng.normal(0, np.hypot(0.115, 0.00135 * rate_dps), (t_s.size, 3))
            gyro[:, 2] += rate_dps
            rest = {"table_rate_dps": 0.0}
            turn = {"turn_deg": rate_dps * 6.0, "turn_se_deg": 0.05, "table_rate_dps": None}
            runs.append(make_run(t_s, gyro, scenario=f"s{cycle}", rate_hz=200.0, **(turn if rate_dps else rest)))
    found = measure(make_session(*runs), ON_Y)
    (misalignment,) = (c for c in candidates(found, unless=0.0) if c.effect.id == "misalignment")
    rate = np.array([float(np.mean(r.rate_dps)) for r in runs])
    columns = np.column_stack([rate, *(np.repeat(np.eye(4), 11, axis=0).T)])
    sd = np.array([r.gyro_dps[:, 1].std() / len(r) ** 0.5 for r in runs])
    own_se = np.linalg.inv((columns / sd[:, None]).T @ (columns / sd[:, None]))[0, 0] ** 0.5
    assert misalignment.se["m"] == pytest.approx(own_se, rel=0.1)
