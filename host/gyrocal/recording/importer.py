"""Others' recordings into a session: tables of any column names and units, cut into runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.errors import InputError
from gyrocal.recording import plateaus
from gyrocal.recording.column_map import TARGETS, ColumnMap, has_reference, mapping_of
from gyrocal.recording.column_names import stated_unit
from gyrocal.recording.convert import Converted, convert, rate_of
from gyrocal.recording.corrected import corrected_by
from gyrocal.recording.cut import Cut, Edge, check_meta, check_names_differ, with_meta
from gyrocal.recording.file_labels import labels_of
from gyrocal.recording.first_rows import Taken, first_rows
from gyrocal.recording.guess import Guess, is_forward, like_time, named_as_time, tells_nothing
from gyrocal.recording.header import Reference, read_header, write_header
from gyrocal.recording.hung import read_too_fast, without_hung
from gyrocal.recording.import_options import Options, with_gravity, with_second
from gyrocal.recording.joined import Files, stem_of
from gyrocal.recording.mapped import data_file, files_of, mapped_columns, only_axis
from gyrocal.recording.register import later_by_s
from gyrocal.recording.resample import resampled
from gyrocal.recording.restarts import advice, begins
from gyrocal.recording.run import points_up
from gyrocal.recording.second_file import Motion, SecondFile
from gyrocal.recording.session import AXES, Array, Run, Session, check_rate_known, run_entry
from gyrocal.recording.source import Source
from gyrocal.recording.stamped import even
from gyrocal.recording.stamps import goes_back, period_s
from gyrocal.recording.stated import rate_hz as stated_rate_hz
from gyrocal.recording.table import OPTIONAL, REQUIRED, all_finite, check_table, write_table
from gyrocal.warning import Warning

SAME_RATE = 0.02
"""Runs whose rates differ by less are of one rate."""
STATED = 0.05
"""A stated rate that is further from that of the times contradicts it (the warning ``sample_rate`` has the same limit)."""
TIME_UNITS = {1e3: "ms", 1e6: "us", 1e9: "ns"}


@dataclass(frozen=True)
class Imported:
    """A recording that was read and not yet written: its session, the mappings that were taken, and what was done to it."""

    session: Session
    guessed: tuple[Guess, ...]
    warnings: tuple[Warning, ...]
    repaired: Mapping[str, int]
    first_rows: tuple[Taken, ...] = ()
    """The columns with their first cells: of a folder, those of its first file, and those that another file has otherwise."""
    recordings: int = 1
    """Number of recordings, each with a file of its own."""

    def save(self, out: str | Path, *, append: bool = False) -> Session:
        """Write the session into a new folder, or add its runs to one. Nothing is written if that fails."""
        folder = Path(out)
        if append and folder.exists():
            return _append(folder, Session.open(folder, check=False), list(self.session.runs))
        check_is_new(folder, append)
        return self.session.save(folder)


def check_is_new(folder: Path, append: bool) -> None:
    """Raise InputError if the folder exists already."""
    if folder.exists() and not append:
        raise InputError(f"{folder}: exists already; choose another name, or --append to add runs to it")


def import_recording(
    source: str | Path,
    out: str | Path,
    maps: Sequence[str] = (),
    *,
    append: bool = False,
    warn: Callable[[Warning], None] = lambda _: None,
    **options: Any,
) -> Session:
    """Make a session of a recording in one step, without a guess; ``options`` are those of :meth:`Options.of`.

    For example ``import_recording("log.csv", "lab", ["t_s=time:ms", "gz_dps=w:rad/s"], table_rate_dps=78.0, face="up")``.

    Args:
        source: the file; a folder with a file a run; for EuRoC its folder (``imu0``) will do.
        out: the session's folder, new unless ``append``.
        maps: ``target=column[:unit][*factor]``; without any, the columns that bear a session's names.
        warn: told what was left out of the file or repaired in it.

    Raises:
        InputError: one line naming file, row or option, and the reason.
    """
    check_is_new(Path(out), append)
    found = read_recording(source, Options.of(maps, options), existing=_existing(Path(out), append))
    if found.guessed:
        raise InputError(f"{source}: its columns are not mapped; a guess: {' '.join(g.map for g in found.guessed)}")
    for warning in found.warnings:
        warn(warning)
    return found.save(out, append=append)


def _existing(out: Path, append: bool) -> Session | None:
    return Session.open(out, check=False) if append and out.exists() else None


def read_recording(source: str | Path, options: Options, existing: Session | None = None) -> Imported:
    """Read and convert a recording; nothing is written. ``existing``: the session that its runs will be added to."""
    options.scaling.check()
    path, given = Path(source), options
    if options.form is not None:
        options = replace(options, maps=[*mapping_of(options.form), *options.maps])
        path = data_file(path)
    of_reference = with_second(with_gravity(options, existing))
    options = of_reference.options
    files = files_of(path, options.joined)
    if len(files) > 1 and (options.cuts or options.rates):
        raise InputError(f"{path}: {len(files)} files, each a run; --run, --sections and --rates cut a single file")
    options.check_rates()
    runs: list[Run] = []
    warnings: list[Warning] = []
    repaired: dict[str, int] = {}
    guessed: tuple[Guess, ...] = ()
    rows: tuple[Taken, ...] = ()
    number = len(existing.runs) if existing else 0
    axis = options.axis or (existing.axis if existing else None)
    corrected = {existing.corrected} if existing else set[str | None]()
    names = [stem_of(file.gyroscope) for file in files] if len(files) > 1 else []
    for file in files:
        read = _read_file(file, replace(options, axis=axis), number + len(runs), names)
        refused = any(g.asks for g in guessed)  # no file decides, so that the others need not be read for it again
        asks = any(g.asks for g in read.guessed)
        if asks and not refused and (sure := _decided_by_another(read.guessed, file, files, options)):
            stated = replace(options, axis=axis, maps=[*(g.map for g in sure), *options.maps])
            read = replace(_read_file(file, stated, number + len(runs), names), guessed=sure)
        runs += read.session.runs
        corrected.add(read.session.corrected)
        _check_alike(file.gyroscope, corrected)
        axis = axis or read.session.axis
        warnings += read.warnings
        if not guessed or any(g.asks for g in read.guessed):
            guessed = tuple(replace(g, file=file.gyroscope.name) for g in read.guessed) if names else read.guessed
        rows += tuple(row for row in read.first_rows if row.map not in {other.map for other in rows})
        for what, count in read.repaired.items():
            repaired[what] = repaired.get(what, 0) + count
    session = Session(
        sample_rate_hz=runs[0].sample_rate_hz, runs=tuple(runs), axis=axis or "z",  # type: ignore[arg-type]
        sensor=options.sensor, full_scale_dps=options.full_scale_dps, lsb_dps=options.scaling.lsb_dps,
        reference=options.reference, corrected=corrected.pop(),
    )  # fmt: skip
    second = options.second
    if second is not None and not second.later_s and (later_s := later_by_s(session)):
        found = read_recording(source, replace(given, second=replace(second, later_s=later_s)), existing)
        return replace(found, warnings=(*found.warnings, _shifted(second, later_s)), guessed=(*guessed, *of_reference.guessed))
    session, slowed = _of_one_rate(session, options.resample_hz, existing)
    repaired |= {"resampled": slowed} if slowed else {}
    return Imported(
        session, (*guessed, *of_reference.guessed), tuple(warnings), repaired, (*rows, *of_reference.first_rows), len(files)
    )


def _shifted(second: SecondFile, later_s: float) -> Warning:
    text = f"{second.path.name}: {later_s:+.2f} s were added to its times, as its motion fits the readings only there"
    return Warning("reference_shifted", None, None, text)


def _decided_by_another(
    asked: Sequence[Guess], file: Files, files: Sequence[Files], options: Options
) -> tuple[Guess, ...]:
    """The guess at the first other file of the same columns that decides their units; empty if none does."""

    def columns(guessed: Sequence[Guess]) -> set[tuple[str, str]]:
        return {(m.target, m.column) for m in (ColumnMap.parse(g.map, options.scaling) for g in guessed)}

    others = (mapped_columns(other, options).guessed for other in files if other is not file)
    return next((g for g in others if columns(g) == columns(asked) and not any(each.asks for each in g)), ())


def _check_alike(file: Path, corrected: set[str | None]) -> None:
    """Raise InputError if some of a session's readings were corrected before, and others were not or by something else."""
    if len(corrected) > 1:
        kinds = " and ".join(sorted(f"readings of {by}" if by else "a sensor's own readings" for by in corrected))
        raise InputError(f"{file}: a session cannot hold {kinds}; import this recording into a session of its own")


