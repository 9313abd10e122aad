"""What one run alone shows at many standard errors is a misfit, although no other run can confirm an effect."""

import re

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.recording.session import Session
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")
RATE_HZ, SECONDS = 100.0, 50.0


def session(
    seed: int, step_dps: float, drift_dps: float = 0.0, tau_s: float = 30.0, rest: bool = False, *,
    cycles: int = 4, faces: tuple[str, ...] = ("up", "down"), stepping: tuple[int, ...] = (2,),
) -> Session:  # fmt: skip
    """Power cycles, face up and down; the first run of some, as the third, has a step of the bias of z after 20 s."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    runs = []
    for cycle in range(cycles):
        turn_on_dps = rng.normal(0, 0.01, 3)
        for face in faces:
            sign = 1.0 if face == "up" else -1.0
            gyro = 0.3 + turn_on_dps + rng.normal(0, 0.06, (t_s.size, 3))
            kept = np.exp(-1 / RATE_HZ / tau_s)
            drift = rng.normal(0, drift_dps, (t_s.size, 3)) * np.sqrt(1 - kept**2)
            for i in range(1, t_s.size):
                drift[i] += kept * drift[i - 1]
            gyro += drift
            gyro[:, 2] += 0.0 if rest else 1.003 * 78.0 * sign
            if cycle in stepping and face == "up":
                gyro[t_s >= 20.0, 2] += step_dps
            runs.append(make_run(t_s, gyro, table_rate_dps=0.0 if rest else 78.0, face=face, scenario=f"s{cycle}"))
    return make_session(*runs)


@pytest.mark.parametrize(("step_dps", "drift_dps", "rest"), [(0.04, 0.0, False), (-0.2, 0.003, False), (0.1, 0.0, True)])
def test_a_step_in_one_run_is_a_misfit_at_its_file_and_second(step_dps: float, drift_dps: float, rest: bool) -> None:
    planted = session(9101, step_dps, drift_dps, rest=rest)
    compared, found = compare(planted, ON_Z), diagnose(planted, ON_Z)
    assert compared.verdict == "misfit"
    assert (found.verdict, [c.effect.id for c in found.candidates if c.decision == "add"]) == ("unknown", [])
    (first,) = (f for f in compared.where if f.axis == "z")
    assert first.against == "time"
    assert first.amplitude_dps == pytest.approx(abs(step_dps), rel=0.1)
    told = re.match(r"a step of (\S+) mdps (\S+) s after the start of 004_up.csv, in no other run", first.note)
    assert told is not None
    assert float(told[1]) == pytest.approx(1e3 * step_dps, rel=0.1)
    assert float(told[2]) == pytest.approx(20.0, abs=0.3)


def test_a_step_in_one_of_two_runs_is_a_misfit_too() -> None:
    """A drift that is as large as the step describes it as well, unless its moment is asked for."""
    planted = session(9102, 0.14, 0.004, rest=True, cycles=2, faces=("up",), stepping=(1,))
    compared, found = compare(planted, ON_Z), diagnose(planted, ON_Z)
    assert compared.verdict == "misfit"
    assert found.verdict != "adequate"
    (first,) = (f for f in compared.where if f.axis == "z")
    assert first.against == "time"
    assert "in no other run" in first.note


@pytest.mark.parametrize("seed", [9210, 9211, *(pytest.param(seed, marks=pytest.mark.wide) for seed in range(9212, 9216))])
def test_a_drift_of_two_runs_is_no_step(seed: int) -> None:
    assert compare(session(seed, 0.0, 0.03, 300.0, rest=True, cycles=2, faces=("up",))).where == []


@pytest.mark.parametrize(
    ("drift_dps", "tau_s"), [(0.004, 3.0), (0.02, 300.0), pytest.param(0.006, 30.0, marks=pytest.mark.wide)]
)
def test_a_drift_is_no_step(drift_dps: float, tau_s: float) -> None:
    assert compare(session(9201, 0.0, drift_dps, tau_s)).where == []
