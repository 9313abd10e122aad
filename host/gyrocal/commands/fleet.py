"""``gyrocal fleet``."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Action(StrEnum):
    """Fit many boards as one population."""

    fit = "fit"


def run(
    action: Annotated[Action, typer.Argument(metavar="fit", help="Fit all sessions and their population.")],
    folder: Annotated[
        str,
        typer.Argument(metavar="FOLDER", help="A folder of session folders, a JSON or Parquet list of their paths, or a URL."),
    ],
    model: Annotated[str | None, typer.Option(help="paper, default, or a model file.")] = None,
    workers: Annotated[
        int | None, typer.Option(help="Processes on this machine; 0: this one alone. Default: one a core.")
    ] = None,
    scheduler: Annotated[str | None, typer.Option(help="Address of a running Dask scheduler, e.g. tcp://host:8786.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder of results, population.toml, report.html. Default: FOLDER.fleet")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object.")] = False,
) -> None:
    """Many boards' sessions as one population: what they share, which are odd, and what is too small for one board to show."""
    from gyrocal.error_model.model import Model
    from gyrocal.extras import want
    from gyrocal.fleet.engine import engine
    from gyrocal.fleet.fit import fit_fleet
    from gyrocal.fleet.listing import sessions
    from gyrocal.fleet.prior import population_model
    from gyrocal.present.fleet_page import print_fleet, write_page
    from gyrocal.present.output import emit, stderr, working

    want("fleet fit", *(() if workers == 0 else ("fleet",)), "plot")
    sessions(folder)  # refused before processes are started
    target = out or Path(f"{Path(folder.rstrip('/')).name}.fleet" if "://" in folder else f"{folder.rstrip('/')}.fleet")
    with working(as_json) as say, engine(workers, scheduler) as where:
        if where.dashboard and not as_json:
            stderr.print(f"dashboard: {where.dashboard}")
        found = fit_fleet(folder, Model.open(model), where, target, lambda done, total: say(f"session {done} of {total}"))
        dashboard = where.dashboard
    population_model(found).save(target / "population.toml")
    write_page(target / "report.html", found, dashboard)
    if as_json:
        emit(found.to_json())
    else:
        print_fleet(found, target)
