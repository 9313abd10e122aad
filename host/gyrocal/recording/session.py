"""A session: what a folder with ``session.toml`` and one table a run holds, opened and saved."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from gyrocal.errors import InputError
from gyrocal.files import new_folder
from gyrocal.recording.header import (
    FORMAT,
    Axis,
    Reference,
    RunEntry,
    SessionFile,
    check_inside,
    folder_of,
    read_header,
    write_header,
)
from gyrocal.recording.registration import ReferenceParameter, RegistrationFit
from gyrocal.recording.run import AXES, GAP_PERIODS, NO_RATE, Array, Run
from gyrocal.recording.table import write_table
from gyrocal.shown import Shown

__all__ = ["AXES", "GAP_PERIODS", "Array", "Axis", "Run", "Session", "run_entry"]


@dataclass(frozen=True, repr=False)
class Session(Shown):
    """A folder of runs; ``runs`` keep the file's order."""

    sample_rate_hz: float
    runs: tuple[Run, ...]
    axis: Axis = "z"
    sensor: str | None = None
    full_scale_dps: float | None = None
    lsb_dps: float | None = None
    latitude_deg: float | None = None
    path: Path | None = None
    accept: tuple[str, ...] = ()
    """Warnings that the user overrules, each a ``code`` or ``code:axis``."""
    unread: tuple[str, ...] = ()
    """Keys of session.toml that no command reads."""
    reference: Reference = field(default_factory=Reference)
    """The table ``[reference]``: what is known of references and thermometers."""
    board: str | None = None
    rig: str | None = None
    line: str | None = None
    made_on: str | None = None
    """The origin of a board in a fleet: serial number, rig, production line and date (ISO), as free text."""
    corrected: str | None = None
    """What had corrected the readings before they were recorded, an autopilot for example; None for a sensor's own readings."""
    registration_fit: RegistrationFit | None = None
    """The estimate of the runs' ``registration``; None if it was not estimated."""

    @staticmethod
    def open(path: str | Path, *, check: bool = True) -> Session:
        """Read and check a session: its folder or its session.toml. With ``check=False`` tables are read when first used."""
        folder = folder_of(Path(path))
        header = read_header(folder)
        session = Session(
            sample_rate_hz=header.sample_rate_hz,
            runs=tuple(_run(i, entry, header, folder) for i, entry in enumerate(header.run)),
            axis=header.axis,
            sensor=header.sensor,
            full_scale_dps=header.full_scale_dps,
            lsb_dps=header.lsb_dps,
            latitude_deg=header.latitude_deg,
            path=folder,
            accept=tuple(header.accept or ()),
            unread=(*(header.model_extra or ()), *(f"reference.{key}" for key in header.reference.model_extra or ())),
            reference=header.reference,
            board=header.board,
            rig=header.rig,
            line=header.line,
            made_on=None if header.made_on is None else str(header.made_on),
            corrected=header.corrected,
        )
        for run in session.runs:
            check_inside(folder, run.file)
            if not os.path.isfile(folder / run.file):  # False too for a name that no file can have
                raise InputError(f"{folder / run.file}: no such file (named by {folder / 'session.toml'})")
            if check:
                check_rate_known(run)
        return session.with_runs(following(session.runs)) if check else session

    @staticmethod
    def from_frames(frames: Sequence[Any], runs: Sequence[Mapping[str, Any]], **header: Any) -> Session:
        """A session of frames (polars, pandas, or arrays by name) with a session's columns; ``runs`` are their facts.

        The facts have the names of ``[[run]]`` in session.toml (``face``, ``table_rate_dps``, ...), ``header`` those above it
        (``axis``, ``sensor``, ...). Without ``sample_rate_hz`` it is that of the first frame. Raises InputError.
        """
        from gyrocal.recording.frames import session_of

        return session_of(frames, runs, **header)

    def about(self, axis: str) -> Session:
        """The same session with the true rate about another axis of the sensor in the runs whose reference has three axes."""
        return self if not self.three_axes else self.with_runs(run.about(axis) for run in self.runs)

    @property
    def registration_parameters(self) -> tuple[ReferenceParameter, ...]:
        """The estimated parameters of the reference's frame and clock."""
        return () if self.registration_fit is None else self.registration_fit.parameters

    @property
    def three_axes(self) -> bool:
        """True if a run's reference measures the true rate about all three axes."""
        return any(run.three_axes for run in self.runs)

    def with_runs(self, runs: Iterable[Run]) -> Session:
        """The same session with other runs."""
        return replace(self, runs=tuple(runs))

    @property
    def rows(self) -> int:
        """Samples of all runs."""
        return sum(map(len, self.runs))

    @property
    def scenarios(self) -> list[str]:
        """Scenario names in order of first appearance."""
        return list(dict.fromkeys(run.scenario for run in self.runs))

    @property
    def days(self) -> list[int]:
        """Day labels in order of first appearance; runs without one are left out."""
        return list(dict.fromkeys(run.day for run in self.runs if run.day is not None))

    def by_scenario(self) -> Iterator[tuple[str, list[Run]]]:
        """Each scenario (power cycle) with its runs, in order of first appearance."""
        for name in self.scenarios:
            yield name, [run for run in self.runs if run.scenario == name]

    def save(self, path: str | Path, *, parquet: bool = False) -> Session:
        """Write the session into a new folder; InputError if it exists already."""
        folder = Path(path)
        if folder.exists():
            raise InputError(f"{folder}: exists already; choose another name or remove it")
        with new_folder(folder) as partial:
            entries = []
            for run in self.runs:
                name = str(Path(run.file).with_suffix(".parquet" if parquet else ".csv"))
                write_table(run.table, partial / name)
                entries.append(run_entry(run, name, self.axis))
            write_header(partial, self.header(), entries)
        return Session.open(folder, check=False)

    def header(self) -> dict[str, Any]:
        """session.toml's keys above the runs."""
        return {
            "format": FORMAT, "sensor": self.sensor, "axis": self.axis, "sample_rate_hz": self.sample_rate_hz,
            "full_scale_dps": self.full_scale_dps, "lsb_dps": self.lsb_dps, "latitude_deg": self.latitude_deg,
            "board": self.board, "rig": self.rig, "line": self.line, "made_on": self.made_on,
            "corrected": self.corrected, "accept": list(self.accept) or None,
            "reference": self.reference.model_dump(exclude_none=True, exclude_defaults=True) or None,
        }  # fmt: skip


