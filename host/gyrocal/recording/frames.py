"""A session of tables that are in memory: frames of polars or pandas, or arrays by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl

from gyrocal.errors import InputError, did_you_mean
from gyrocal.recording.column_map import has_reference
from gyrocal.recording.header import FORMAT, RunEntry, SessionFile, describe
from gyrocal.recording.session import Run, Session
from gyrocal.recording.stamps import period_s
from gyrocal.recording.table import REQUIRED, check_table


def session_of(frames: Sequence[Any], runs: Sequence[Mapping[str, Any]], **header: Any) -> Session:
    """See :meth:`gyrocal.recording.session.Session.from_frames`."""
    from pydantic import ValidationError

    if not frames:
        raise InputError("no frames; a session has a frame and its facts for each run")
    if len(frames) != len(runs):
        raise InputError(f"{len(frames)} frames and {len(runs)} runs; each frame has its facts, such as {{'face': 'up'}}")
    for run in runs:
        for key in sorted(set(run) - set(RunEntry.model_fields)):
            raise InputError(f"a run has no key {key!r}{did_you_mean(key, RunEntry.model_fields)}")
    tables = [check_table(_frame(frame, i), f"frame {i}") for i, frame in enumerate(frames)]
    rate_hz = float(f"{1 / period_s(tables[0]['t_s'].to_numpy()):.5g}")
    entries = [{"file": f"{i:03d}_{run.get('face', 'up')}.csv", "face": "up", **run} for i, run in enumerate(runs)]
    try:
        checked = SessionFile.model_validate({"format": FORMAT, "sample_rate_hz": rate_hz, **header, "run": entries})
    except ValidationError as error:
        raise InputError(describe(error, run="run")) from None
    strange = next(iter(checked.model_extra or ()), None)
    if strange is not None:
        raise InputError(f"a session has no key {strange!r}{did_you_mean(strange, SessionFile.model_fields)}")
    session = Session(
        sample_rate_hz=checked.sample_rate_hz, runs=(), axis=checked.axis, sensor=checked.sensor,
        full_scale_dps=checked.full_scale_dps, lsb_dps=checked.lsb_dps, latitude_deg=checked.latitude_deg,
        accept=tuple(checked.accept or ()), reference=checked.reference, board=checked.board, rig=checked.rig,
        line=checked.line, made_on=None if checked.made_on is None else str(checked.made_on),
        corrected=checked.corrected,
    )  # fmt: skip
    return session.with_runs(_run(i, checked.run[i], checked, table) for i, table in enumerate(tables))


def _run(index: int, entry: RunEntry, header: SessionFile, table: pl.DataFrame) -> Run:
    known = entry.table_rate_dps is not None or entry.turn_deg is not None or has_reference(table.columns)
    if not known and header.reference.kind != "gravity":
        raise InputError(f"run {index}: its true rate is not known; give table_rate_dps, turn_deg, or a column rate_ref_dps")
    return Run(
        index, entry.file, entry.scenario, entry.face, entry.axis or header.axis, entry.table_rate_dps, entry.turn_deg,
        entry.day, entry.power_on_s, header.sample_rate_hz, frame=table, lsb_dps=header.lsb_dps,
        latitude_deg=header.latitude_deg, table_rate_se_dps=entry.table_rate_se_dps, turn_se_deg=entry.turn_se_deg,
        reference=header.reference,
    )  # fmt: skip


def _frame(frame: Any, number: int) -> pl.DataFrame:
    """A table of a run as a polars frame; columns that a session does not know are left out."""
    if isinstance(frame, pl.DataFrame):
        return frame
    names = list(frame.keys()) if hasattr(frame, "keys") else []
    lacking = [name for name in REQUIRED if name not in names]
    if lacking:
        raise InputError(f"frame {number}: no column {', '.join(lacking)}; give a frame of polars or pandas, or arrays by name")
    return pl.DataFrame({str(name): np.asarray(frame[name]) for name in names}).fill_nan(None)
