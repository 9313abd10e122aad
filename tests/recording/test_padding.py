"""Zeros that fill an array are no readings; zeros that a sensor reads stay."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.recording.cut import Cut
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import Imported, read_recording

N, ZEROS = 4000, 239
Array = np.ndarray


def imported(tmp_path: Path, gyro: Array, acc: Array | None = None, t_s: Array | None = None, cut: str = "") -> Imported:
    names = ["t_s", "gx_dps", "gy_dps", "gz_dps", *(("ax_g", "ay_g", "az_g") if acc is not None else ())]
    t_s = np.arange(len(gyro)) / 100 if t_s is None else t_s
    table = np.column_stack([t_s, gyro, *([acc] if acc is not None else [])])
    pl.DataFrame(table, schema=names).write_csv(tmp_path / "log.csv")
    cuts = [Cut.parse(cut)] if cut else []
    return read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 0.0}, cuts=cuts))


def noise(kind: str) -> Array:
    rng = np.random.default_rng(3)
    white = rng.normal([0.6, -0.1, 0.0], 0.1, (N, 3))
    if kind == "filtered":
        return np.apply_along_axis(lambda axis: np.convolve(axis, np.ones(8) / 8, "same"), 0, white)
    return np.rint(white / 0.07) * 0.07 if kind == "counts" else white


@pytest.mark.parametrize("kind", ["white", "filtered", "counts"])
def test_zeros_at_the_end_of_a_file_are_left_out(kind: str, tmp_path: Path) -> None:
    gyro = noise(kind)
    gyro[-ZEROS:] = 0.0
    for t_s in (None, np.where(np.arange(N) < N - ZEROS, np.arange(N) / 100, 0.0)):  # the times may be filled up as well
        found = imported(tmp_path, gyro, t_s=t_s)
        assert found.repaired == {"rows": ZEROS}
        assert len(found.session.runs[0]) == N - ZEROS
        (told,) = found.warnings
        assert told.code == "line_damaged"
        assert "239 rows of zeros are left out, which no sensor reads (from row 3763 on)" in told.text
    assert len(imported(tmp_path, gyro, cut=f"a:100:{N}").session.runs[0]) == N - ZEROS - 100


def test_zeros_at_the_begin_of_a_file_are_left_out(tmp_path: Path) -> None:
    gyro = noise("white")
    gyro[:ZEROS] = 0.0
    found = imported(tmp_path, gyro, cut="a:0:2000")
    assert found.repaired == {"rows": ZEROS}
    run = found.session.runs[0]
    assert len(run) == 2000 - ZEROS
    np.testing.assert_allclose(run.gyro_dps, gyro[ZEROS:2000], atol=1e-9)


@pytest.mark.parametrize("count", [1, 5])
def test_beside_gravity_any_row_of_zeros_is_none(count: int, tmp_path: Path) -> None:
    gyro, acc = np.rint(noise("white")), np.random.default_rng(1).normal([0, 0, 1.0], 0.01, (N, 3))
    gyro[:count], acc[:count] = 0.0, 0.0
    assert imported(tmp_path, gyro, acc).repaired == {"rows": count}


@pytest.mark.parametrize("kind", ["coarse and quiet", "coarse, at rest in the end", "hides small rates", "few"])
def test_zeros_that_a_sensor_may_read_stay(kind: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    t_s = np.arange(N) / 100
    swing = 40 * np.sin(2 * np.pi * np.outer(t_s, [0.3, 0.5, 0.2])) * np.clip((36 - t_s) / 2, 0, 1)[:, None]
    if kind == "coarse and quiet":
        gyro = np.rint(rng.normal(0.3, 0.1, (N, 3)))
        gyro[0], gyro[-12:] = 1.0, 0.0
    elif kind == "coarse, at rest in the end":
        gyro = np.rint(swing + rng.normal(0, 0.1, (N, 3)))
    elif kind == "hides small rates":
        gyro = swing + rng.normal(0, 0.05, (N, 3))
        gyro[np.abs(gyro) < 0.5] = 0.0
    else:
        gyro = noise("white")
        gyro[-12:] = 0.0
    assert np.all(gyro[-12:] == 0)
    assert "rows" not in imported(tmp_path, gyro).repaired


def with_tail(t_end: float) -> tuple[Array, Array, Array]:
    """Readings with gravity whose last rows repeat one, time and all."""
    gyro, acc_g, t_s = noise("white"), np.random.default_rng(1).normal([0, 0, 1.0], 0.01, (N, 3)), np.arange(N) / 100
    gyro[-3 * ZEROS :], acc_g[-3 * ZEROS :], t_s[-3 * ZEROS :] = -0.0076, -0.0006, t_end
    return gyro, acc_g, t_s


@pytest.mark.parametrize("t_end", [2.0**32 - 1, 4294967.295, -1.0])
@pytest.mark.parametrize("guessed", [False, True])
def test_erased_memory_at_the_end_of_a_file_is_left_out(t_end: float, guessed: bool, tmp_path: Path) -> None:
    """All bits of erased flash are set: each channel is constant, and the time is the largest number, or -1."""
    gyro, acc, t_s = with_tail(t_end)
    if guessed:
        names = ["time", "ax", "ay", "az", "gx", "gy", "gz", "temp"]
        temp = np.where(np.arange(N) < N - 3 * ZEROS, 25.0, np.nan)[:, None]
        frame = pl.DataFrame(np.column_stack([t_s, acc * 9.81, gyro, temp]), schema=names)
        frame.with_columns(pl.col("temp").cast(pl.String)).write_csv(tmp_path / "log.csv")
        found = read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 0.0}))
        assert {"t_s=time:s", "az_g=az:m/s2"} <= {g.map for g in found.guessed}
    else:
        found = imported(tmp_path, gyro, acc, t_s)
    assert found.repaired == {"rows": 3 * ZEROS}
    assert len(found.session.runs[0]) == N - 3 * ZEROS
    (told,) = found.warnings
    assert told.code == "line_damaged"
    assert "717 rows of erased memory are left out, which repeat one row at the file's end, time and all" in told.text
    assert f"(from row {N - 3 * ZEROS + 2} on)" in told.text


def test_a_logger_that_hung_at_the_end_wrote_no_erased_memory(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    """Its last row is on the clock's course, and is kept once."""
    gyro, acc, t_s = with_tail((N - 3 * ZEROS) / 100)
    found = imported(tmp_path, gyro, acc, t_s)
    assert found.repaired == {"twice": 3 * ZEROS - 1}
    assert len(found.session.runs[0]) == N - 3 * ZEROS + 1
    assert not recwarn.list