def _perhaps_time(source: Source) -> str:
    """The column that is named as a time, as ``--map`` takes it, in words that go on with an error."""
    named = named_as_time(source.names or source.frame.columns)
    there = source.frame.columns
    named = [n for n in named if n not in there or (source.start_s(ColumnMap("t_s", n)) and is_forward(source, n))]
    name = next(iter((*named, *like_time(source))), None)
    return f"; perhaps --map 't_s={name}:{stated_unit(name, 't_s') or 'UNIT'}'" if name is not None else ""


def _read_file(files: Files, options: Options, number: int, names: Sequence[str]) -> Imported:
    """The runs of one recording; ``number`` is the first run's, and ``names`` are those of all files where each is a run."""
    path, mapped = files.gyroscope, mapped_columns(files, options)
    mappings, source = mapped.mappings, mapped.source
    axis = options.axis or only_axis(mappings)
    rate_hz, warnings = _known_rate(source, mappings, options.scaling.rate_hz)
    table = convert(source, mappings, rate_hz)
    timed = _rate_and_unit(source, mappings, table, rate_hz)
    table, rate_hz = timed.table, timed.rate_hz
    warnings += timed.warnings
    _check_one_recording(source, mappings, table, options.cuts or [Cut("all")])
    warnings += _of_table(source, table, mapped.guessed)
    motion = _motion(options, source, mappings, table.columns["t_s"])
    warnings += [Warning("line_damaged", None, None, motion.damage)] if motion is not None and motion.damage else []
    stem = stem_of(path)
    labels = check_meta(labels_of(stem), str(path))
    left = {"table_rate_dps"} if options.gravity else set[str]()

    def named_so(name: str) -> dict[str, Any]:
        """What a run's name says, as ``x_rot`` of its axis, or its file's name; a run by hand has no rate."""
        found = labels | check_meta(labels_of(name), f"run {name}")
        return {key: value for key, value in found.items() if key not in left and key not in options.defaults}

    defaults = {**labels, **options.defaults}
    if options.gravity or ("turn_deg" in options.defaults and "table_rate_dps" not in options.defaults):
        defaults.pop("table_rate_dps", None)
    kind = "hands" if options.gravity else _face(defaults, table.columns, defaults.get("axis") or axis)
    cuts = list(options.cuts) or [Cut(stem if names else f"{number:03d}_{kind}")]
    power_on_s = options.defaults.get("power_on_s")
    of_runs = {key: value for key, value in options.defaults.items() if key != "power_on_s"}
    cuts = with_meta(cuts, options.run_meta, of_runs, named_so, names)
    rests = 0
    if options.rates:
        cuts = plateaus.at_rates(source.label, table.columns, cuts[0], options.rates)
    elif not options.cuts and options.needs_rate and not options.gravity and not (motion or has_reference(table.columns)):
        cuts = plateaus.cut(source.label, table.columns, cuts[0])
        rests = len(cuts) - 1
    cuts = [_since_power_on(cut, table, power_on_s) for cut in cuts]
    check_names_differ(cuts)
    evened: list[Warning] = []
    runs = [
        _run(source, mappings, table, cut, number + i, axis, rate_hz, options, evened.append, motion)
        for i, cut in enumerate(cuts)
    ]
    times = sum(len(run) for run in runs if run.file in {w.file for w in evened if w.code == "sample_rate"})
    hung = sum(w.code == "constant_reading" for w in evened)
    counts = {"rests": rests, "hung": hung, "times": times, "rows": table.left_out, "twice": table.repeated}
    counts |= {"cells": table.cells, "stamps": table.stamps, "orientations": table.orientations}
    counts["signs"] = sum(source.signed.get(m.column, 0) for m in mappings)
    rates = [m.column for m in mappings if m.target in REQUIRED[1:]]
    corrected = corrected_by(rates, source.names or source.frame.columns, path, source.label.removeprefix(str(path)))
    session = Session(
        sample_rate_hz=runs[0].sample_rate_hz, runs=tuple(runs), axis=axis, corrected=corrected,  # type: ignore[arg-type]
    )  # fmt: skip
    counts = {what: count for what, count in counts.items() if count}
    evened += [warning for run in runs if (warning := read_too_fast(run)) is not None]
    return Imported(session, mapped.guessed, (*warnings, *evened), counts, first_rows(source, mappings, mapped.guessed))


