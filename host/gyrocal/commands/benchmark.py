"""``gyrocal benchmark``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson

NAMES = (
    "blind (naming), paper (tables), robustness, inference (cost), population and coverage (errors), "
    "fleet (many boards), soak (hours of faults), field (sessions as users bring them), references (each kind of reference), "
    "edge (sure names and probabilities where they are hard), real (recordings by others) or strangers (public files read)."
)


def run(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help=NAMES)
    ],
    sample: Annotated[bool, typer.Option("--sample", help="Only a few cases, for a quick look.")] = False,
    cases: Annotated[
        str | None, typer.Option(metavar="SET", help="blind: fixed (the default), or drawn at random: work, frozen or unseen.")
    ] = None,
    kind: Annotated[
        list[str] | None, typer.Option(metavar="KIND", help="blind, field, references, edge: this kind alone; may be repeated.")
    ] = None,
    limit: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="blind, field, references: N of each kind; fleet: N boards.")
    ] = None,
    skip: Annotated[int | None, typer.Option(min=1, metavar="N", help="blind: without the first N cases of each kind.")] = None,
    workers: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="blind, fleet, population, field, edge: processes; 0: this one.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="blind, fleet, population: a Dask scheduler instead of --workers.")
    ] = None,
    results: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="blind, population, field, references: finished cases (JSONL); fleet: a folder."),
    ] = None,
    hours: Annotated[float | None, typer.Option(min=0.01, metavar="H", help="soak: hours of device time (24).")] = None,
    seed: Annotated[int | None, typer.Option(min=0, metavar="N", help="soak, field, references: the first seed.")] = None,
    part: Annotated[str | None, typer.Option(metavar="PART", help="edge: work (the default), calibration or frozen.")] = None,
    start: Annotated[int | None, typer.Option(min=0, metavar="N", help="edge: from this case of the part.")] = None,
    stop: Annotated[int | None, typer.Option(min=1, metavar="N", help="edge: up to this case of the part.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="edge: finished cases (JSONL), not run again.")] = None,
    against: Annotated[
        Path | None, typer.Option(metavar="FILE", help="edge: the cases of an earlier --out, compared case by case.")
    ] = None,
    tool: Annotated[
        Path | None,
        typer.Option(metavar="FILE.py", help="edge, blind, paper, strangers: grade this tool, which is run, instead."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure how good the tool is, on cases fixed beforehand (from a checkout)."""
    from gyrocal.benchmark import benchmark, show
    from gyrocal.present.output import emit

    asked = {
        "cases_of": cases, "kinds": kind, "limit": limit, "skip": skip, "workers": workers, "scheduler": scheduler,
        "results": results, "hours": hours, "seed": seed,
        "part": part, "start": start, "stop": stop, "out": out, "against": against, "tool": tool,
    }  # fmt: skip
    given = {key: value for key, value in asked.items() if value not in (None, [])}
    found = benchmark(name, sample=sample, quiet=as_json, **given)
    if as_json:
        emit(found)
    else:
        show(name, found)
