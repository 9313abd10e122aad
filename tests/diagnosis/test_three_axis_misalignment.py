"""Misalignment against a reference with three axes, where any rotation belongs to the alignment."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.recording.header import Reference
from make_runs import make_run, make_session

LEAK = 0.004


@pytest.mark.wide
def test_the_candidates_of_a_symmetric_misalignment_are_symmetric() -> None:
    """Each was fitted at the alignment without misalignment, and the two of a pair differed by eighteen of their errors."""
    rng, t_s = np.random.default_rng(8), np.arange(6000) / 100
    f, p = rng.uniform(0.05, 1.2, (8, 3)), rng.uniform(0, 7, (8, 3))
    a = rng.normal(0, 20, (8, 3)) * [1.0, 0.5, 1.5]
    rate_dps = np.sum(a * np.sin(2 * np.pi * f * t_s[:, None, None] + p), axis=1)
    leak = np.array([[0.0, LEAK, 0.0], [LEAK, 0.0, 0.0], [0.0, 0.0, 0.0]])
    gyro_dps = rate_dps @ (np.diag([1.01, 0.98, 1.02]) + leak) + [1.0, -2.0, 3.0] + rng.normal(0, 0.05, rate_dps.shape)
    reference = rate_dps + rng.normal(0, 0.05, rate_dps.shape)
    columns = {f"ref_{name}_dps": reference[:, i] for i, name in enumerate("xyz")}
    run = make_run(t_s, gyro_dps, table_rate_dps=None, **columns)
    found = diagnose(make_session(run, reference=Reference(clock="own")))
    named = {c.axis: c for c in found.candidates if c.effect.id == "misalignment" and c.decision == "add"}
    assert sorted(named) == ["x", "y"]
    for axis, name in (("x", "m_y"), ("y", "m_x")):
        c = named[axis]
        assert abs(c.values[name] - LEAK) < 4 * c.se[name] < 1e-3
    assert named["x"].values["m_y"] == named["y"].values["m_x"]
