"""A session as input of the simulated device: the raw counts of an LSM6DSO, each row at its own time."""

from __future__ import annotations

import contextlib
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording.session import Run, Session

LSB_DPS = {125.0: 0.004375, 250.0: 0.00875, 500.0: 0.0175, 1000.0: 0.035, 2000.0: 0.07}
"""The rate of one count for each full scale, both in deg/s (LSM6DSO datasheet)."""
DEFAULT_FULL_SCALE_DPS = 250.0
LSB_G = 6.1e-5
COUNTS_PER_C = 256.0
ZERO_C = 25.0

ROWS_MAGIC = b"GCSIM01\0"
_RUN = np.dtype(
    [("first_row", "<u4"), ("n_rows", "<u4"), ("face", "<i4"), ("axis", "<i4"), ("table_dps", "<f4"),
     ("turn_deg", "<f4"), ("power_on_s", "<f4"), ("power_cycle", "<u4")]
)  # fmt: skip
_ROW = np.dtype([("t_us", "<i8"), ("temp", "<i2"), ("gyro", "<i2", 3), ("acc", "<i2", 3), ("flags", "<u2")])


def full_scale_for(session: Session) -> float:
    """The full scale of the LSM6DSO in deg/s: the session's or 250, or the smallest larger one that holds the data."""
    wanted = session.full_scale_dps or DEFAULT_FULL_SCALE_DPS
    peak = max(float(np.abs(run.gyro_dps).max()) for run in session.runs)
    for full_scale, lsb in LSB_DPS.items():
        if full_scale >= wanted and peak <= 32767.5 * lsb:
            return full_scale
    raise InputError(f"the session reaches {max(peak, wanted):.0f} dps; the simulated LSM6DSO measures up to 2000")


def rows_bytes(session: Session) -> bytes:
    """A session as the bytes of the simulator's ROWS file (see its rows.h).

    A run without an accelerometer gets +-1 g along its axis, according to its face. A run without temperature gets 25 degC.
    """
    full_scale = full_scale_for(session)
    cycles = {name: i for i, name in enumerate(session.scenarios)}
    entries = np.zeros(len(session.runs), _RUN)
    tables = []
    first = 0
    for entry, run in zip(entries, session.runs, strict=True):
        rows = _rows(run, LSB_DPS[full_scale])
        entry["first_row"], entry["n_rows"] = first, len(rows)
        entry["face"], entry["axis"] = int(run.face_sign), run.axis_index
        entry["table_dps"] = np.nan if run.table_rate_dps is None else run.table_rate_dps
        entry["turn_deg"] = np.nan if run.turn_deg is None else run.turn_deg
        entry["power_on_s"] = 0.0 if run.power_on_s is None else run.power_on_s
        entry["power_cycle"] = cycles[run.scenario]
        first += len(rows)
        tables.append(rows)
    head = struct.pack("<8sIIff8x", ROWS_MAGIC, len(entries), first, session.sample_rate_hz, full_scale)
    return b"".join([head, entries.tobytes(), *(rows.tobytes() for rows in tables)])


@contextlib.contextmanager
def rows_file(session: Session | str | Path) -> Iterator[Path]:
    """Yield a ROWS file of a session, given as a session or as its folder. The file exists within the ``with`` block."""
    content = rows_bytes(session if isinstance(session, Session) else Session.open(session))
    with tempfile.TemporaryDirectory(prefix="gyrocal-") as folder:
        path = Path(folder) / "rows"
        path.write_bytes(content)
        yield path


def _rows(run: Run, lsb_dps: float) -> np.ndarray[Any, Any]:
    rows = np.zeros(len(run), _ROW)
    rows["t_us"] = run.t_us
    # Each rounding error is carried into the next sample: rates off the part's grid keep their means and integrals.
    whole = np.rint(np.cumsum(run.gyro_dps / lsb_dps, axis=0))
    rows["gyro"] = _counts(np.diff(whole, axis=0, prepend=0.0))
    still = np.zeros((len(run), 3))
    still[:, run.axis_index] = run.face_sign
    acc_g = still if run.acc_g is None else np.where(np.isnan(run.acc_g), still, run.acc_g)
    rows["acc"] = _counts(acc_g / LSB_G)
    temp_c = np.full(len(run), ZERO_C) if run.temp_c is None else np.nan_to_num(run.temp_c, nan=ZERO_C)
    rows["temp"] = _counts((temp_c - ZERO_C) * COUNTS_PER_C)
    return rows


def _counts(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return np.clip(np.rint(values), -32768, 32767).astype(np.int16)
