"""The worker's part of the import: a file looked at with a guess of its columns, and imported as a new session."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gyrocal.errors import InputError
from gyrocal.web.pictures.recorded import Recorded, recorded

if TYPE_CHECKING:
    from gyrocal.recording.cut import Cut
    from gyrocal.recording.importer import Imported
    from gyrocal.recording.steady import Stretch

KINDS = (".csv", ".txt", ".tsv", ".gz", ".parquet", ".npz", ".mat", ".bag", ".mcap", ".ulg")
"""Endings of the files that are offered; what a file holds decides how it is read."""
SHOWN_COLUMNS = 60


@dataclass(frozen=True)
class Asked:
    """What a person says of a file. ``maps`` empty: columns and units are guessed. None: not said."""

    maps: tuple[str, ...] = ()
    face: str | None = None
    table_rate_dps: float | None = None
    axis: str | None = None
    sample_rate_hz: float | None = None
    lsb_dps: float | None = None
    sensor: str | None = None
    gravity: bool = False
    """True if the sensor was turned by hand between rests, so that no rate is known."""
    turn_deg: float | None = None
    """The run's known net angle."""
    cuts: tuple[Cut, ...] = ()
    """The runs to take out of the file; empty: the whole file is one."""
    reference: Path | None = None
    """A second file that holds the true rates, angles or orientations."""
    own_clock: bool = False
    """True if another clock than the sensor's stamped the reference."""


@dataclass(frozen=True)
class Looked:
    """What a file would become: its columns, the mappings (as ``gyrocal import --map`` takes them) with the reason of each."""

    columns: list[str]
    maps: list[tuple[str, str]] = field(default_factory=list)
    problem: str = ""
    """Why it cannot be imported so; empty if it can."""
    told: str = ""
    warnings: list[dict[str, Any]] = field(default_factory=list)
    recorded: Recorded | None = None
    """The columns over time; None with a problem."""
    stretches: list[Stretch] = field(default_factory=list)
    """Stretches of even rate, which may be the runs of the file; none if it holds one rate, or its true rate."""
    of_reference: list[tuple[str, str]] = field(default_factory=list)
    """The mappings of the second file, with their reasons."""


def look(file: Path, asked: Asked) -> Looked:
    """Read a file without writing anything."""
    from gyrocal.plausibility import check
    from gyrocal.recording import readers
    from gyrocal.recording.column_map import Scaling
    from gyrocal.recording.guess import guess

    try:
        source = readers.read(file)
        columns = list(source.frame.columns)[:SHOWN_COLUMNS]
    except InputError as error:
        return Looked([], problem=str(error))
    maps = [(text, "as you said") for text in asked.maps]
    try:
        if not maps:
            maps = [(g.map, g.why) for g in guess(source, Scaling(asked.sample_rate_hz, asked.lsb_dps))]
        found = _read(file, asked)
    except InputError as error:
        return Looked(columns, maps, str(error), stretches=_stretches(file, asked))
    session = found.session
    seconds = sum(run.duration_s for run in session.runs)
    samples = sum(len(run) for run in session.runs)
    runs = "1 run" if len(session.runs) == 1 else f"{len(session.runs)} runs"
    told = f"{runs}, {samples:,} samples at {session.sample_rate_hz:g} Hz, {seconds:.1f} s"
    if found.repaired:
        told += "; repaired: " + ", ".join(f"{count} {what}" for what, count in found.repaired.items())
    warnings = [w.to_json() for w in (*found.warnings, *check(session))]
    of_reference = [(g.map, g.why) for g in found.guessed if g.option == "--ref-map"]
    of_file = _stretches(file, asked) if session.runs[0].table_rate_dps is not None else []
    return Looked(columns, maps, "", told, warnings, recorded(session), of_file, of_reference)


def _stretches(file: Path, asked: Asked) -> list[Stretch]:
    """The stretches of even rate in the whole file, whatever was said of its rate; none if it cannot be read."""
    from gyrocal.recording.steady import stretches

    if asked.gravity or asked.reference is not None or asked.turn_deg is not None:
        return []
    try:
        (run,) = _read(file, replace(asked, cuts=()), needs_rate=False).session.runs
    except InputError:
        return []
    return stretches(run)


def take(file: Path, asked: Asked, out: Path) -> None:
    """Import a file as the new session ``out``."""
    _read(file, asked).save(out)


def _read(file: Path, asked: Asked, *, needs_rate: bool = True) -> Imported:
    from gyrocal.recording.column_map import Scaling
    from gyrocal.recording.import_options import Options
    from gyrocal.recording.importer import read_recording
    from gyrocal.recording.second_file import SecondFile

    clock = "own" if asked.own_clock else "same"
    second = None if asked.reference is None else SecondFile(asked.reference, (), clock)
    facts = {"face": asked.face, "table_rate_dps": asked.table_rate_dps, "turn_deg": asked.turn_deg}
    return read_recording(file, Options(
        maps=asked.maps, defaults={key: value for key, value in facts.items() if value is not None}, axis=asked.axis,
        scaling=Scaling(asked.sample_rate_hz, asked.lsb_dps), sensor=asked.sensor, gravity=asked.gravity,
        cuts=asked.cuts, second=second, clock=clock, needs_rate=needs_rate,
    ))  # fmt: skip