def _of_table(source: Source, table: Converted, guessed: Sequence[Guess]) -> list[Warning]:
    """What came damaged in a table, and a temperature that tells nothing, unless the guess says that."""
    out = [Warning("line_damaged", None, None, f"{source.label}: {table.damage}")] if table.damage else []
    temp_c = table.columns.get("temp_c")
    stated = not any(g.map.startswith("temp_c=") for g in guessed)
    if stated and temp_c is not None and tells_nothing(temp_c):
        text = f"{source.label}: the temperature is {temp_c[0]:.4g} °C in every row, which tells nothing; leave temp_c out"
        out.append(Warning("temp_unit", None, None, text))
    return out


def _motion(options: Options, source: Source, mappings: Sequence[ColumnMap], t_s: Array) -> Motion | None:
    """The reference of a second file, if there is one, on the clock of the samples, whose stamps are ``t_s`` [n], s."""
    if options.second is None:
        return None
    start_s = next((source.start_s(m) for m in mappings if m.target == "t_s"), 0.0)
    return options.second.motion(float(t_s[0]), float(t_s[-1]), start_s, options.scaling)


def _check_one_recording(source: Source, mappings: Sequence[ColumnMap], table: Converted, cuts: Sequence[Cut]) -> None:
    """Raise InputError where another recording begins within one of the cuts."""
    t_s = table.columns["t_s"]
    start_s = next((source.start_s(m) for m in mappings if m.target == "t_s"), 0.0)
    found = begins(t_s, np.array([table.place(int(row)) for row in table.headers], dtype=np.intp), start_s)
    for cut in cuts:
        start, end = _place(table, cut.start, 0), _place(table, cut.end, table.size)
        inside = [place for place in found if start < place < end]
        if inside:
            back_s = t_s[inside[0] - 1] - t_s[inside[0]]
            last = -1 if cut.end is None else table.row(end - 1) + 1
            rows = [*(table.row(place) for place in (start, *inside)), last]
            raise InputError(
                f"{source.row(rows[1])}: time goes back by {back_s:.4g} s, to another recording; {advice(rows)}"
            )


