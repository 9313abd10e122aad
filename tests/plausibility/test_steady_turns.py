"""A sensor that turns steadily is not at rest, whether all the time or for a while; a biased one is."""

import numpy as np
import pytest

from gyrocal.plausibility import check
from make_runs import make_run, make_session

T_S = np.arange(6000) / 100.0
RNG = np.random.default_rng(0)


def told(rate_dps: np.ndarray | float, *more: float) -> list[tuple[str, str | None]]:
    """The blocking warnings of a rest in which z reads this, and of rests that read steadily ``more``."""
    rates = [np.broadcast_to(r, T_S.shape) for r in (rate_dps, *more)]
    readings = [np.column_stack([0 * T_S, 0 * T_S, r]) + RNG.normal(0, 0.1, (T_S.size, 3)) for r in rates]
    runs = [make_run(T_S, r, table_rate_dps=0.0, scenario=f"s{k}") for k, r in enumerate(readings)]
    return [(w.code, w.axis) for w in check(make_session(*runs)) if w.blocking]


def test_a_robot_that_spins_steadily_is_not_at_rest() -> None:
    assert told(42.0) == [("not_at_rest", "z")]
    assert told(-42.0, -42.0) == [("not_at_rest", "z")] * 2


def test_a_turn_for_a_while_is_not_at_rest() -> None:
    for first, last in ((5.0, 20.0), (30.0, 50.0)):
        assert told(np.where((first < T_S) & (last > T_S), 42.0, 0.0)) == [("not_at_rest", "z")]


@pytest.mark.parametrize("bias_dps", [0.3, 12.0, 20.0])
def test_a_biased_sensor_is_at_rest(bias_dps: float) -> None:
    assert not told(bias_dps)
    assert not told(bias_dps + 8.0 * T_S / T_S[-1])


def test_a_walk_and_a_push_are_not_at_rest() -> None:
    """Both are over within a second, whose mean hides them. A knock of two samples and a fault that repeats are no movement."""
    assert told(150.0 * np.sin(2 * np.pi * 1.0 * T_S)) == [("not_at_rest", "z")]
    assert told(np.where(T_S % 12.0 < 1.0, 400.0 * np.sin(2 * np.pi * T_S), 0.0)) == [("not_at_rest", "z")]
    assert not told(np.where(np.abs(T_S - 20.0) < 0.01, 400.0, 0.0))
    assert not told(np.where(np.arange(T_S.size) % 50 == 0, 400.0, 0.0))


def test_a_flight_after_a_rest_is_not_at_rest() -> None:
    """A drone that holds itself level turns by a few deg/s. A table that vibrates throughout is at rest."""
    sway = 3.0 * np.sin(2 * np.pi * 0.8 * T_S) * np.sin(2 * np.pi * 0.11 * T_S)
    assert told(np.where(T_S > 45.0, sway, 0.0)) == [("not_at_rest", "z")]
    assert not told(1.5 * np.sin(2 * np.pi * 2.0 * T_S))
    assert not told(RNG.normal(0, np.where(T_S > 45.0, 2.0, 0.5)))


def test_a_step_of_the_codes_now_and_then_is_no_movement() -> None:
    """A bit that was read wrongly sets readings of a wandering bias off by 1.12 deg/s for a while; a push varies in size."""
    now_and_then = (T_S % 9.0 > 8.3) & (T_S > 5.0)
    assert not told(np.where(now_and_then, -1.12, 0.0))
    assert told(np.where(now_and_then, 4.0 * np.sin(np.pi * (T_S % 9.0 - 8.3) / 0.7), 0.0)) == [("not_at_rest", "z")]


def test_a_slow_spin_up_is_not_at_rest() -> None:
    """No second steps, and no bias goes so far: a satellite on its stand was said to have a bias of 85 deg/s."""
    assert told(-170.0 * (1 - np.exp(-T_S / 15.0))) == [("not_at_rest", "z")]
    assert not told(45.0 * T_S / T_S[-1] - 20.0)


def test_the_acceleration_of_a_flight_is_no_gravity() -> None:
    """A rocket that is said to be at rest moves; nothing is wrong with the unit of its accelerometer."""
    shaken = RNG.normal(0, 30, (T_S.size, 3)).cumsum(axis=0) / 10
    falling = np.column_stack([0 * T_S, 0 * T_S, np.full(T_S.size, 0.4)]) + RNG.normal(0, 0.2, (T_S.size, 3))

    def codes(acc_g: np.ndarray, gyro: np.ndarray) -> set[str]:
        columns = dict(zip(("ax_g", "ay_g", "az_g"), acc_g.T, strict=True))
        return {w.code for w in check(make_session(make_run(T_S, gyro, table_rate_dps=0.0, **columns)))}

    assert "not_at_rest" in codes(falling, shaken)
    assert "accel_unit" not in codes(falling, shaken)
    assert "accel_unit" in codes(falling, RNG.normal(0, 0.1, (T_S.size, 3)))


def test_a_wrong_zero_is_told_as_that() -> None:
    assert ("bias_implausible", "z") in told(70.0)
    assert ("not_at_rest", "z") not in told(70.0)
