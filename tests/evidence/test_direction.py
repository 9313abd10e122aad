"""What is left over may have the sign of the table's direction, whatever its speed: a cover that is wound up by the start."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.effects.base import elapsed_s
from gyrocal.recording.session import Run
from gyrocal.simulation.simulate import simulate
from known import ON_Y


@pytest.mark.wide
@pytest.mark.slow
def test_an_offset_with_the_sign_of_the_direction_that_settles_is_no_misalignment() -> None:
    """The most probable set was misalignment, whose rate has the same sign, for want of such a rest."""
    plain = simulate(None, "full", (), 1, scenarios=3, seconds=20.0)[0]

    def wound_up(run: Run) -> Run:
        offset = 0.02 * np.sign(run.rate_dps.mean()) * np.exp(-elapsed_s(run) / 3.0)
        return replace(run, frame=run.table.with_columns(gy_dps=pl.Series(run.gyro_dps[:, 1] + offset)))

    found = diagnose(plain.with_runs(map(wound_up, plain.runs)), ON_Y)
    best = found.alternatives[0]
    assert best.found.effects == ()
    assert list(best.found.unnamed) == ["time"]
    assert not [c for c in found.candidates if c.decision == "add"]