def _known_rate(source: Source, mappings: Sequence[ColumnMap], rate_hz: float | None) -> tuple[float | None, list[Warning]]:
    """The sample rate of ``--rate-hz``, Hz, or without a time the one that the file states above its table, which is told.

    InputError if neither is there.
    """
    if rate_hz is not None or "t_s" in {m.target for m in mappings}:
        return rate_hz, []
    if (rate_hz := stated_rate_hz(source.above)) is None:
        what = "no time: map t_s, or give --rate-hz where samples are evenly spaced"
        raise InputError(f"{source.label}: {what}{_perhaps_time(source)}{source.not_taken(mappings)}")
    text = f"{source.label}: no time is mapped; a line above the table states {rate_hz:g} Hz, which is taken"
    return rate_hz, [Warning("sample_rate", None, None, text)]


@dataclass(frozen=True)
class _Timed:
    """A table with its time in seconds, and its nominal sample rate (None: that of its times)."""

    table: Converted
    rate_hz: float | None
    warnings: tuple[Warning, ...] = ()


def _rate_and_unit(source: Source, mappings: Sequence[ColumnMap], table: Converted, rate_hz: float | None) -> _Timed:
    """The nominal rate is the stated one unless the times contradict it.

    A time without a stated unit that is a power of 1000 off the stated rate is in ms, us or ns.
    """
    time = next((m for m in mappings if m.target == "t_s"), None)
    t_s = table.columns["t_s"]
    if time is None or rate_hz is None or t_s.size < 3 or goes_back(t_s) or t_s[-1] <= t_s[0]:
        return _Timed(table, rate_hz)
    ratio = rate_hz * period_s(t_s)
    if abs(ratio - 1) <= STATED:
        return _Timed(table, rate_hz)
    unit = next((u for u in TIME_UNITS if time.unit is None and abs(ratio / u - 1) <= STATED), None)
    if unit is not None:
        return _Timed(replace(table, columns={**table.columns, "t_s": t_s / unit}), rate_hz)
    text = (
        f"{source.label}: {time.column} has {rate_hz / ratio:.5g} samples a second, --rate-hz says {rate_hz:g}. The session "
        "has the rate of its times; give their unit (--map t_s=COLUMN:ms), or leave t_s out to number the samples"
    )
    return _Timed(table, None, (Warning("sample_rate", None, None, text),))


