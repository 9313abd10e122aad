"""Others' recordings into a session: tables of any column names and units, cut into runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.errors import InputError
from gyrocal.recording.column_map import TARGETS, ColumnMap, Scaling, mapping_of
from gyrocal.recording.cut import Cut, Edge, check_names_differ, with_meta
from gyrocal.recording.header import read_header, write_header
from gyrocal.recording.measured_rates import REFERENCES
from gyrocal.recording.session import Array, Run, Session, run_entry
from gyrocal.recording.source import Source, read_source
from gyrocal.recording.stamps import goes_back, in_bursts, period_s, regression
from gyrocal.recording.table import OPTIONAL, REQUIRED, check_table, write_table
from gyrocal.warning import Warning


def import_recording(
    source: str | Path,
    out: str | Path,
    maps: Sequence[str] = (),
    *,
    cuts: Sequence[Cut] = (),
    run_meta: Sequence[str] = (),
    defaults: Mapping[str, Any] | None = None,
    axis: str = "z",
    scaling: Scaling | None = None,
    columns: Sequence[str] | None = None,
    skip: int | None = None,
    form: str | None = None,
    sensor: str | None = None,
    full_scale_dps: float | None = None,
    append: bool = False,
    warn: Callable[[Warning], None] = lambda _: None,
) -> Session:
    """Make a session of a recording; nothing is left behind where that fails.

    Args:
        source: the file; for EuRoC its folder (``imu0``) will do.
        out: the session's folder, new unless ``append``.
        maps: ``target=column[:unit][*factor]``; without any, the columns that bear a session's names.
        cuts: the runs to take; without any, the whole table is one.
        run_meta: ``PATTERN:key=value,...`` for the cuts whose names fit.
        defaults: keys of ``[[run]]`` for all of them.
        axis: the session's axis.
        form: a name of ``FORMATS``, whose mappings come before ``maps``.
        warn: told what was left out of the file.

    Raises:
        InputError: one line naming file, row or option, and the reason.
    """
    path, folder, scaling = Path(source), Path(out), scaling or Scaling()
    scaling.check()
    if form is not None:
        maps, path = [*mapping_of(form), *maps], _data_file(path)
    if folder.exists() and not append:
        raise InputError(f"{folder}: is there already; choose another name, or --append to add runs to it")
    table, mappings = _read(path, maps, scaling, columns, skip)
    if table.damage:
        warn(Warning("line_damaged", None, None, f"{path}: {table.damage}"))
    existing = Session.open(folder, check=False) if append and folder.exists() else None
    number = len(existing.runs) if existing else 0
    face = (defaults or {}).get("face", "up")
    cuts = with_meta(list(cuts) or [Cut(f"{number:03d}_{face}")], run_meta, defaults or {})
    check_names_differ(cuts)
    runs = cut_runs(table, mappings, cuts, scaling.rate_hz, axis, warn)
    if existing is not None:
        return _append(folder, existing, runs)
    session = Session(
        sample_rate_hz=scaling.rate_hz or runs[0].sample_rate_hz,
        runs=tuple(runs),
        axis=axis,  # type: ignore[arg-type]
        sensor=sensor,
        full_scale_dps=full_scale_dps,
        lsb_dps=scaling.lsb_dps,
    )
    return session.save(folder)


def _data_file(path: Path) -> Path:
    """The table in an EuRoC folder; any other path as it is."""
    return next((p for p in (path / "data.csv", path / "imu0" / "data.csv") if p.is_file()), path)


def _read(
    path: Path, maps: Sequence[str], scaling: Scaling, columns: Sequence[str] | None, skip: int | None
) -> tuple[Source, list[ColumnMap]]:
    """The table's wanted columns and what they are mapped to; without ``maps``, those that bear a session's names."""
    mappings = list({m.target: m for m in (ColumnMap.parse(text, scaling) for text in maps)}.values())
    if not mappings:
        table = read_source(path, REQUIRED, OPTIONAL, columns, skip)
        return table, [ColumnMap(name, name) for name in table.frame.columns]
    lacking = [t for t in REQUIRED[1:] if t not in {m.target for m in mappings}]
    if lacking:
        raise InputError(f"{path}: nothing is mapped to {', '.join(lacking)}; see gyrocal import --help")
    return read_source(path, [m.column for m in mappings], (), columns, skip), mappings


def cut_runs(
    source: Source, mappings: Sequence[ColumnMap], cuts: Sequence[Cut], rate_hz: float | None, axis: str,
    warn: Callable[[Warning], None] = lambda _: None,
) -> list[Run]:  # fmt: skip
    """The cuts as runs, checked; without a mapping of ``t_s``, ``rate_hz`` numbers the samples.

    Times that repeat or come in bursts are replaced by their regression on the sample's number, and ``warn`` is told.
    """
    height = source.frame.height
    by_target = {m.target: m for m in mappings}
    if "t_s" not in by_target and rate_hz is None:
        raise InputError(f"{source.label}: no time: map t_s, or give --rate-hz where samples are evenly spaced")
    runs = []
    for index, cut in enumerate(cuts):
        start = _row(source, by_target, cut.start, 0, rate_hz)
        end = _row(source, by_target, cut.end, height, rate_hz)
        if not 0 <= start < end <= height or end - start < 2:
            raise InputError(
                f"{source.label}: run {cut.name}: rows {start} to {end} of {height} do not hold two samples"
            )
        columns = {m.target: source.numbers(m, start, end) for m in mappings}
        if "t_s" not in columns:
            assert rate_hz is not None
            columns["t_s"] = np.arange(end - start) / rate_hz
        columns["t_s"] = _even(columns["t_s"], source, start, cut, warn)
        frame = pl.DataFrame({name: columns[name] for name in TARGETS if name in columns}).fill_nan(None)
        meta = cut.meta
        face = meta.get("face", "up")
        run = Run(
            index, f"{cut.name}.csv", meta.get("scenario", "s000"), face, meta.get("axis") or axis,  # type: ignore[arg-type]
            meta.get("table_rate_dps"), meta.get("turn_deg"), meta.get("day"), meta.get("power_on_s"),
            rate_hz or _nominal_rate_hz(columns["t_s"]), frame=check_table(frame, f"{source.label}: run {cut.name}"),
        )  # fmt: skip
        if run.table_rate_dps is None and run.turn_deg is None and not set(REFERENCES) & set(columns):
            raise InputError(
                f"run {cut.name}: its true rate is not known; give --rate, --turn-deg, or map a reference (rate_ref_dps)"
            )
        runs.append(run)
    return runs


def _even(t_s: Array, source: Source, start: int, cut: Cut, warn: Callable[[Warning], None]) -> Array:
    """The times of a cut [n], s: as they are, or by regression where they repeat or come in bursts."""
    if not np.isfinite(t_s).all() or not in_bursts(t_s):
        return t_s
    if goes_back(t_s) or t_s[-1] <= t_s[0]:
        row = start + int(np.flatnonzero(np.diff(t_s) <= 0)[0]) + 1
        raise InputError(
            f"{source.label}: row {source.first_row + row}: time repeats or goes back; cut it with --run, "
            "or number the samples with --rate-hz and no t_s"
        )
    stamps = regression(t_s)
    lost = f", {stamps.lost} samples are missing" if stamps.lost else ""
    warn(Warning(
        "sample_rate", None, f"{cut.name}.csv",
        f"the times repeat or come in bursts, {1e3 * stamps.jitter_s:.3g} ms rms off an even course of "
        f"{1 / stamps.period_s:.5g} samples a second{lost}; they were replaced by their regression on the sample's number. "
        "Record the sensor's own time if you can",
    ))  # fmt: skip
    return stamps.t_s


def _row(
    source: Source, by_target: Mapping[str, ColumnMap], edge: Edge | None, default: int, rate_hz: float | None
) -> int:
    if edge is None:
        return default
    if not edge.in_seconds:
        return int(edge.value)
    if "t_s" in by_target:
        t_s = source.numbers(by_target["t_s"], 0, source.frame.height)
    else:
        assert rate_hz is not None
        t_s = np.arange(source.frame.height) / rate_hz
    return int(np.searchsorted(t_s, edge.value - 0.5e-6))


def _nominal_rate_hz(t_s: Array) -> float:
    return float(f"{1.0 / period_s(t_s):.5g}")


def _append(folder: Path, session: Session, runs: list[Run]) -> Session:
    """Add runs to a session: all of their files first, session.toml last."""
    header = read_header(folder).model_dump(exclude_none=True)
    entries = header.pop("run")
    for run in runs:
        if abs(run.sample_rate_hz / session.sample_rate_hz - 1.0) > 0.02:
            raise InputError(
                f"{folder}: is at {session.sample_rate_hz:g} Hz, run {run.file} at {run.sample_rate_hz:g} Hz; "
                "one session holds one rate"
            )
        if (folder / run.file).exists():
            raise InputError(f"{folder / run.file}: is there already; name the run otherwise with --run NAME::")
    written: list[Path] = []
    try:
        for run in runs:
            written.append(folder / run.file)
            write_table(run.table, folder / run.file)
        write_header(folder, header, [*entries, *(run_entry(run, run.file, session.axis) for run in runs)])
    except BaseException:
        for path in written:
            path.unlink(missing_ok=True)
        raise
    return Session.open(folder, check=False)
