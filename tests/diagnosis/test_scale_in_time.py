"""A scale that changes in time is neither a table that spins up nor a bias that settles or jumps."""

from collections.abc import Callable

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import Diagnosis, diagnose
from gyrocal.diagnosis.answer.explain import explain
from gyrocal.effects.base import effect
from gyrocal.effects.bias_jumps import follow_the_rate
from gyrocal.recording.session import Array, Session
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("known_answers", "tests_alone")]
HZ = 25.0
Error = Callable[[Array, Array, float], Array]
"""Error [n], deg/s, over the time in the run, that since power-on, and the rate."""


def stated(
    error: Error, seed: int, rates: tuple[float, ...] = (-90.0, -45.0, 0.0, 45.0, 90.0), seconds: float = 30.0, cycles: int = 4
) -> Session:
    """Power cycles of runs at stated rates, in another order in each, with pauses of 15 s."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(seconds * HZ)) / HZ
    runs = []
    for cycle in range(cycles):
        offset = rng.normal(0, 0.02, 3)
        for k, rate in enumerate(rng.permutation(rates).tolist()):
            p_s = 4.0 + (seconds + 15.0) * k
            gyro = rng.normal(offset, 0.02, (t_s.size, 3))
            gyro[:, 2] += 1.004 * rate + error(t_s, p_s + t_s, rate)
            runs.append(make_run(t_s, gyro, table_rate_dps=rate, scenario=f"s{cycle}", power_on_s=p_s, rate_hz=HZ))
    return make_session(*runs)


OF_ANOTHER_CAUSE = {
    "bias_jumps", "bias_temperature", "byte_fault", "centripetal", "clock_error", "dead_band", "drift", "g2_sensitivity",
    "g_sensitivity", "lag", "misalignment", "order_tone", "quantization", "sampling_fault", "saturation", "scale_asymmetry",
    "scale_nonlinearity", "scale_temperature", "spin_up", "table_ripple", "thermal_hysteresis", "thermal_lag",
    "vibration_tone", "warmup",
}  # fmt: skip
"""What an error of the scale in time must not be called; an effect that is one may be."""


def named(found: Diagnosis) -> list[str]:
    return [c.effect.id for c in found.candidates if c.decision == "add"]


def misnamed(found: Diagnosis) -> set[str]:
    return OF_ANOTHER_CAUSE & set(named(found))


@pytest.mark.wide
def test_a_scale_that_creeps_under_a_measured_rate_is_no_spin_up() -> None:
    """The reference holds the table's own transient. It was named with a time constant at its bound."""
    rng = np.random.default_rng(41)
    t_s = np.arange(round(60 * HZ)) / HZ
    runs = []
    for cycle in range(4):
        rate = sum(30 * np.sin(2 * np.pi * f * t_s + rng.uniform(0, 6)) for f in (0.07, 0.19, 0.43))
        gyro = rng.normal(rng.normal(0, 0.02, 3), 0.02, (t_s.size, 3))
        gyro[:, 2] += (1.004 + 0.003 * t_s / 60) * rate
        runs.append(make_run(t_s, gyro, scenario=f"s{cycle}", rate_hz=HZ, rate_ref_dps=rate))
    session = make_session(*runs)
    assert "rate_ref_dps" in (effect("spin_up").missing(session.runs, 2) or "")
    found = diagnose(session, ON_Z)
    assert not misnamed(found)
    first = found.comparison.where[0]
    assert (first.axis, first.against) == ("z", "time")
    assert "of the rate" in first.note


@pytest.mark.wide
def test_a_scale_that_settles_after_power_on_is_neither_spin_up_nor_warmup() -> None:
    """A table spins up in each run, and a bias that settles does so at rest too."""
    session = stated(lambda t, p, w: 2e-3 * w * np.exp(-p / 100.0), 43)
    ended = explain(session, ON_Z)
    assert not misnamed(ended.first)
    assert ended.first.comparison.verdict == "misfit"
    assert not OF_ANOTHER_CAUSE & {i for step in ended.steps for i in step.effects}


def test_a_transient_that_outlasts_the_runs_is_no_spin_up() -> None:
    """Such a run does not show that there is a rate at which the table arrives."""
    found = diagnose(stated(lambda t, p, w: 0.002 * w * t / 30, 45, rates=(-90.0, 90.0)), ON_Z)
    assert not misnamed(found)
    assert found.comparison.verdict == "misfit"


