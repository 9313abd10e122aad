"""``gyrocal plan``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson, GivenModel, OwnEffects, SessionFolder


def run(
    session: SessionFolder,
    model: GivenModel = None,
    between: Annotated[str | None, typer.Option(metavar="ID,ID", help="Ask which of these effects acts.")] = None,
    measure: Annotated[str | None, typer.Option(metavar="ID", help="Ask how large this effect is.")] = None,
    minutes: Annotated[
        float | None, typer.Option(metavar="T", help="Minutes to record. Left out: the shortest plan that is good enough.")
    ] = None,
    table: Annotated[
        float | None, typer.Option(metavar="MAX_DPS", help="The table's largest rate, dps. Left out: the session's own.")
    ] = None,
    chamber: Annotated[
        str | None, typer.Option(metavar="MIN_C:MAX_C", help="There is a chamber of this range, °C.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="PLAN.toml", help="Write the plan for `record --plan` and `simulate --plan`."),
    ] = None,
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:
    """Plan what to record next: the runs that tell two effects apart, or that measure one.

    Without --between and --measure, the question is the one that `diagnose` leaves open.
    """
    from gyrocal.planning.plan import plan
    from gyrocal.present.output import emit, working
    from gyrocal.present.plan import print_plan
    from gyrocal.recording.session import Session

    opened = Session.open(session)
    with working(as_json) as say:
        found = plan(
            opened, model, between=_ids(between), measure=measure, minutes=minutes, table_dps=table,
            chamber_c=_range_c(chamber), progress=say,
        )  # fmt: skip
    if out is not None:
        found.save(out)
    if as_json:
        emit(found.to_json())
    else:
        print_plan(found, session, out)


def _ids(text: str | None) -> tuple[str, ...]:
    return () if text is None else tuple(part.strip() for part in text.split(",") if part.strip())


def _range_c(text: str | None) -> tuple[float, float] | None:
    from gyrocal.errors import InputError

    if text is None:
        return None
    low, colon, high = text.partition(":")
    try:
        return float(low), float(high if colon else "")
    except ValueError:
        raise InputError(f"--chamber {text}: want MIN_C:MAX_C, for example 5:45") from None
