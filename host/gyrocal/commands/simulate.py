"""``gyrocal simulate``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson, OwnEffects
from gyrocal.simulation.campaigns import CAMPAIGNS


def run(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="The session's folder, made anew; OUT.truth.json beside it.")
    ],
    campaign: Annotated[
        str,
        typer.Option(help=f"What is recorded: {'; '.join(f'{name}: {c.about}' for name, c in CAMPAIGNS.items())}."),
    ] = "paper",
    effect: Annotated[
        list[str] | None, typer.Option(metavar="ID[:name=value,...]", help="Plant an effect; may be repeated.")
    ] = None,
    effects: OwnEffects = None,
    seed: Annotated[int, typer.Option(help="The same seed gives the same session.")] = 0,
    sensor: Annotated[
        int | None, typer.Option(help="Number of the part: sessions of one number are of one part. Left out: the seed.")
    ] = None,
    scenarios: Annotated[int | None, typer.Option(help="How many scenarios (paper: 48) or days (others: 3).")] = None,
    seconds: Annotated[float | None, typer.Option(help="Length of a run, s (paper: 70, full: 40).")] = None,
    plan: Annotated[Path | None, typer.Option(metavar="PLAN.toml", help="Carry out a plan instead of a campaign.")] = None,
    add_to: Annotated[
        Path | None,
        typer.Option(
            metavar="SESSION", help="With --plan: OUT begins with these runs, simulated with the same --seed and --effect."
        ),
    ] = None,
    parquet: Annotated[bool, typer.Option("--parquet", help="Tables as Parquet instead of CSV.")] = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a campaign or a plan with known truth: a session folder, and what was planted beside it."""
    from gyrocal.errors import InputError
    from gyrocal.present.output import emit, stdout, working
    from gyrocal.recording.plan_file import PlannedRuns
    from gyrocal.recording.session import Session
    from gyrocal.simulation.simulate import simulate
    from gyrocal.units import number_of

    if plan is not None and (campaign != "paper" or scenarios is not None or seconds is not None):
        raise InputError("--plan says which runs there are; leave out --campaign, --scenarios and --seconds")
    with working(as_json) as say:
        session, truth = simulate(
            out, campaign, effect or (), seed, scenarios=scenarios, seconds=seconds, sensor=sensor, parquet=parquet,
            plan=None if plan is None else PlannedRuns.open(plan), add_to=None if add_to is None else Session.open(add_to),
            progress=lambda done, total: say(f"run {done} of {total}"),
        )  # fmt: skip
    samples = sum(len(r) for r in session.runs)
    if as_json:
        listed = [{"file": r.file, "samples": len(r)} for r in session.runs]
        emit({"session": str(out), "truth": f"{out}.truth.json", "effects": truth["effects"], "runs": listed})
        return
    planted = ", ".join(truth["effects"]) or "no effect"
    stdout.print(f"{out}: {number_of(len(session.runs), 'run')}, {samples} samples, {planted}; truth in {out}.truth.json")
