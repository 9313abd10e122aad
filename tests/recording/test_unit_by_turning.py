"""Units of rates that no name states: decided by an orientation that the sensor computed, or by the end of its range."""

import numpy as np
import polars as pl
import pytest

from gyrocal.recording.column_map import Scaling
from gyrocal.recording.guess import Guess, guess
from gyrocal.recording.source import Source
from recording.test_guess_units import tumbled

N = 3000
UNITS = [("dps", 1.0), ("rad/s", np.pi / 180)]


def of_gyro(table: pl.DataFrame, scaling: Scaling | None = None) -> Guess:
    found = guess(Source("a.csv", table), scaling or Scaling())
    return next(g for g in found if g.map.startswith("gx_dps="))


def oriented(kind: str, one: float) -> pl.DataFrame:
    """Rates of a hand up to 20 deg/s without an accelerometer, and the orientation of the sensor's own filter, each tenth of a
    second, which sets itself anew once.
    """
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(5)
    t_s = np.arange(N) / 100
    rate_dps = 20 * np.sin(2 * np.pi * np.outer(t_s, [0.31, 0.43, 0.23]) + rng.uniform(0, 6.28, 3))
    turn = Rotation.from_euler("ZYX", [170, 20, -30], degrees=True)
    each = []
    for k, step in enumerate(Rotation.from_rotvec(np.radians(rate_dps) / 100)):
        turn = Rotation.from_rotvec([0, 0, 1.0]) * turn if k == N // 2 else turn
        each.append(turn.as_quat())
        turn = turn * step
    held = Rotation.from_quat(np.array(each)[np.arange(N) // 10 * 10])
    orientation = {
        "quaternion": (["Quat_w", "Quat_x", "Quat_y", "Quat_z"], np.roll(held.as_quat(), 1, axis=1)),
        "last": (["q0", "q1", "q2", "q3"], held.as_quat()),
        "matrix": ([f"r{i}{j}" for i in "123" for j in "123"], held.as_matrix().reshape(-1, 9)),
        "degrees": (["yaw", "pitch", "roll"], held.as_euler("ZYX", degrees=True)),
        "radians": (["Yaw (rad)", "Pitch (rad)", "Roll (rad)"], held.as_euler("ZYX")),
    }
    names, cells = orientation[kind]
    gyro = one * (rate_dps + np.array([0.8, -0.5, 0.3]) + rng.normal(0, 0.1, (N, 3)))
    return pl.DataFrame(np.column_stack([t_s, gyro, np.round(cells, 4)]), schema=["t", "gx", "gy", "gz", *names])


@pytest.mark.parametrize(
    "kind", ["quaternion", *(pytest.param(k, marks=pytest.mark.wide) for k in ("last", "matrix", "degrees", "radians"))]
)
@pytest.mark.parametrize(("unit", "one"), UNITS)
def test_the_sensors_own_orientation_decides(kind: str, unit: str, one: float) -> None:
    table = oriented(kind, one)
    if kind == "matrix":
        from gyrocal.recording.matrix_columns import with_quaternion

        table = with_quaternion(Source("a.csv", table)).frame
    found = of_gyro(table)
    assert found.map == f"gx_dps=gx:{unit}"
    assert "turn as the orientation in the same table does" in found.why
    assert not found.asks


def test_an_orientation_that_does_not_turn_decides_nothing() -> None:
    still = oriented("quaternion", 1.0).with_columns(pl.lit(0.5).alias(f"Quat_{part}") for part in "wxyz")
    assert of_gyro(still).asks


@pytest.mark.parametrize(("unit", "one"), UNITS)
def test_samples_without_a_time_turn_gravity_at_a_stated_rate(unit: str, one: float) -> None:
    table = tumbled(30.0, 9.80665, one, np.random.default_rng(1)).drop("t")
    found = of_gyro(table, Scaling(rate_hz=100.0))
    assert found.map == f"gx_dps=gx:{unit}"
    assert "as gravity does" in found.why


@pytest.mark.parametrize("end_dps", [250.0, 250 * 32767 / 32768, 32768 / 131, 1998.05, 2293.72])
def test_readings_that_end_at_the_full_scale_of_a_part_are_rad_s(end_dps: float) -> None:
    rates_dps = np.random.default_rng(2).normal(0, end_dps / 2, (N, 3))
    cells = np.round(np.radians(np.clip(rates_dps, -end_dps, end_dps)), 3)
    found = of_gyro(pl.DataFrame(np.column_stack([np.arange(N) / 100, cells]), schema=["t", "gx", "gy", "gz"]))
    assert found.map == "gx_dps=gx:rad/s"
    assert "full scale of a part" in found.why
    assert not found.asks


@pytest.mark.parametrize("largest", [4.0, 4.363])
def test_the_largest_code_of_a_slow_turn_is_no_end_of_a_range(largest: float) -> None:
    """Coarse counts repeat at the largest reading too, but no more often than the one below."""
    rng = np.random.default_rng(3)
    slow = np.round(rng.normal(0, 0.05, (N, 3)) + 2 * np.sin(np.arange(N) / 50)[:, None], 2)
    slow *= largest / np.abs(slow).max()
    found = of_gyro(pl.DataFrame(np.column_stack([np.arange(N) / 100, slow]), schema=["t", "gx", "gy", "gz"]))
    assert "full scale" not in found.why
