"""``gyrocal calibrate``."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gyrocal.commands import AsJson, OneAxis, OwnEffects, SessionFolder, want_axis

if TYPE_CHECKING:
    from gyrocal.calibration.calibrate import Estimate
    from gyrocal.recording.session import Session
    from gyrocal.warning import Warning


def run(
    session: SessionFolder,
    seconds: Annotated[
        str | None, typer.Option(help="From the first seconds of each run: 2, or 2,4,6; all: from whole runs.")
    ] = None,
    method: Annotated[str | None, typer.Option(help="baseline, cnn, model, or several with commas.")] = None,
    model: Annotated[
        str | None, typer.Option(help="A model file for the model method (`gyrocal add` makes one).")
    ] = None,
    axis: OneAxis = None,
    history: Annotated[
        bool, typer.Option("--history", help="SESSION is a folder of one sensor's sessions over months: how does it age?")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="M.toml", help="With --history: write the joined model.")
    ] = None,
    effects: OwnEffects = None,
    as_json: AsJson = False,
) -> None:
    """Estimate scale and bias of each scenario from the first seconds of its runs, or from whole runs.

    With --history, the sessions in a folder are joined by their `board` and `made_on`: one model, and each parameter's ageing.
    """
    from gyrocal.calibration.beyond import beyond_of_calibration
    from gyrocal.calibration.calibrate import calibrate, unanswered
    from gyrocal.errors import InputError
    from gyrocal.plausibility import check
    from gyrocal.present.output import emit
    from gyrocal.recording.session import Session

    spans = _spans(seconds)
    want_axis(axis)
    methods = None if method is None else [m.strip() for m in method.split(",")]
    if out is not None and not history:
        raise InputError("--out is for --history; the estimates are kept by --json")
    if history:
        if seconds is not None or method is not None:
            raise InputError("--history fits whole sessions by the model; leave out --seconds and --method")
        from gyrocal.present.history import show_history

        show_history(session, model, axis, out, as_json)
        return
    opened = Session.open(session)
    if opened.reference.kind == "gravity":
        from gyrocal.present.gravity import show_calibration

        show_calibration(opened, spans, methods, model, as_json, axis)
        return
    warnings = check(opened, model)
    found = [e for e in calibrate(opened, spans, methods, model, warnings) if axis in (None, e.axis)]
    warnings += [*unanswered(opened, found, spans), *beyond_of_calibration(opened, found, model)]
    if method is None:
        _tell_what_is_left_out(opened)
    if as_json:
        budget = [row for e in found for row in e.budget_json()]
        emit({"estimates": [e.to_json() for e in found], "budget": budget, "warnings": [w.to_json() for w in warnings]})
        return
    _show(found, warnings)
    _tell_of_other_runs(opened, found, methods)


def _tell_what_is_left_out(session: "Session") -> None:
    """Say on stderr that the network is not used, where it would have an answer."""
    from gyrocal.calibration.pairs import network_suits
    from gyrocal.extras import lacking
    from gyrocal.present.output import stderr

    if lacking("net") and network_suits(session):
        stderr.print("cnn is left out, because it needs onnxruntime: pip install 'gyrocal[net]'")


def _tell_of_other_runs(session: "Session", found: "Sequence[Estimate]", asked: list[str] | None) -> None:
    """Say that the model method takes the runs of a power cycle which a pair leaves out, unless methods were asked for."""
    from gyrocal.present.output import stdout

    by_pairs = asked is None and all(e.method != "model" for e in found)
    of_pairs = {e.scenario for e in found} if by_pairs else set()
    most = max((len(runs) for scenario, runs in session.by_scenario() if scenario in of_pairs), default=0)
    if most > 2:
        more = f"--method model takes all {most}, and --seconds all whole ones"
        stdout.print(f"These answers are of two recordings of a power cycle; {more}.")


def _spans(seconds: str | None) -> list[float | None] | None:
    """The seconds of ``--seconds``, None for ``all``. Raises InputError for other words."""
    from gyrocal.errors import InputError

    try:
        return None if seconds is None else [None if s.strip() == "all" else float(s) for s in seconds.split(",")]
    except ValueError:
        raise InputError(f"--seconds {seconds}: a number of seconds, several with commas, or all") from None


def _show(found: "Sequence[Estimate]", warnings: "Sequence[Warning]") -> None:
    """Print the estimates as a table, with the meaning of their flags and their budget."""
    from gyrocal.calibration.flags import FLAGS
    from gyrocal.digits import UNKNOWN, percent
    from gyrocal.present.budget import print_budget
    from gyrocal.present.output import stdout, table
    from gyrocal.present.report import print_warnings
    from gyrocal.present.taken import cell
    from gyrocal.units import unit_of

    print_warnings(warnings)
    unit = unit_of(e.bias_dps for e in found)
    rows = [
        [e.scenario, e.axis, e.method, cell(e.taken), *percent(e.scale, e.scale_se),
         *unit.pair(e.bias_dps, e.bias_se_dps), UNKNOWN if e.misfit is None else f"{e.misfit:.2f}",
         "yes" if e.trusted else "no: " + ", ".join(e.flags)]
        for e in found
    ]  # fmt: skip
    bias = (f"bias {unit.name}", f"± {unit.name}")
    table("", ["scenario:", "axis:", "method:", "recordings:", "scale %", "± %", *bias, "misfit", "trusted:"], rows)
    for flag, meaning in FLAGS.items():
        count = sum(flag in e.flags for e in found)
        if count:
            stdout.print(f"{flag} ({count} of {len(found)}): {meaning}", markup=False)
    print_budget(found)