def run_entry(run: Run, file: str, session_axis: str) -> dict[str, Any]:
    """One ``[[run]]`` for :func:`write_header`."""
    return {
        "file": file, "scenario": run.scenario, "face": run.face, "table_rate_dps": run.table_rate_dps,
        "table_rate_se_dps": run.table_rate_se_dps, "axis": None if run.axis == session_axis else run.axis,
        "turn_deg": run.turn_deg, "turn_se_deg": run.turn_se_deg, "day": run.day, "power_on_s": run.power_on_s,
    }  # fmt: skip


def _run(index: int, entry: RunEntry, header: SessionFile, folder: Path) -> Run:
    return Run(
        index, entry.file, entry.scenario, entry.face, entry.axis or header.axis, entry.table_rate_dps, entry.turn_deg,
        entry.day, entry.power_on_s, header.sample_rate_hz, path=folder / entry.file,
        lsb_dps=header.lsb_dps, latitude_deg=header.latitude_deg, unread=tuple(entry.model_extra or ()),
        table_rate_se_dps=entry.table_rate_se_dps, turn_se_deg=entry.turn_se_deg, reference=header.reference,
    )  # fmt: skip


def following(runs: Sequence[Run]) -> list[Run]:
    """The runs, each with those that were recorded in its power cycle before it."""
    out: list[Run] = []
    for run in runs:
        out.append(run.after(earlier for earlier in out if earlier.scenario == run.scenario))
    return out


def check_rate_known(run: Run) -> None:
    """InputError unless a run has a true rate, or what stands in its place, and its reference can be read."""
    where = run.path or run.file
    if run.reference.kind == "gravity":
        _check_hands(run)
        return
    if run.reference_dps is None and run.table_rate_dps is None and run.turn_deg is None:
        if run.measured_rates is not None:
            raise InputError(f"{where}: {NO_RATE}")
        raise InputError(f"{where}: no true rate: give table_rate_dps or turn_deg in session.toml, or a reference's columns")


def _check_hands(run: Run) -> None:
    """InputError unless a run whose reference is gravity has an accelerometer and no true rate."""
    where = run.path or run.file
    if run.acc_g is None:
        raise InputError(f"{where}: the reference is gravity, and the columns ax_g, ay_g, az_g are not there; record them")
    if run.table_rate_dps is not None or run.turn_deg is not None or run.reference_dps is not None:
        raise InputError(
            f"{where}: the reference is gravity, and a true rate is given too; remove it, or kind = \"gravity\" in session.toml"
        )
