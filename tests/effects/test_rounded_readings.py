"""Readings that were rounded to steps coarser than a count: the step is found, whatever its ratio to the count is."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.effects.base import effect
from gyrocal.effects.byte_fault import lost_carry
from gyrocal.effects.quantization import coarse_step_dps
from gyrocal.effects.single_bits import single_power
from gyrocal.recording.session import Run
from known import ON_Z
from make_runs import make_run as bare_run
from make_runs import make_session

from .conftest import Array, MakeRun

pytestmark = pytest.mark.usefixtures("tests_alone")

LSB_DPS = 0.00875
FAULTS = ("byte_fault", "sampling_fault", "saturation", "bias_jumps")


def runs_of(make_run: MakeRun, step_dps: float, sd_dps: float, samples: int = 3000) -> list[Run]:
    """A rest, a swing and two constant rates. The chip's own codes are rounded again, as by a log with few decimals."""
    rng = np.random.default_rng(1)
    swing: Array = 60 * np.sin(2 * np.pi * 0.1 * np.arange(samples) / 100)
    runs = []
    for w_dps in (np.zeros(samples), swing, np.full(samples, 78.0), np.full(samples, -78.0)):
        y = np.outer(w_dps, [0, 0, 1]) + np.array([0.3, -2.41, 5.03]) + rng.normal(0, sd_dps, (samples, 3))
        codes = np.rint(y / LSB_DPS) * LSB_DPS
        runs.append(make_run(np.arange(samples) / 100, np.rint(codes / step_dps) * step_dps, rate_ref_dps=w_dps))
    return runs


@pytest.mark.parametrize("step_dps", [0.05, 0.1, 0.02, 0.25, 0.2, 2 * LSB_DPS, 3 * LSB_DPS, 8 * LSB_DPS, np.rad2deg(1e-3)])
def test_the_step_of_rounded_readings_is_found(make_run: MakeRun, step_dps: float) -> None:
    for run_set in (runs_of(make_run, step_dps, 0.04), [runs_of(make_run, step_dps, 0.1)[0]]):
        assert coarse_step_dps(run_set, 2) == pytest.approx(step_dps, rel=1e-6)


def test_a_written_step_may_be_rounded_itself(make_run: MakeRun) -> None:
    """A log in rad/s with three decimals, which was converted and written with five."""
    run = runs_of(make_run, np.rad2deg(1e-3), 0.2)[1]
    written = make_run(run.t_s, np.round(run.gyro_dps, 5), rate_ref_dps=run.rate_dps)
    assert coarse_step_dps([written], 2) == pytest.approx(np.rad2deg(1e-3), rel=1e-4)


@pytest.mark.parametrize("step_dps", [0.05, 0.1])
def test_rounded_readings_may_be_rounded_to_counts_again(make_run: MakeRun, step_dps: float) -> None:
    """Then they are five or six counts apart."""
    again = [
        make_run(r.t_s, np.rint(r.gyro_dps / LSB_DPS) * LSB_DPS, rate_ref_dps=r.rate_dps)
        for r in runs_of(make_run, step_dps, 0.1)
    ]
    assert coarse_step_dps(again, 2) == pytest.approx(step_dps, rel=0.005)


@pytest.mark.parametrize("step_dps", [LSB_DPS, 0.01, 0.001, 1e-5])
def test_a_log_with_enough_digits_is_not_coarse(make_run: MakeRun, step_dps: float) -> None:
    for sd_dps in (0.0, 0.003, 0.04):
        for run in runs_of(make_run, step_dps, sd_dps):
            assert coarse_step_dps([run], 2) == 0
    few = [make_run(np.arange(4) / 100, np.array([[0.0], [3], [0], [9]]) * LSB_DPS * np.ones(3), table_rate_dps=0.0)]
    assert coarse_step_dps(few, 2) == 0


@pytest.mark.parametrize("step_dps", [0.02, 0.05, 0.1, 0.25, 1.0])
@pytest.mark.parametrize("sd_dps", [0.0, 0.01, 0.04, 0.3])
def test_rounding_is_no_other_fault_of_the_reading(make_run: MakeRun, step_dps: float, sd_dps: float) -> None:
    for samples in (8, 60, 3000):
        runs = runs_of(make_run, step_dps, sd_dps, samples)
        for name in FAULTS:
            fault = effect(name).fault
            assert fault is not None
            for axis in range(3):
                found = fault.detect(runs, axis)
                assert found is None, (name, axis, samples, found)
        assert lost_carry(runs, 2) is None
        assert single_power(runs, 2) is None


@pytest.mark.wide
@pytest.mark.slow
@pytest.mark.parametrize(("count_dps", "named"), [(0.5, True), pytest.param(0.2, True, marks=pytest.mark.wide), (0.04, False)])
def test_a_step_that_hides_the_noise_is_named_without_a_stated_count(count_dps: float, named: bool) -> None:
    """A session without lsb_dps was unknown, or small rates that round to zero were a dead band."""
    rng = np.random.default_rng(9501)
    t_s = np.arange(4000) / 100.0
    runs = []
    for cycle in range(4):
        rate_dps = np.repeat(rng.uniform(-60, 60, 40), 100) * np.repeat(rng.choice([0.0, 0.004, 1.0], 40), 100)
        gyro = rng.normal(0, 0.04, (t_s.size, 3)) + np.array([0.2, -0.1, 0.05]) + rng.normal(0, 0.01, 3)
        gyro[:, 2] += 1.003 * rate_dps
        rounded = np.rint(gyro / count_dps) * count_dps
        runs.append(bare_run(t_s, rounded, rate_ref_dps=rate_dps, scenario=f"s{cycle}"))
    found = diagnose(make_session(*runs), ON_Z)
    assert [c.effect.id for c in found.candidates if c.decision == "add"] == ["quantization"] * named
    if named:
        assert found.best is not None
        assert found.best.values["lsb_dps"] == pytest.approx(count_dps, rel=1e-6)