def _run(
    source: Source, mappings: Sequence[ColumnMap], table: Converted, cut: Cut, index: int, axis: str, rate_hz: float | None,
    options: Options, warn: Callable[[Warning], None], motion: Motion | None,
) -> Run:  # fmt: skip
    """One cut as a run, checked; its time starts at 0. ``motion`` is the reference of a second file."""
    start = _place(table, cut.start, 0)
    end = _place(table, cut.end, table.size)
    if not 0 <= start < end <= table.size or end - start < 2:
        what = f"it must hold two samples at least, and the table has {table.height} rows"
        raise InputError(f"{source.label}: run {cut.name}: {what}")
    columns = {name: values[start:end] for name, values in table.columns.items()}
    file = f"{cut.name}.csv"
    begin_s = float(columns["t_s"][0])
    columns["t_s"], warning = even(
        columns["t_s"] - begin_s if begin_s else columns["t_s"], lambda place: source.row(table.row(start + place)), file,
        lambda place: f"take the rows before it by --run NAME:{table.row(start)}:{table.row(start + place)}, or number the "
        "samples with --rate-hz and no t_s",
        [columns[name] for name in REQUIRED[1:] if name in columns],
    )  # fmt: skip
    if warning is not None:
        warn(warning)
    columns |= motion.at(columns["t_s"] + begin_s) if motion else {}
    if options.needs_rate and not options.gravity and cut.meta.get("turn_deg") is None:
        columns, warning = without_hung(columns, file)
        if warning is not None:
            warn(warning)
    end = start + columns["t_s"].size
    if any(m.is_angle_of_rate for m in mappings):
        columns["rate_ref_dps"] = rate_of(columns["t_s"], columns["rate_ref_dps"])
    meta = cut.meta
    run_axis = meta.get("axis") or axis
    if options.needs_rate and f"g{run_axis}_dps" not in columns:
        raise InputError(f"run {cut.name}: its axis is {run_axis}, and nothing is mapped to g{run_axis}_dps; see --axis")
    columns |= {name: np.zeros(end - start) for name in REQUIRED[1:] if name not in columns}
    if options.needs_rate:
        _check_reference(cut, columns, options.reference, source.not_taken(mappings))
    run = Run(
        index, file, meta.get("scenario", "s000"), _face(meta, columns, run_axis), run_axis,  # type: ignore[arg-type]
        meta.get("table_rate_dps"), meta.get("turn_deg"), meta.get("day"), meta.get("power_on_s"),
        rate_hz or _nominal_rate_hz(columns["t_s"]),
        frame=check_table(_frame(columns), f"{source.label}: run {cut.name}"), table_rate_se_dps=meta.get("table_rate_se_dps"),
        turn_se_deg=meta.get("turn_se_deg"), reference=options.reference,
    )  # fmt: skip
    if options.needs_rate:
        check_rate_known(run)
    return run


def _since_power_on(cut: Cut, table: Converted, power_on_s: float | None) -> Cut:
    """The cut with the time since power-on of its first sample; ``power_on_s`` is that of the table's first one."""
    if power_on_s is None or "power_on_s" in cut.meta:
        return cut
    t_s = table.columns["t_s"]
    later_s = float(t_s[min(max(_place(table, cut.start, 0), 0), t_s.size - 1)] - t_s[0])
    return replace(cut, meta={**cut.meta, "power_on_s": round(power_on_s + later_s, 6)})


