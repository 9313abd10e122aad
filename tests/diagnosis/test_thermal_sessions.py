"""Temperature regressors: noisy thermometers, hot chambers, and runs without a thermometer."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.effects.base import effect
from gyrocal.effects.thermal_hysteresis import play_c
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.noise.drift import ou_noise
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.slow
RATE_HZ = 100.0
SECONDS = 60.0
K1 = 0.015


def one_way(p_s, t_s, cycle, face, mean_c):
    """The part warms by 3 degC from power-on, in the same way in each power cycle."""
    return mean_c - 1.5 + 3 * p_s / (2 * SECONDS + 15)


def chamber(p_s, t_s, cycle, face, mean_c, half_range_c=1.5):
    """The chamber goes up and down, and is elsewhere in each run."""
    return mean_c + half_range_c * np.sin(2 * np.pi * (cycle / 4 + face / 8 + t_s / SECONDS / 8) + 0.3)


def thermal(seed, climate, mean_c=25.0, k1=K1, noise_c=0.03, count_c=0.0, held=1, lacking=()):
    """Four power cycles, each face up and face down at 78 deg/s; ``held`` samples have the same reading of the thermometer."""
    rng = np.random.default_rng(seed)
    made = []
    n = round(SECONDS * RATE_HZ)
    t_s = np.arange(n) / RATE_HZ
    for i in range(8):
        cycle, down = divmod(i, 2)
        if not down:
            turn_on = rng.normal(0, 0.005, 3)
        p_s = 5.0 + t_s + down * (SECONDS + 10)
        temp_c = climate(p_s, t_s, cycle, down, mean_c)
        gyro = rng.normal(0, 0.044, (n, 3)) + ou_noise(n, 1 / RATE_HZ, 0.002, 30.0, 3, rng) - 0.05 + turn_on
        gyro[:, 2] += 1.004 * (-78.0 if down else 78.0) + k1 * (temp_c - 25)
        read_c = np.repeat((temp_c + rng.normal(0, noise_c, n))[::held], held)[:n]
        if count_c:
            read_c = np.round(read_c / count_c) * count_c
        column = {} if i in lacking else {"temp_c": read_c}
        made.append(make_run(
            t_s, gyro, face="down" if down else "up", scenario=f"s{cycle}", power_on_s=float(p_s[0]), rate_hz=RATE_HZ, **column
        ))  # fmt: skip
    return make_session(*made)


def with_temperature():
    return Model.open("default").add("bias_temperature", "z")


def candidate(found, effect_id):
    return next(c for c in found.candidates if c.effect.id == effect_id and c.axis == "z")


@pytest.mark.wide
@pytest.mark.parametrize(
    ("noise_c", "count_c", "held"),
    [(0.03, 0.125, 100), *(pytest.param(*of, marks=pytest.mark.wide) for of in ((0.03, 0.0, 1), (0.1, 0.0, 10)))],
)
def test_a_one_way_ramp_stays_ambiguous_with_a_noisy_thermometer(noise_c, count_c, held):
    found = diagnose(thermal(1, one_way, noise_c=noise_c, count_c=count_c, held=held), ON_Z)
    assert found.verdict == "ambiguous"
    assert set(found.best.group) == {"drift", "bias_temperature"}
    temperature = candidate(found, "bias_temperature")
    assert abs(temperature.values["k1_dps_per_c"] - K1) < 3 * temperature.se["k1_dps_per_c"]


@pytest.mark.wide
@pytest.mark.parametrize("mean_c", [70.0, pytest.param(-20.0, marks=pytest.mark.wide)])
def test_a_chamber_at_any_temperature_shows_the_same(mean_c):
    found = diagnose(thermal(0, chamber, mean_c), ON_Z)
    assert found.verdict == "add"
    assert found.best.effect.id == "bias_temperature"
    assert abs(found.best.values["k1_dps_per_c"] - K1) < 3 * found.best.se["k1_dps_per_c"]


def swinging(p_s, t_s, cycle, face, mean_c):
    """The chamber goes up and down by 3 degC within each run."""
    return mean_c + 1.5 * np.sin(2 * np.pi * (cycle / 4 + face / 8 + t_s / 40))


@pytest.mark.wide
@pytest.mark.parametrize("seed", [0, pytest.param(5, marks=pytest.mark.wide)])
def test_a_hysteresis_wider_than_the_way_back_of_the_temperature_is_no_rival_of_a_line_over_temperature(seed):
    """Its play operator hardly moves, and bias_temperature and thermal_hysteresis were named as a group."""
    found = diagnose(thermal(seed, swinging, 45.0), ON_Z)
    assert found.verdict == "add"
    assert found.best.group == ("bias_temperature",)
    assert candidate(found, "thermal_hysteresis").decision != "add"
    assert candidate(found, "thermal_hysteresis").log_odds < 0


@pytest.mark.wide
def test_a_hysteresis_is_named_where_the_way_back_is_shorter_than_its_width():
    """One branch and the way between them show it. A line over temperature was named with certainty, for want of the other."""
    rng, t_s, made = np.random.default_rng(2), np.arange(3000) / 25.0, []
    for cycle in range(4):
        offset = rng.normal(0, 0.005, 3)
        # up by 6 degC, and back by 4
        course_c = np.concatenate([22 + 6 * t_s / t_s[-1], 28 - 4 * t_s / t_s[-1]]) + rng.normal(0, 1)
        loop = np.split(0.05 * (course_c - play_c(course_c, 2.5, start=1.0)) / 2.5, 2)
        for face, part, temp_c in zip(("up", "down"), loop, np.split(course_c, 2), strict=True):
            gyro = rng.normal(0, 0.044, (t_s.size, 3)) + offset
            gyro[:, 2] += part + (78.0 if face == "up" else -78.0)
            made.append(make_run(
                t_s, gyro, face=face, scenario=f"s{cycle}", power_on_s=5.0 + 125.0 * (face == "down"),
                temp_c=temp_c + rng.normal(0, 0.02, t_s.size),
            ))  # fmt: skip
    found = diagnose(make_session(*made), ON_Z)
    assert found.verdict == "add"
    assert found.best.group == ("thermal_hysteresis",)
    assert abs(found.best.values["width_c"] - 5.0) < 4 * found.best.se["width_c"]
    assert not candidate(found, "bias_temperature").named


@pytest.mark.wide
def test_a_one_way_ramp_in_a_hot_chamber_is_ambiguous():
    found = diagnose(thermal(0, one_way, 70.0), ON_Z)
    assert found.verdict == "ambiguous"
    assert set(found.best.group) == {"drift", "bias_temperature"}


def test_the_bias_of_a_hot_session_is_stated_at_25_degrees_with_its_error():
    z = []
    for seed in range(6):
        fitted = fit(thermal(seed, partial(chamber, half_range_c=8.0), 55.0), with_temperature(), axes="z").model
        line = next(line for line in fitted.lines() if line.axis == "z" and line.id == "bias")
        (name,) = line.values
        assert line.se[name] > 0.003  # 30 degC away, it is an extrapolation
        z.append((line.values[name] + 0.05) / line.se[name])
    assert np.sqrt(np.mean(np.square(z))) < 2


@pytest.mark.wide
@pytest.mark.parametrize("lacking", [pytest.param((2, 5), marks=pytest.mark.wide), (0, 1, 7)])
def test_runs_without_a_thermometer_leave_the_effect_to_the_others(lacking):
    found = diagnose(thermal(3, chamber, 45.0, k1=0.03, lacking=lacking), ON_Z)
    assert found.best.effect.id == "bias_temperature"
    assert abs(found.best.values["k1_dps_per_c"] - 0.03) < 3 * found.best.se["k1_dps_per_c"]


def test_a_one_way_ramp_without_some_thermometers_is_ambiguous():
    assert set(diagnose(thermal(0, one_way, 45.0, lacking=(2, 3)), ON_Z).best.group) == {"drift", "bias_temperature"}


def test_a_model_with_temperature_gives_runs_without_it_a_bias_of_their_own():
    """A run without a thermometer may have been 30 degC hotter: its bias says nothing about the coefficient."""
    session = thermal(4, chamber, 45.0, k1=0.03, lacking=(3,))
    found = []
    for offset_dps in (0.0, 0.9):
        runs = list(session.runs)
        moved = runs[3].table.with_columns(runs[3].table["gz_dps"] + offset_dps)
        runs[3] = replace(runs[3], frame=moved)
        fitted = fit(make_session(*runs), with_temperature(), axes="z").model
        found.append(next(line for line in fitted.lines() if line.axis == "z" and line.id == "bias_temperature"))
    cool, hot = found
    assert abs(cool.values["k1_dps_per_c"] - 0.03) < 3 * cool.se["k1_dps_per_c"]
    assert hot.values["k1_dps_per_c"] == pytest.approx(cool.values["k1_dps_per_c"], abs=0.2 * cool.se["k1_dps_per_c"])


@pytest.mark.wide
@pytest.mark.parametrize(("seed", "lacking"), [pytest.param(0, (), marks=pytest.mark.wide), (1, (2, 3))])
def test_without_an_effect_none_is_named(seed, lacking):
    for climate, mean_c in ((one_way, 45.0), (chamber, 25.0)):
        assert diagnose(thermal(seed, climate, mean_c, k1=0.0, lacking=lacking), ON_Z).verdict == "adequate"


def ramps(start, seconds=120.0, rate_hz=25.0):
    """A rest in each of six power cycles, in which the chamber warms or cools by 12 degC."""
    rng = np.random.default_rng(5)
    t_s = np.arange(round(seconds * rate_hz)) / rate_hz
    made = []
    for i in range(6):
        temp_c = 25.0 + rng.normal(0, 1.0) + (1 if i % 2 == 0 else -1) * 12.0 * (t_s / seconds - 0.5)
        y = rng.normal(0.4, 0.05, (t_s.size, 3)) + rng.normal(0, 0.03, 3)
        y[:, 2] += 0.05 * (temp_c - play_c(temp_c, 2.5, start)) / 2.5
        made.append(make_run(
            t_s, np.rint(y / 0.00875) * 0.00875, table_rate_dps=0.0, scenario=f"s{i}", day=1 + i // 2, power_on_s=3.0 + i,
            lsb_dps=0.00875, temp_c=temp_c,
        ))  # fmt: skip
    return make_session(*made, lsb_dps=0.00875)


@pytest.mark.parametrize("start", [-0.6, *(pytest.param(start, marks=pytest.mark.wide) for start in (0.0, 0.6))])
def test_ramps_up_and_down_show_a_hysteresis_though_no_power_cycle_turns(start):
    """It was not measurable, and jumps of the bias or a warm-up were named in its place. ``start``: where the part begins."""
    found = diagnose(ramps(start), ON_Z)
    named = [c for c in found.candidates if c.decision == "add"]
    assert [c.effect.id for c in named] == ["thermal_hysteresis"]
    assert named[0].values["amplitude_dps"] == pytest.approx(0.05, rel=0.3)


def test_ramps_in_one_direction_show_no_hysteresis():
    session = ramps(0.0)
    cooling = [run for run in session.runs if run.index % 2]
    assert effect("thermal_hysteresis").missing(cooling, 2) is not None
    assert effect("thermal_hysteresis").missing(session.runs, 2) is None
