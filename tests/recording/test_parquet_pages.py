"""Parquet files whose pages state numbers of values that cannot be, which would end the process within Polars."""

import io
import subprocess
import sys
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from polars.testing import assert_frame_equal

from gyrocal.recording.parquet_pages import read_parquet

TABLE = pl.DataFrame({"t_s": [k / 10 for k in range(20)], "a": [None, 1.0] * 10, "word": ["x", "y", None, "x"] * 5})


@pytest.mark.parametrize("how", [{}, {"row_group_size": 7}, {"compression": "uncompressed"}, {"compression": "snappy"}])
def test_sound_files_are_read(tmp_path: Path, how: dict[str, Any]) -> None:
    table = TABLE.with_columns(several=pl.Series([[1.0, 2.0, 3.0]] * 20))
    table.write_parquet(tmp_path / "a.parquet", **how)
    assert_frame_equal(read_parquet(tmp_path / "a.parquet"), table)
    assert_frame_equal(read_parquet(io.BytesIO((tmp_path / "a.parquet").read_bytes())), table)


EACH = """
import io, pathlib, sys
import polars as pl
from gyrocal.recording.parquet_pages import read_parquet
sound = pathlib.Path(sys.argv[1]).read_bytes()
refused = 0
for at in range(len(sound)):
    try:
        read_parquet(io.BytesIO(sound[:at] + bytes([sound[at] ^ 1]) + sound[at + 1 :]))
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException):
        refused += 1
print(refused)
"""


def test_a_flipped_sign_anywhere_does_not_end_the_process(tmp_path: Path) -> None:
    """Thrift keeps the sign of a number in its lowest bit."""
    TABLE.write_parquet(tmp_path / "a.parquet")
    done = subprocess.run(
        [sys.executable, "-c", EACH, str(tmp_path / "a.parquet")], capture_output=True, text=True, check=False
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-500:]
    assert int(done.stdout) > 10


def test_lists_nested_without_an_end_are_left_to_polars() -> None:
    TABLE.write_parquet(sound := io.BytesIO())
    nested = b"\x19" + b"\x19" * 5000  # a footer that is a list of lists
    with pytest.raises((OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException)):
        read_parquet(io.BytesIO(sound.getvalue()[:-8] + nested + len(nested).to_bytes(4, "little") + b"PAR1"))
