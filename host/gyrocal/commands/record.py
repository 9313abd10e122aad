"""``gyrocal record``."""

from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status

    from gyrocal.device.port import Link
    from gyrocal.device.record import Recorder, Report
    from gyrocal.device.run_writer import Recorded
    from gyrocal.recording.plan_file import PlannedRuns

BY_HAND = "Lay the sensor down for ten seconds. Then turn it from pose to pose, and keep it still for two seconds in each."


def run(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The session's folder: new, or one to add a run to.")],
    port: Annotated[str, typer.Option(help="A serial device, tcp://host:port, or auto: the first where a device answers.")],
    face: Annotated[str | None, typer.Option(help="up or down.")] = None,
    rate: Annotated[float | None, typer.Option(help="The table's true rate, dps, signed; 0 = at rest.")] = None,
    seconds: Annotated[float | None, typer.Option(help="How long.")] = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Every run that the device announces, until it ends.")
    ] = False,
    axis: Annotated[str | None, typer.Option(help="The sensor's axis along the table's: x, y or z.")] = None,
    turn_deg: Annotated[float | None, typer.Option(help="The run's known net angle instead of --rate, deg.")] = None,
    scenario: Annotated[str, typer.Option(help="Runs of one power cycle share it.")] = "s000",
    day: Annotated[int | None, typer.Option(help="A label of groups.")] = None,
    plan: Annotated[
        Path | None, typer.Option(metavar="PLAN.toml", help="Carry out a plan, run by run; runs that OUT has are left out.")
    ] = None,
    hands: Annotated[
        bool, typer.Option("--hands", help="Calibrate by hand, without a table; it says which movement is still missing.")
    ] = False,
    wait: Annotated[
        bool, typer.Option("--wait", help="Wait for the port where it is not there yet, or held by another program.")
    ] = False,
    imu: Annotated[int, typer.Option(min=0, help="Which sensor of the board.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Record a run, the runs of a plan, or a calibration by hand, from a device into a session folder.

    What was received is on disk at once. Ctrl-C, SIGTERM and SIGHUP end the recording; if the device goes away, what came is
    kept, and the report is printed all the same (exit 3; exit 1 where the disk is full).
    """
    from rich.console import Console

    from gyrocal.device import record
    from gyrocal.device.address import without_token
    from gyrocal.errors import DeviceError, GyrocalError, InputError
    from gyrocal.recording.plan_file import PlannedRuns
    from gyrocal.warning import Warning

    _check_told_once(plan, hands, follow, any(v is not None for v in (face, rate, seconds, turn_deg, axis)), day)
    wanted = None if follow or hands or plan is not None else record.wanted(face, rate, seconds, turn_deg, axis)
    planned = None if plan is None else PlannedRuns.open(plan)
    console = Console(stderr=True, markup=False)
    report = record.Report(str(out))
    try:
        waiting = f"{without_token(port)}: waiting for the device"
        with console.status(waiting) as status, _link(port, wait, plan, status) as link:
            one = {"wanted": wanted, "scenario": scenario, "day": day}
            recorder = _recorder(link, out, planned, hands, one, imu, console, status)
            report = recorder.report
            with recorder.stopped_by_signals():
                recorder.record()
    except InputError:
        raise
    except GyrocalError as failure:
        told = any(warning.code == "device_gone" for warning in report.warnings)
        if as_json and isinstance(failure, DeviceError) and not told:  # a person reads the line of the failure itself
            report.warnings.append(Warning("device_gone", None, None, str(failure)))
        _finish(report, as_json)
        raise
    _finish(report, as_json)


def _link(port: str, wait: bool, plan: Path | None, status: "Status") -> "Link":
    """The device at a port; with ``wait``, the port is tried until it opens or Ctrl-C ends that."""
    import time

    from gyrocal.device.find import find_port
    from gyrocal.device.port import RETRY_S, Link
    from gyrocal.errors import DeviceError

    while True:
        try:
            return Link(find_port(port), reconnect=plan is not None)
        except DeviceError as error:
            if not wait:
                raise
            status.update(f"{error} (waiting)")
        time.sleep(RETRY_S)


def _check_told_once(plan: Path | None, hands: bool, follow: bool, described: bool, day: int | None) -> None:
    """Raise InputError if --plan or --hands stands beside an option that says what is recorded."""
    from gyrocal.errors import InputError

    if plan is not None and (follow or hands or described or day is not None):
        raise InputError("--plan says which runs there are; leave out --follow, --face, --rate, --seconds, --axis and --day")
    if hands and (follow or described):
        raise InputError("--hands records one run without a rate; leave out --follow, --face, --rate, --seconds and --axis")


def _recorder(
    link: "Link", out: Path, plan: "PlannedRuns | None", hands: bool, one: dict[str, Any], imu: int, console: "Console",
    status: "Status",
) -> "Recorder":  # fmt: skip
    """What records the plan, or by hand, or else the runs that ``one`` describes, and shows how far it is."""
    from gyrocal.device.record import Recorder
    from gyrocal.device.record_plan import PlanRecorder

    def progress(run: "Recorded") -> None:
        status.update(f"{out}/{run.file}: {run.seconds:.1f} s, {run.samples} samples, {run.lost} lost, {run.missed} missed")

    def say(text: str) -> None:
        console.print(text, markup=False, highlight=False)

    if hands:
        from gyrocal.device.record_hands import HandsRecorder
        from gyrocal.present.hands import Guide

        say(BY_HAND)
        return HandsRecorder(
            link, out, Guide(say, status.update).show, imu=imu, scenario=one["scenario"], day=one["day"]
        )
    if plan is None:
        return Recorder(link, out, imu=imu, progress=progress, **one)
    return PlanRecorder(link, out, plan, say, imu=imu, progress=progress)


def _finish(report: "Report", as_json: bool) -> None:
    """Add the warnings of the session, as far as it can be read, and show the report."""
    from gyrocal.errors import InputError
    from gyrocal.plausibility import check
    from gyrocal.recording.session import Session

    if report.runs:
        with suppress(InputError):
            report.warnings += check(Session.open(report.session))
    _show(report, as_json)


def _show(report: "Report", as_json: bool) -> None:
    from gyrocal.device.record_hands import HandsReport
    from gyrocal.present import output
    from gyrocal.present.hands import print_aims
    from gyrocal.warning import lines

    if as_json:
        output.emit(report.to_json())
        return
    for r in report.runs:
        what = f"{r.samples} samples, {r.losses}"
        print(f"{report.session}/{r.file}: power cycle {r.scenario}, face {r.face}, axis {r.axis}, {r.seconds:.3f} s, {what}")
    if isinstance(report, HandsReport):
        print_aims(report)
    for line in lines(report.warnings):
        print(f"warning: {line}")
    for error, times in Counter(report.errors).items():
        print(f"device: {error}{f' ({times} times)' if times > 1 else ''}")
