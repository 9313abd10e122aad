"""A thermometer that moves hardly more than its noise: without a part of the data its column shows nothing."""

import math

import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from known import ON_Z


@pytest.mark.wide
def test_a_candidate_whose_column_is_mostly_noise_is_not_named() -> None:
    simulated, _ = simulate(None, "swing", ["lag:tau_s=0.012"], 1, scenarios=1, seconds=60.0)
    table = simulated.runs[0].table.gather_every(2).select("t_s", "gx_dps", "gy_dps", "gz_dps", "temp_c", "rate_ref_dps")
    found = diagnose(Session.from_frames([table], [{"face": "up"}]), ON_Z)
    assert found.best is not None
    assert found.best.effect.id == "lag"
    assert found.verdict == "add"
    assert all(c.gain is None or math.isfinite(c.gain) for c in found.candidates)
    thermal = next(c for c in found.candidates if c.effect.id == "bias_temperature")
    assert thermal.decision != "add"
