"""A table that swings shows nothing that comes back once per turn; one that goes round does."""

import numpy as np
import pytest
from tests.make_runs import make_run

from gyrocal.variables.table_angle import TableAngle

T_S = np.arange(4000) / 100.0


@pytest.mark.parametrize(("swing_deg", "goes_round"), [(6.0, False), (150.0, False), (400.0, True)])
def test_a_swing_is_no_turn(swing_deg: float, goes_round: bool) -> None:
    angle_deg = swing_deg / 2 * np.sin(2 * np.pi * T_S / 5)
    rate_dps = np.gradient(angle_deg, T_S)
    gyro = np.column_stack([0 * T_S, 0 * T_S, rate_dps])
    run = make_run(T_S, gyro, table_rate_dps=None, rate_ref_dps=rate_dps, table_angle_deg=angle_deg)
    assert bool(TableAngle([run]).shapes(2)) == goes_round


def test_a_table_at_a_constant_rate_goes_round_after_a_whole_turn() -> None:
    for seconds, goes_round in ((3.0, False), (10.0, True)):
        t_s = T_S[: round(100 * seconds)]
        run = make_run(t_s, np.tile([0.0, 0.0, 78.0], (t_s.size, 1)), table_rate_dps=78.0)
        assert bool(TableAngle([run]).shapes(2)) == goes_round
