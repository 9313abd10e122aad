"""A table that swings shows nothing that comes back once per turn; one that goes round does."""

import numpy as np
import pytest

from gyrocal.variables.shapes import Waves
from gyrocal.variables.table_angle import TableAngle
from make_runs import make_run

T_S = np.arange(4000) / 100.0


@pytest.mark.parametrize(
    ("swing_deg", "orders"), [(6.0, []), (40.0, []), (150.0, [2, 3, 4, 5, 6]), (400.0, [1, 2, 3, 4, 5, 6])]
)
def test_a_wave_is_looked_for_where_the_table_turns_through_most_of_its_period(swing_deg: float, orders: list[int]) -> None:
    angle_deg = swing_deg / 2 * np.sin(2 * np.pi * T_S / 5)
    rate_dps = np.gradient(angle_deg, T_S)
    gyro = np.column_stack([0 * T_S, 0 * T_S, rate_dps])
    run = make_run(T_S, gyro, table_rate_dps=None, rate_ref_dps=rate_dps, table_angle_deg=angle_deg)
    shapes = TableAngle([run]).shapes(2)
    assert [k for shape in shapes if isinstance(shape, Waves) for k in shape.orders] == orders


def test_a_table_at_a_constant_rate_shows_a_wave_once_per_turn_after_most_of_a_turn() -> None:
    for seconds, goes_round in ((1.0, False), (10.0, True)):
        t_s = T_S[: round(100 * seconds)]
        run = make_run(t_s, np.tile([0.0, 0.0, 78.0], (t_s.size, 1)), table_rate_dps=78.0)
        assert any(shape.order == 1 for shape in TableAngle([run]).shapes(2)) == goes_round
