"""Where no file states the time of power-on, a warm-up is no candidate, and a drift resembles it."""

from collections.abc import Callable

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import Diagnosis, diagnose
from gyrocal.recording.session import Array, Run, Session
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("known_answers")
HZ = 50.0


def rests(bias_dps: Callable[[Array], Array], runs: int, seconds: float) -> Session:
    """Four power cycles at rest of several runs, with the same bias over the time since the first sample of the cycle."""
    rng, t_s = np.random.default_rng(11), np.arange(round(seconds * HZ)) / HZ
    made: list[Run] = []
    for cycle in range(4):
        offset = rng.normal(0, 0.01, 3)
        for k in range(runs):
            gyro = offset + rng.normal(0, 0.02, (t_s.size, 3))
            gyro[:, 2] += bias_dps(t_s + k * seconds)
            face = "up" if k % 2 == 0 else "down"
            run = make_run(t_s, gyro, face=face, scenario=f"s{cycle}", rate_hz=HZ, table_rate_dps=0.0)
            made.append(run.after(made[len(made) - k :]))
    return make_session(*made)


def groups(found: Diagnosis) -> dict[str, tuple[str, ...]]:
    return {c.effect.id: c.group for c in found.candidates if c.axis == "z" and c.decision == "add"}


def test_a_warm_up_that_flattens_is_no_drift() -> None:
    """It explains the runs better by far. The drift was a sure name."""
    found = diagnose(rests(lambda p: 0.05 * np.exp(-p / 60), 8, 20.0), ON_Z)
    assert "drift" not in groups(found)
    assert found.verdict == "unknown"


def test_what_is_too_short_to_flatten_may_be_either() -> None:
    for bias_dps in (lambda p: 0.05 * np.exp(-p / 120), lambda p: -4e-4 * p):
        found = diagnose(rests(bias_dps, 1, 40.0), ON_Z)
        assert found.verdict == "ambiguous"
        assert set(groups(found)["drift"]) == {"drift", "warmup"}


def test_a_drift_that_goes_on_keeps_its_name() -> None:
    found = diagnose(rests(lambda p: -2e-4 * p, 1, 400.0), ON_Z)
    assert (found.verdict, groups(found)) == ("add", {"drift": ("drift",)})
