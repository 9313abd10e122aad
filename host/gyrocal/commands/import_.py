"""``gyrocal import``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyrocal.commands import AsJson

if TYPE_CHECKING:
    from gyrocal.recording.cut import Cut
    from gyrocal.recording.import_options import Options
    from gyrocal.recording.importer import Imported
    from gyrocal.recording.second_file import SecondFile
    from gyrocal.recording.session import Session
    from gyrocal.warning import Warning

CUT = "NAME:START:END[:key=value,...]"
REPAIRED = {
    "rests": "runs at rest were made of the still parts before and after a known turn",
    "hung": "runs lost the stretches in which the sensor hung and repeated one reading",
    "times": "samples are of runs whose times were mended, as the notes say",
    "rows": "rows without a sample were left out",
    "twice": "rows that repeat the row before, time and all, were left out",
    "cells": "cells of text in optional columns were taken as missing",
    "stamps": "damaged times were put onto the course of the others",
    "orientations": "orientations whose quaternion has not the length 1 were taken as missing",
    "signs": "counts of 16 bits were stored without their sign: 65536 was subtracted from these, which are above 32767",
    "resampled": "samples of faster runs were averaged to the session's rate",
}
META = "PATTERN:key=value,..."
SRC = "CSV (gzip or not), Parquet, .npz, .mat, a ROS bag, MCAP, ULog, an EuRoC folder, or a folder with a file a run."
Src = Annotated[Path, typer.Argument(metavar="SRC", help=SRC)]
Map = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="TARGET=COLUMN[:UNIT][*FACTOR]", help="Take a column, e.g. gx_dps=gyr_x:rad/s."),
]
Yes = Annotated[bool, typer.Option("--yes", "-y", help="Take the guess at columns and units without asking.")]
Format = Annotated[str | None, typer.Option("--format", help="euroc: the columns of its imu0/data.csv.")]
Topic = Annotated[str | None, typer.Option(help="Which topic of a ROS bag or a ULog.")]
Columns = Annotated[str | None, typer.Option(help="Names of all columns, a,b,c, where the file has none.")]
Skip = Annotated[int | None, typer.Option(min=0, help="Lines above the header (found by itself).")]
LsbDps = Annotated[float | None, typer.Option(help="One count of the gyroscope, dps (unit `counts`).")]
LsbG = Annotated[float | None, typer.Option(help="One count of the accelerometer, g (unit `counts`).")]
RateHz = Annotated[float | None, typer.Option(help="Samples a second; gives the time where no t_s is mapped.")]
Runs = Annotated[
    list[str] | None,
    typer.Option("--run", metavar=CUT, help="Cut a run: rows (from 0) or seconds (5.2s), the end not taken."),
]
Sections = Annotated[Path | None, typer.Option(help='Cut runs as a JSON file says: {"name": {"start": row, "end": row}}.')]
Rates = Annotated[
    str | None,
    typer.Option(metavar="R,...", help="The table's true rates: a run of each plateau, at the nearest one or at rest."),
]
RunMeta = Annotated[
    list[str] | None, typer.Option(metavar=META, help="Facts of the runs whose names match, e.g. '*_rot:turn=360'.")
]


Reference = Annotated[
    Path | None, typer.Option(metavar="FILE", help="A second file, with the true rate, an angle or an orientation.")
]
RefMap = Annotated[
    list[str] | None,
    typer.Option(
        "--ref-map", metavar="TARGET=COLUMN[:UNIT]",
        help="Take a column of it instead of a guess: its t_s, and e.g. ref_angle_deg=enc:rad.",
    ),
]
Join = Annotated[
    list[str] | None,
    typer.Option(
        "--join", metavar="FILE[:a,b,c]",
        help="A file of another sensor of the same recording, joined on time; names of all its columns where it has none.",
    ),
]
Gravity = Annotated[
    bool, typer.Option("--gravity", help="Turned by hand between rests: gravity is the reference, no rate is known.")
]


def run(
    src: Src,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The session's folder, made anew.")],
    maps: Map = None,
    yes: Yes = False,
    preview: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw what would be imported, as PNG.")] = None,
    form: Format = None,
    topic: Topic = None,
    columns: Columns = None,
    skip: Skip = None,
    rate_hz: RateHz = None,
    resample_hz: Annotated[float | None, typer.Option(help="Bring faster runs to this rate by averaging.")] = None,
    lsb_dps: LsbDps = None,
    lsb_g: LsbG = None,
    full_scale_dps: Annotated[float | None, typer.Option(help="Full scale of the gyroscope, dps.")] = None,
    sensor: Annotated[str | None, typer.Option(help="The part's name.")] = None,
    reference: Reference = None,
    ref_maps: RefMap = None,
    ref_clock: Annotated[str, typer.Option(help="same: one clock stamped both files; own: each its own.")] = "same",
    ref_columns: Annotated[str | None, typer.Option(help="Names of all its columns, if it has no header.")] = None,
    ref_topic: Annotated[str | None, typer.Option(help="Which topic of the second file.")] = None,
    gravity: Gravity = False,
    joined: Join = None,
    runs: Runs = None,
    sections: Sections = None,
    run_meta: RunMeta = None,
    axis: Annotated[str | None, typer.Option(help="The sensor's axis along the table's: x, y or z (z).")] = None,
    face: Annotated[str | None, typer.Option(help="up or down.")] = None,
    rate: Annotated[float | None, typer.Option(help="The table's true rate, dps, signed; 0 = at rest.")] = None,
    rates: Rates = None,
    turn_deg: Annotated[float | None, typer.Option(help="The run's known net angle instead of a rate, deg.")] = None,
    scenario: Annotated[str | None, typer.Option(help="Runs of one power cycle share it.")] = None,
    day: Annotated[int | None, typer.Option(help="A label of groups.")] = None,
    power_on_s: Annotated[float | None, typer.Option(help="From power-on to the first sample, s.")] = None,
    append: Annotated[bool, typer.Option("--append", help="Add runs to an existing session.")] = False,
    as_json: AsJson = False,
) -> None:
    """Make a session from a recording of another program. Without --map, columns are guessed, shown, and taken if you agree.

    Units: s ms us ns samples; dps deg/s mdps rad/s counts; g mg m/s2 counts; degC K degF; deg rad turn. Keys of a run:
    face, axis, rate, turn, scenario, day, power_on_s; they are also read from names such as s000_down_-78dps.csv.

    gyrocal import up.csv out --map t_s=time:ms --map gx_dps=gyr_x:rad/s --map gy_dps=gyr_y:rad/s
    --map gz_dps=gyr_z:rad/s --face up --rate 78
    """
    from gyrocal.recording.column_map import Scaling
    from gyrocal.recording.import_options import Options

    facts = _facts(
        face=face, axis=axis, table_rate_dps=rate, turn_deg=turn_deg, scenario=scenario, day=day, power_on_s=power_on_s
    )
    found = _read(src, out, append, Options(
        maps or (), _cuts(runs, sections), run_meta or (), facts, axis, Scaling(rate_hz, lsb_dps, lsb_g),
        names_of(columns), skip, topic, form, sensor, full_scale_dps,
        _second(reference, ref_maps, ref_clock, ref_topic, names_of(ref_columns)), resample_hz, gravity, ref_clock,
        joined or (), _rates(rates),
    ))  # fmt: skip
    _preview(found, preview)
    _agreed(found, yes, as_json)
    _save(found, out, append, as_json)


def names_of(columns: str | None) -> list[str] | None:
    """The names of columns in an option that lists them with commas."""
    return [name.strip() for name in columns.split(",")] if columns else None


def _cuts(runs: list[str] | None, sections: Path | None) -> "list[Cut]":
    from gyrocal.recording.cut import Cut, read_sections

    return [*(Cut.parse(text) for text in runs or ()), *(read_sections(sections) if sections is not None else ())]


def _rates(rates: str | None) -> list[float]:
    from gyrocal.errors import InputError

    try:
        return [float(rate) for rate in rates.split(",")] if rates is not None else []
    except ValueError:
        raise InputError(f"--rates {rates}: the table's rates in dps with commas, for example 45,-45,90,-90") from None


def _facts(**given: Any) -> dict[str, Any]:
    from gyrocal.recording.cut import check_meta

    facts: dict[str, Any] = {}
    for key, value in given.items():
        if value is not None:
            facts |= check_meta({key: value}, "--" + key.removeprefix("table_").removesuffix("_dps").replace("_", "-"))
    return facts


def _second(
    file: Path | None, maps: list[str] | None, clock: str, topic: str | None, names: list[str] | None
) -> "SecondFile | None":
    from gyrocal.errors import InputError
    from gyrocal.recording.second_file import SecondFile

    if clock not in ("same", "own"):
        raise InputError(f"--ref-clock {clock}: there are same and own")
    if file is None and (maps or names):
        raise InputError(f"--ref-{'map' if maps else 'columns'} takes columns of a second file; give it by --reference FILE")
    return SecondFile(file, maps or (), clock, topic, names) if file is not None else None


def _read(src: Path, out: Path, append: bool, options: "Options") -> "Imported":
    from gyrocal.recording.importer import check_is_new, read_recording
    from gyrocal.recording.session import Session

    check_is_new(out, append)
    return read_recording(src, options, Session.open(out, check=False) if append and out.exists() else None)


def _preview(found: "Imported", file: Path | None) -> None:
    if file is not None:
        from gyrocal.present.preview import draw

        draw(found.session, file)


def _agreed(found: "Imported", yes: bool, as_json: bool) -> None:
    if as_json:
        decided(found)
    else:
        confirmed(found, yes, "Import it so?")


def confirmed(found: "Imported", yes: bool, question: str) -> None:
    """Show what each column is taken for, and ask a person whether to take a guess."""
    _show(found)
    _confirm(found, yes, question)


def _show(found: "Imported") -> None:
    """Show what each column is taken for, with its first cells as they are in the file."""
    from gyrocal.present.output import table

    files = {each.file for each in found.first_rows}
    rows = [
        [each.map, "  ".join(each.values), f"{Path(each.file).name}: {each.why}" if len(files) > 1 else each.why]
        for each in found.first_rows
    ]
    named = [[f"{g.option} {g.map}", "", g.why] for g in found.guessed if g.option not in ("--map", "--ref-map")]
    title = "A guess at the columns" if found.guessed else "The columns"
    table(f"{title}, with their first rows", ["taken as:", "first values:", "why:"], rows + named)


def _confirm(found: "Imported", yes: bool, question: str) -> None:
    import sys

    from gyrocal.errors import InputError

    if yes or not found.guessed:
        decided(found)
        return
    same = " ".join(f"{g.option} '{g.map}'" for g in found.guessed)
    if not sys.stdin.isatty():
        raise InputError(f"nobody is there to confirm this guess; take it by --yes, or change it: {same}")
    if not typer.confirm(question, default=True):
        raise InputError(f"nothing is written; change the guess and run it again with: {same}")


def decided(found: "Imported") -> None:
    """Raise InputError if something was guessed that the file does not decide, so that a person has to say it."""
    from gyrocal.errors import InputError

    asked = [g for g in found.guessed if g.asks]
    if asked and asked[0].map.startswith("t_s="):
        stated = f"{asked[0].option} '{asked[0].map}'"
        raise InputError(f"{asked[0].question}. Say which by --rate-hz, the samples a second, or by {stated}")
    if asked:
        other = "dps" if asked[0].map.endswith(":rad/s") else "rad/s"
        same = " ".join(f"{g.option} '{g.map}'" for g in found.guessed)
        raise InputError(
            f"{asked[0].question}: neither gravity nor the noise at rest nor a known rate decides between them. Say which it "
            f"is, with all columns: {same}, or :{other} in each rate"
        )


def _save(found: "Imported", out: Path, append: bool, as_json: bool) -> None:
    warnings = _checked(found.session)  # an error in the data comes before anything is written
    session = found.save(out, append=append)
    _tell(found, session, _checked(session) if append else warnings, out, as_json)


def _checked(session: "Session") -> "list[Warning]":
    """The warnings of a session, of one by gravity with what its rests lack and the size of its rates."""
    from gyrocal.gravity import checked
    from gyrocal.plausibility import check

    return [*(checked.check(session) if session.reference.kind == "gravity" else []), *check(session)]


def _tell(found: "Imported", session: "Session", of_session: "list[Warning]", out: Path, as_json: bool) -> None:
    from gyrocal.present.output import emit
    from gyrocal.present.report import print_warnings
    from gyrocal.units import number_of

    warnings = [*found.warnings, *of_session]
    samples = sum(len(r) for r in session.runs)
    if as_json:
        emit({
            "rows": samples, "runs": len(session.runs), "sample_rate_hz": session.sample_rate_hz, "repaired": found.repaired,
            "guessed": [g.map for g in found.guessed], "warnings": [w.to_json() for w in warnings],
            "first_rows": [each.to_json() for each in found.first_rows],
        })  # fmt: skip
        return
    print_warnings(warnings)
    runs, cycles = number_of(len(session.runs), "run"), number_of(len(session.scenarios), "power cycle")
    print(f"{out}: {runs}, {samples} samples at {session.sample_rate_hz:g} Hz, {cycles}")
    if found.recordings > 1 and len(found.session.scenarios) == 1:
        print(
            f"The {found.recordings} files are taken for one power cycle. If the sensor was off between them, name each: "
            "--run-meta 'PATTERN:scenario=NAME' for the files whose names fit, or file names such as s003_up_78dps"
        )
    for what, count in found.repaired.items():
        print(f"{count} {REPAIRED[what]}")
