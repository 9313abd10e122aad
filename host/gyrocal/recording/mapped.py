"""Which files make a recording, and which of its columns are taken: those that were given, or a guess."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gyrocal.errors import InputError
from gyrocal.recording import joined, readers
from gyrocal.recording.column_map import TARGETS, ColumnMap, has_reference
from gyrocal.recording.column_names import GYRO, every_named
from gyrocal.recording.cut import with_meta
from gyrocal.recording.guess import ACCELERATION, Guess, guess, time_column
from gyrocal.recording.guess_units import Known, check_signed, typical_rate_dps
from gyrocal.recording.import_options import Options
from gyrocal.recording.joined import Files
from gyrocal.recording.matrix_columns import is_of_matrix, with_quaternion
from gyrocal.recording.one_sensor import check_one_sensor
from gyrocal.recording.padding import erased_from
from gyrocal.recording.session import AXES
from gyrocal.recording.signs import check_decimal, with_signs
from gyrocal.recording.source import Source
from gyrocal.recording.split_stamps import is_whole_stamp, with_whole_stamps
from gyrocal.recording.table import REQUIRED

TABLES = (".csv", ".tsv", ".txt", ".gz", ".parquet", ".npz", ".mat", ".bag", ".mcap", ".ulg")
COUNTS = "counts"
"""The unit of raw readings."""
BAG = "metadata.yaml"
"""A folder with this file is a ROS 2 bag."""


PLAIN = Options()


@dataclass(frozen=True)
class Mapped:
    """A recording's table with the mappings of its columns, and those of them that were guessed."""

    mappings: list[ColumnMap]
    source: Source
    guessed: tuple[Guess, ...] = ()


def data_file(path: Path) -> Path:
    """The table in an EuRoC folder; any other path as it is."""
    return next((p for p in (path / "data.csv", path / "imu0" / "data.csv") if p.is_file()), path)


def is_log(path: Path) -> bool:
    """True for what `import` reads: a file, a ROS 2 bag, or a folder of tables without session.toml."""
    if not path.is_dir() or (path / BAG).is_file():
        return True
    if (path / "session.toml").is_file():
        return False
    return data_file(path) != path or any(p.suffix.lower() in TABLES for p in path.iterdir())


def files_of(path: Path, others: Sequence[Path | str] = ()) -> list[Files]:
    """The recordings in a file, or in a folder that is no ROS 2 bag; ``others`` are files that are joined to a file."""
    if not path.is_dir() or (path / BAG).is_file():
        return [joined.of_stated(path, others)]
    if others:
        raise InputError(f"--join: {path} is a folder; give the file of the gyroscope itself")
    found = sorted(p for p in path.iterdir() if p.suffix.lower() in TABLES)
    if not found:
        hint = "; the layout is that of EuRoC: give --format euroc" if data_file(path) != path else f" ({', '.join(TABLES)})"
        raise InputError(f"{path}: no tables in this folder{hint}")
    return joined.recordings(found)


def mapped_columns(files: Files, options: Options) -> Mapped:
    """The given mappings. Those that are missing are guessed if no gyroscope is mapped, and no column has a session's name."""
    scaling = options.scaling
    mappings = list({m.target: m for m in (ColumnMap.parse(text, scaling) for text in options.maps)}.values())
    names, targets = [m.column for m in mappings], {m.target for m in mappings}
    complete = any(f"g{a}_dps" in targets for a in AXES)
    source = source_of(files, names if complete else (), options)
    source.check_has(names)
    source = _without_erased(source)
    readings = _readings(source, mappings, complete)
    check_decimal(source, readings)
    source = with_signs(source, readings)
    check_signed(source, [m.column for m in mappings if m.unit == COUNTS and not m.offset])
    if complete:
        check_one_sensor(source, names)
        return Mapped(mappings, source)
    if not mappings and set(REQUIRED) <= set(source.frame.columns):
        return Mapped([ColumnMap(name, name) for name in TARGETS if name in source.frame.columns], source)
    cuts = with_meta(options.cuts, options.run_meta, options.defaults) if options.cuts else []
    each = [cut.meta for cut in cuts] or [options.defaults]
    all_runs = all({"table_rate_dps", "turn_deg"} & set(meta) for meta in each)
    stated = options.gravity or options.second is not None or all_runs
    wanted = options.needs_rate and not (stated or has_reference(targets))

    def reference_dps() -> float | None:
        if options.second is not None:
            return options.second.typical_rate_dps(scaling)
        columns = {m.target: source.numbers(m) for m in mappings}
        time = time_column(source)
        if "t_s" not in columns and time is not None:
            columns["t_s"] = source.numbers(ColumnMap.parse(time.map, scaling))
        return typical_rate_dps(columns["t_s"], columns) if "t_s" in columns else None

    known = Known(options.defaults.get("table_rate_dps"), options.defaults.get("turn_deg"), reference_dps, cuts, options.rates)
    found = guess(source, scaling, reference=wanted, known=known)
    guessed = tuple(g for g in found if g.map.partition("=")[0] not in targets)
    return Mapped([*mappings, *(ColumnMap.parse(g.map, scaling) for g in guessed)], source, guessed)


def _without_erased(source: Source) -> Source:
    """The table without the rows of erased memory behind its last reading."""
    end = erased_from(source.frame)
    height = source.frame.height
    if end == height:
        return source
    return replace(source, frame=source.frame.head(end), beside=source.beside.head(end), erased=height - end)


def _readings(source: Source, mappings: Sequence[ColumnMap], complete: bool) -> list[str]:
    """The columns of a gyroscope and an accelerometer that are mapped without a zero, and unless all are, those named so."""
    targets = {f"{quantity}{a}_{unit}" for quantity, unit in (("g", "dps"), ("a", "g")) for a in AXES}
    mapped = [m.column for m in mappings if m.target in targets and not m.offset]
    named = [] if complete else [n for words in (GYRO, ACCELERATION) for a in AXES for n in every_named(source, words, a)]
    shifted = {m.column for m in mappings if m.offset}
    return [name for name in dict.fromkeys((*mapped, *named)) if name not in shifted]


def source_of(files: Files, names: Sequence[str] = (), options: Options = PLAIN) -> Source:
    """The table of a recording, with columns that are computed: those of other sensors, quaternions, and stamps."""
    computed = bool(files.others) or any(is_of_matrix(name) or is_whole_stamp(name) for name in names)
    asked = () if computed else names

    def one(path: Path) -> Source:
        if path != files.gyroscope:
            return readers.read(path, columns=files.columns.get(path), option="--join " if options.joined else "")
        return readers.read(path, asked, options.columns, options.skip, options.topic)

    return with_whole_stamps(with_quaternion(joined.read(files, one, stated=bool(options.joined))))


def only_axis(mappings: Sequence[ColumnMap]) -> str:
    """The axis of the only rate that is mapped; z where there are several."""
    mapped = [a for a in AXES if f"g{a}_dps" in {m.target for m in mappings}]
    return mapped[0] if len(mapped) == 1 else "z"
