"""``gyrocal import``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gyrocal.commands import AsJson

if TYPE_CHECKING:
    from gyrocal.recording.session import Session
    from gyrocal.warning import Warning

CUT = "NAME:START:END[:key=value,...]"
META = "PATTERN:key=value,..."
Map = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="TARGET=COLUMN[:UNIT][*FACTOR]", help="Take a column, e.g. gx_dps=gyr_x:rad/s."),
]
RateHz = Annotated[float | None, typer.Option(help="Samples a second; gives the time where no t_s is mapped.")]
Runs = Annotated[
    list[str] | None,
    typer.Option("--run", metavar=CUT, help="Cut a run: rows (from 0) or seconds (5.2s), the end not taken."),
]
Sections = Annotated[
    Path | None, typer.Option(help='Cut runs as a JSON file says: {"name": {"start": row, "end": row}}.')
]
RunMeta = Annotated[
    list[str] | None, typer.Option(metavar=META, help="Facts of the runs whose names fit, e.g. '*_rot:turn=360'.")
]


def run(
    src: Annotated[Path, typer.Argument(metavar="SRC", help="CSV (gzip or not), Parquet, or an EuRoC folder.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The session's folder, made anew.")],
    maps: Map = None,
    form: Annotated[str | None, typer.Option("--format", help="euroc: the columns of its imu0/data.csv.")] = None,
    columns: Annotated[str | None, typer.Option(help="Names of all columns, a,b,c, where the file has none.")] = None,
    skip: Annotated[int | None, typer.Option(min=0, help="Lines above the header (found by itself).")] = None,
    rate_hz: RateHz = None,
    lsb_dps: Annotated[float | None, typer.Option(help="One gyro count, deg/s (unit `counts`).")] = None,
    lsb_g: Annotated[float | None, typer.Option(help="One accelerometer count, g (unit `counts`).")] = None,
    full_scale_dps: Annotated[float | None, typer.Option(help="Where the gyro clips, deg/s.")] = None,
    sensor: Annotated[str | None, typer.Option(help="The part's name.")] = None,
    runs: Runs = None,
    sections: Sections = None,
    run_meta: RunMeta = None,
    axis: Annotated[str, typer.Option(help="The sensor's axis along the table's: x, y or z.")] = "z",
    face: Annotated[str | None, typer.Option(help="up or down.")] = None,
    rate: Annotated[float | None, typer.Option(help="The table's true rate, deg/s, signed; 0 = at rest.")] = None,
    turn_deg: Annotated[float | None, typer.Option(help="The run's known net angle instead of a rate, deg.")] = None,
    scenario: Annotated[str | None, typer.Option(help="Runs of one power cycle share it.")] = None,
    day: Annotated[int | None, typer.Option(help="A label of groups.")] = None,
    power_on_s: Annotated[float | None, typer.Option(help="From power-on to the first sample, s.")] = None,
    append: Annotated[bool, typer.Option("--append", help="Add runs to a session that is there.")] = False,
    as_json: AsJson = False,
) -> None:
    """Make a session of somebody else's recording.

    Units: s ms us ns samples; dps deg/s mdps rad/s counts; g mg m/s2 counts; degC K degF; deg rad turn. Keys of a run:
    face, axis, rate, turn, scenario, day, power_on_s.

    gyrocal import up.csv out --map t_s=time:ms --map gx_dps=gyr_x:rad/s --map gy_dps=gyr_y:rad/s
    --map gz_dps=gyr_z:rad/s --face up --rate 78
    """
    from gyrocal.plausibility import check
    from gyrocal.recording import cut
    from gyrocal.recording.column_map import Scaling
    from gyrocal.recording.importer import import_recording
    from gyrocal.warning import Warning

    cuts = [cut.Cut.parse(text) for text in runs or ()]
    if sections is not None:
        cuts += cut.read_sections(sections)
    given = {
        "face": face, "axis": axis, "table_rate_dps": rate, "turn_deg": turn_deg, "scenario": scenario, "day": day,
        "power_on_s": power_on_s,
    }  # fmt: skip
    damaged: list[Warning] = []
    session = import_recording(
        src, out, maps or (), cuts=cuts, run_meta=run_meta or (),
        defaults=cut.check_meta({k: v for k, v in given.items() if v is not None}, "options"),
        axis=axis, scaling=Scaling(rate_hz, lsb_dps, lsb_g),
        columns=[c.strip() for c in columns.split(",")] if columns else None, skip=skip, form=form, sensor=sensor,
        full_scale_dps=full_scale_dps, append=append, warn=damaged.append,
    )  # fmt: skip
    evened = {w.file for w in damaged if w.code == "sample_rate"}
    repaired = {"times": sum(len(r) for r in session.runs if r.file in evened)} if evened else {}
    _tell(session, out, [*damaged, *check(session)], repaired, as_json)


def _tell(session: "Session", out: Path, warnings: "list[Warning]", repaired: "dict[str, int]", as_json: bool) -> None:
    from gyrocal.present.output import emit
    from gyrocal.present.report import print_warnings

    samples = sum(len(r) for r in session.runs)
    if as_json:
        emit({
            "rows": samples, "runs": len(session.runs), "sample_rate_hz": session.sample_rate_hz, "repaired": repaired,
            "warnings": [w.to_json() for w in warnings],
        })  # fmt: skip
        return
    print_warnings(warnings)
    print(f"{out}: {len(session.runs)} runs, {samples} samples at {session.sample_rate_hz:g} Hz")