@pytest.mark.parametrize(("tau_s", "seconds"), [pytest.param(2.0, 30.0, marks=pytest.mark.wide), (6.0, 10.0)])
def test_a_table_that_spins_up_keeps_its_name(tau_s: float, seconds: float) -> None:
    found = diagnose(stated(lambda t, p, w: -0.006 * w * np.exp(-t / tau_s), 46, (-78.0, 78.0), seconds, cycles=6), ON_Z)
    assert (found.verdict, named(found)) == ("add", ["spin_up"])
    assert found.best is not None
    assert found.best.values["tau_s"] == pytest.approx(tau_s, rel=0.1)


@pytest.mark.wide
def test_a_bias_that_settles_keeps_its_name_beside_rests() -> None:
    found = diagnose(stated(lambda t, p, w: 0.15 * np.exp(-p / 25.0), 47), ON_Z)
    assert (found.verdict, named(found)) == ("add", ["warmup"])


def chamber(seed: int, rates: tuple[float, ...], *, bias: float, table: float = 0.0) -> Session:
    """Power cycles at five temperatures, in each of whose runs the part warms by 3 degC, and a table that may spin up."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(30 * HZ)) / HZ
    runs = []
    for cycle in range(5):
        offset = rng.normal(0, 0.02, 3)
        for rate in rates:
            temp_c = 9.0 + 8.0 * cycle + 3.0 * (1 - np.exp(-t_s / 10.0))
            gyro = rng.normal(offset, 0.02, (t_s.size, 3))
            gyro[:, 2] += 1.004 * rate + (temp_c - 25.0) * (3e-4 * rate + bias) - table * rate * np.exp(-t_s / 2.0)
            seen_c = temp_c + rng.normal(0, 0.02, t_s.size)
            runs.append(make_run(t_s, gyro, table_rate_dps=rate, scenario=f"s{cycle}", rate_hz=HZ, temp_c=seen_c))
    return make_session(*runs)


@pytest.mark.wide
def test_what_follows_the_measured_temperature_is_no_spin_up() -> None:
    """The sizes of a spin-up, which are free in each run, took up the bias too, and the scale over temperature was lost."""
    ended = explain(chamber(51, (-80.0, 80.0), bias=0.01), ON_Z)
    assert "spin_up" not in named(ended.first)
    assert ended.verdict == "adequate"
    assert {"scale_temperature", "bias_temperature"} <= set(ended.model.ids)
    assert "spin_up" not in ended.model.ids
    term = ended.model.term("scale_temperature", "z")
    assert term is not None
    assert term.values["k_per_c"] == pytest.approx(3e-4, rel=0.02)


@pytest.mark.wide
def test_a_table_that_spins_up_is_named_beside_the_temperature() -> None:
    ended = explain(chamber(53, (-80.0, 80.0), bias=0.0, table=0.006), ON_Z)
    assert {"scale_temperature", "spin_up"} <= set(ended.model.ids)


@pytest.mark.wide
@pytest.mark.parametrize(
    ("rates", "seed"), [pytest.param((-78.0, 78.0), 61, marks=pytest.mark.wide), ((-120.0, -60.0, 0.0, 60.0, 120.0), 62)]
)
def test_a_step_of_the_scale_is_no_jump_of_the_bias(rates: tuple[float, ...], seed: int) -> None:
    """Half as large at half the rate, none at rest, of the other sign in the other direction."""
    session = stated(lambda t, p, w: -0.0015 * w * (t > 17), seed, rates)
    found = diagnose(session, ON_Z)
    assert not misnamed(found)
    assert found.comparison.where[0].axis == "z"


@pytest.mark.parametrize("rates", [(-78.0, 78.0), (-120.0, -60.0, 0.0, 60.0, 120.0)])
def test_jumps_of_the_bias_do_not_follow_the_rate(rates: tuple[float, ...]) -> None:
    """Of either sign at random, of one sign, and in a single run."""
    rng = np.random.default_rng(63)
    for session in (
        stated(lambda t, p, w: 0.15 * rng.choice((-1.0, 1.0)) * (t > rng.uniform(8, 22)), 64, rates),
        stated(lambda t, p, w: 0.15 * (t > 17), 65, rates),
        stated(lambda t, p, w: 0.15 * (t > 17) * (p[0] < 10) * (rng.random() < 0.5), 66, rates),
    ):
        assert not follow_the_rate(session.runs, 2)


def test_jumps_of_the_bias_keep_their_name() -> None:
    rng = np.random.default_rng(67)
    found = diagnose(stated(lambda t, p, w: 0.15 * rng.choice((-1.0, 1.0)) * (t > rng.uniform(8, 22)), 68), ON_Z)
    assert (found.verdict, named(found)) == ("add", ["bias_jumps"])
