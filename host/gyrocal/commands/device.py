"""``gyrocal device``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gyrocal.commands import AsJson

if TYPE_CHECKING:
    from gyrocal.recording.session import Session


def run(
    session: Annotated[
        Path | None, typer.Option(help="Replay this session; without it one up/down scenario is simulated.")
    ] = None,
    effects: Annotated[
        list[str] | None,
        typer.Option("--effect", metavar="ID[:name=value,...]", help="Plant an effect in the simulated scenario."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the simulated scenario.")] = 0,
    sensors: Annotated[
        int, typer.Option(min=1, max=4, help="On the board, each with its own simulated scenario or the same session.")
    ] = 1,
    speed: Annotated[str, typer.Option(help="Times real time, or max: as fast as it is read.")] = "1",
    stream: Annotated[str, typer.Option(help="raw, packed or off: what it sends until another `stream` command.")] = "raw",
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[@T][:LENGTH][*TIMES]", help="Make it misbehave, T s into the first run; `list` names the faults."
        ),
    ] = None,
    faults: Annotated[str | None, typer.Option(metavar="random:SEED", help="Faults at random times, by a seed.")] = None,
    fifo: Annotated[
        int, typer.Option(min=0, max=128, help="Samples read at once from the sensor's FIFO; 0: each as it comes.")
    ] = 0,
    part: Annotated[str, typer.Option(metavar="NAME", help="Kind of sensor, such as MPU-6050 or ICM-42688-P.")] = "LSM6DSO",
    bus: Annotated[str, typer.Option(help="i2c or spi: how the sensor is wired to its board.")] = "i2c",
    tcp: Annotated[str | None, typer.Option(metavar="HOST:PORT", help="Serve TCP, not a pseudo terminal.")] = None,
    token: Annotated[str | None, typer.Option(help="With --tcp: what a reader must say first, as by Wi-Fi.")] = None,
    link: Annotated[Path | None, typer.Option(help="A symbolic link to the pseudo terminal.")] = None,
    hold: Annotated[bool, typer.Option("--hold", help="Keep answering commands when all is replayed.")] = False,
    bench: Annotated[
        bool, typer.Option("--bench", help="Replay nothing: a board at rest, with noise and flash, that answers commands.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """A simulated device: the firmware's own C core behind a virtual serial port.

    Prints the port's path. The replay begins when the port is first opened, and the device ends when all of it was
    read. It starts and stops its runs by itself: `gyrocal record` takes them as they come.
    """
    import contextlib
    import json

    from gyrocal.device import simulated as device
    from gyrocal.device.faults import faults as listed
    from gyrocal.errors import InputError

    if "list" in (fault or []):
        print(listed(), end="")
        return
    if stream not in ("raw", "packed", "off"):
        raise InputError(f"--stream {stream}: want raw, packed or off")
    _end_by_signals()
    simulated = device.SimulatedDevice(
        _source(session, effects or [], sensors, seed), speed, stream=stream, faults=_wanted(fault, faults, fifo),
        fifo=fifo, part=part, bus=bus, tcp=tcp, token=token, symlink=link, hold=hold, bench=bench,
    )  # fmt: skip
    with contextlib.suppress(KeyboardInterrupt), simulated:
        print(json.dumps({"port": simulated.port}) if as_json else simulated.port, flush=True)
        simulated.wait()


def _source(session: Path | None, effects: list[str], sensors: int, seed: int) -> "list[Session]":
    """What each sensor replays: the session, or a simulated scenario of its own."""
    from gyrocal.device import simulated
    from gyrocal.errors import InputError
    from gyrocal.recording.session import Session

    if session is None:
        return [simulated.simulated_scenario(effects, seed + k) for k in range(sensors)]
    if effects:
        raise InputError("--effect is for a simulated scenario; it does not go with --session")
    return [Session.open(session)] * sensors


def _wanted(fault: list[str] | None, faults: str | None, fifo: int) -> list[str]:
    """The faults that were asked for, with those drawn by ``--faults``, which are printed."""
    import sys

    from gyrocal.device.faults import random_faults

    drawn = [] if faults is None else random_faults(faults, fifo)
    if drawn:
        print("faults: " + " ".join(drawn), file=sys.stderr)
    return [*(fault or []), *drawn]


def _end_by_signals() -> None:
    """Let SIGTERM and SIGHUP end the device as Ctrl-C does."""
    import signal

    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.default_int_handler)
