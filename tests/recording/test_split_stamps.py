"""Times in two columns, whole seconds and nanoseconds, are one time; a slower sensor's in the same table are none."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import read_recording
from gyrocal.recording.source import Source
from gyrocal.recording.split_stamps import with_whole_stamps

N = 400
TICKS_NS = 25_000_000 * np.arange(N) + 570_443_003
SECONDS, REST_NS = 1_729_521_988 + TICKS_NS // 10**9, TICKS_NS % 10**9
RATES = 40 * np.sin(np.arange(N) / 30)


def log(path: Path, head: str, unit_ns: int = 1, empty: int = 0) -> Path:
    """A table of the four columns of a head, with ``empty`` rows of another sensor between, and the time and the rates."""
    rows = [f"{s}.0,{n // unit_ns},{r:.4f},{r:.4f},{r:.4f}" for s, n, r in zip(SECONDS, REST_NS, RATES, strict=True)]
    for k in range(empty):
        rows.insert(20 * k + 7, ",,,,")
    path.write_text("\n".join([f"{head},gyro_x (dps),gyro_y (dps),gyro_z (dps)", *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("head", "unit_ns"),
    [
        ("timestamp_sec_imu,timestamp_nanosec_imu", 1), ("header.stamp.sec,header.stamp.nanosec", 1),
        ("header.stamp.secs,header.stamp.nsecs", 1), ("sec,usec", 1000),
    ],
)  # fmt: skip
def test_seconds_and_their_rest_are_one_time(head: str, unit_ns: int, tmp_path: Path) -> None:
    found = read_recording(log(tmp_path / "log.csv", head, unit_ns, empty=5), Options(defaults={"table_rate_dps": 78.0}))
    run = found.session.runs[0]
    assert run.t_s == pytest.approx(0.025 * np.arange(N), abs=1e-6)
    assert np.allclose(run.gyro_dps[:, 2], RATES, atol=1e-4)
    assert found.guessed[0].map.startswith("t_s=")


def test_other_pairs_of_columns_are_no_time() -> None:
    rest = {"a rest of more than a second": np.where(np.arange(N) == 3, 10**9, REST_NS)}
    mostly_empty = {"a slower sensor's": [n if k % 40 == 0 else None for k, n in enumerate(REST_NS.tolist())]}
    for nanoseconds in (rest | mostly_empty).values():
        table = pl.DataFrame({"sec": SECONDS, "nsec": nanoseconds})
        assert with_whole_stamps(Source("log.csv", table)).frame.columns == ["sec", "nsec"]
    table = pl.DataFrame({"sec": SECONDS, "nsec": REST_NS})
    stamps = with_whole_stamps(Source("log.csv", table)).frame["clock.stamp_ns"]
    assert np.array_equal(stamps.to_numpy(), SECONDS * 10**9 + REST_NS)