def _face(meta: Mapping[str, Any], columns: Mapping[str, Array], axis: str) -> str:
    """The face of a run. If it is not stated, the accelerometer says it of a rest; it is up otherwise."""
    acc_g = [columns[name] for name in ("ax_g", "ay_g", "az_g") if name in columns]
    lies_down = meta.get("table_rate_dps") == 0 and len(acc_g) == 3 and points_up(np.column_stack(acc_g), AXES.index(axis)) < 0
    return str(meta.get("face", "down" if lies_down else "up"))


def _check_reference(cut: Cut, columns: Mapping[str, Array], reference: Reference, not_taken: str) -> None:
    """Raise InputError unless a run has a true rate, or the accelerations that take its place."""
    stated = "table_rate_dps" in cut.meta or cut.meta.get("turn_deg") is not None or has_reference(columns)
    if reference.kind != "gravity":
        if not stated:
            raise InputError(
                f"run {cut.name}: its true rate is not known; give --rate (0: it lay still), --turn-deg, or --gravity "
                f"(turned by hand), or map rate_ref_dps or ref_angle_deg{not_taken}"
            )
    elif stated:
        raise InputError(f"run {cut.name}: the reference is gravity, and a true rate is given too; leave out one of them")
    elif not all(f"a{a}_g" in columns for a in AXES):
        raise InputError(f"run {cut.name}: the reference is gravity; map ax_g, ay_g and az_g, as by --map ax_g=COLUMN:m/s2")


def _frame(columns: Mapping[str, Array]) -> pl.DataFrame:
    frame = pl.DataFrame({name: columns[name] for name in TARGETS if name in columns})
    missing = [name for name in frame.columns if name in OPTIONAL and not all_finite(columns[name])]
    return frame.with_columns(pl.col(missing).fill_nan(None)) if missing else frame


def _place(table: Converted, edge: Edge | None, default: int) -> int:
    """The place among the converted rows of an edge, which counts the table's samples or seconds."""
    if edge is None:
        return default
    if not edge.in_seconds:
        return min(table.place(int(edge.value)), table.size) if edge.value <= table.height + table.left_out else -1
    return int(np.searchsorted(np.maximum.accumulate(table.columns["t_s"]), edge.value - 0.5e-6))


def _nominal_rate_hz(t_s: Array) -> float:
    return float(f"{1.0 / period_s(t_s):.5g}")


def _of_one_rate(session: Session, resample_hz: float | None, existing: Session | None) -> tuple[Session, int]:
    """The session with its faster runs at the rate of the slowest, or as asked for, and how many samples were averaged."""
    rates = [run.sample_rate_hz for run in session.runs]
    rate_hz = resample_hz or (existing.sample_rate_hz if existing else min(rates))
    slow = next((run for run in session.runs if run.sample_rate_hz < rate_hz * (1 - SAME_RATE)), None)
    if slow is not None:
        raise InputError(
            f"run {slow.file}: {slow.sample_rate_hz:g} Hz is slower than {rate_hz:g} Hz; one session holds one rate: import "
            f"the slowest recording first, or all with --resample-hz {slow.sample_rate_hz:g}"
        )
    runs, averaged = [], 0
    for run in session.runs:
        if run.sample_rate_hz > rate_hz * (1 + SAME_RATE):
            averaged += len(run)
            columns = resampled({name: run.table[name].to_numpy() for name in run.table.columns}, rate_hz)
            run = replace(run, frame=_frame(columns), sample_rate_hz=rate_hz)
        runs.append(run)
    return replace(session, runs=tuple(runs), sample_rate_hz=rate_hz), averaged


def _append(folder: Path, session: Session, runs: list[Run]) -> Session:
    """Add runs to a session: all of their files first, session.toml last."""
    header = read_header(folder).model_dump(exclude_none=True)
    entries = header.pop("run")
    for run in runs:
        if (folder / run.file).exists():
            raise InputError(f"{folder / run.file}: exists already; name the run otherwise with --run NAME::")
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
