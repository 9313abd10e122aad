"""Which quiet stretches of a session by hand are rests."""

from dataclasses import replace

import numpy as np

from by_hand import turned_by
from gyrocal.gravity.rests import look

ROUND = [("y", 90.0), ("x", 90.0), ("z", 90.0)]
TREMBLES_DPS = 0.04


def test_a_rest_that_is_cut_is_no_reason_to_leave_out_one_that_trembles() -> None:
    """A rest of 10 s in three pieces made ten rests of eight poses, so that the first pose of the file was not taken."""
    session = turned_by([ROUND[0], *[("x", 0.0)] * 4, *ROUND[1:], *ROUND, *ROUND[:2]])
    (run,) = session.runs
    trembles = np.zeros(len(run))
    trembles[:120] = trembles[550:580] = trembles[900:930] = TREMBLES_DPS
    noise_dps = np.random.default_rng(1).normal(0, 1, (len(run), 3)) * trembles[:, None]
    columns = [run.table[f"g{a}_dps"] + noise_dps[:, i] for i, a in enumerate("xyz")]
    found = look(session.with_runs([replace(run, frame=run.table.with_columns(columns))]))
    assert found.rests[0].t_s < 1.0
    assert len(found.rests) == len(found.movements) + 1 == 9
    assert max(rest.seconds for rest in found.rests) > 8.0
