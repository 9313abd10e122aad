"""The simulator ``gyrocal-sim``, which runs the firmware's C core as a process, and its connection to a reader."""

from __future__ import annotations

import contextlib
import os
import re
import select
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from gyrocal.device.faults import check_faults
from gyrocal.device.outlet import Outlet
from gyrocal.device.packed import end_of_whole
from gyrocal.device.port import REPLAY_NOTE
from gyrocal.errors import DeviceError, InputError

WAIT_S = 0.02
CARRY = 4096
DEFAULT_PART = "LSM6DSO"
DEFAULT_BUS = "i2c"
WITH_FIFO = ("LSM6DSO", "LSM6DSR", "LSM6DSV", "BMI")
"""How the names of sensors begin whose FIFO the firmware uses."""
WITHOUT_SPI = "MPU-6050"
HELLO_TAKEN = re.compile(rb",cmd=hello[^\n]*\n")
"""The end of what acknowledges a hello. A reader is told that the device replays after each: of a reader who closes the
port and opens it again at once, the port tells nothing. What it then loses are the first bytes, and without the acknowledgement
it asks again."""


def sim_command(
    rows: Path,
    *,
    imu: int = 0,
    speed: str = "max",
    stream: str = "raw",
    faults: Sequence[str] = (),
    fifo: int = 0,
    part: str = DEFAULT_PART,
    bus: str = DEFAULT_BUS,
    hold: bool = False,
    bench: bool = False,
    include_dir: Path | None = None,
) -> list[str]:
    """The command line of the simulator, which is compiled if necessary.

    ``imu`` is the sensor's number on its board, ``part`` its kind, ``bus`` i2c or spi. ``fifo`` is the number of samples that
    the device takes from the sensor's FIFO at once, or 0. With ``bench``, nothing is replayed: the device lies still, with
    noise and flash, and answers commands. ``include_dir`` is the folder of other headers than the shipped ones.
    """
    from gyrocal.core import library

    binary = library.build_sim() if include_dir is None else library.build_sim(include_dir)
    command = [str(binary), str(rows), "--imu", str(imu), "--speed", speed, "--stream", stream, "--fifo", str(fifo)]
    check_faults(faults, fifo)
    if part != DEFAULT_PART:
        _check_part(part, fifo)
        command += ["--sensor", part]
    if bus != DEFAULT_BUS:
        _check_bus(bus, part)
        command += ["--bus", bus]
    for fault in faults:
        command += ["--fault", fault]
    return [*command, *["--hold"] * hold, *["--bench"] * bench]


def part_names() -> list[str]:
    """The kinds of sensors that the simulator knows."""
    from gyrocal.core import library

    done = subprocess.run([library.build_sim(), "--sensor", "list"], capture_output=True, text=True, check=False)
    return done.stdout.split()


def _check_part(part: str, fifo: int) -> None:
    names = part_names()
    if part not in names:
        raise InputError(f"--part {part}: want one of {', '.join(names)}")
    if fifo and not part.startswith(WITH_FIFO):
        raise InputError(f"--fifo {fifo}: the FIFO of the {part} is not used; leave --fifo out")


def _check_bus(bus: str, part: str) -> None:
    if bus != "spi":
        raise InputError(f"--bus {bus}: want {DEFAULT_BUS} or spi")
    if part == WITHOUT_SPI:
        raise InputError(f"--bus spi: the {part} does not speak SPI; leave --bus out")


class Simulator:
    """A running simulator, as a context manager. ``fd`` is the descriptor to wait for."""

    def __init__(self, command: Sequence[str], *, short: bool) -> None:
        self.ended = False
        self.command = command
        self._rest = b""
        self.fd, to_host = _pipe(short=short)
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=to_host, stderr=pipe, bufsize=0)
        os.close(to_host)

    def __enter__(self) -> Simulator:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self.fd)
        for end in (self._process.stdin, self._process.stderr):
            if end is not None:
                end.close()

    def read(self) -> bytes:
        """The whole lines and frames that have come; at the end of the simulator also the rest."""
        data = os.read(self.fd, CARRY)
        self.ended = not data
        data = self._rest + data
        end = len(data) if self.ended else end_of_whole(data)
        self._rest = data[end:]
        return data[:end]

    def write(self, data: bytes) -> None:
        """Write all bytes to the process. Bytes for a process that has ended are dropped."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            while data:
                data = data[os.write(self._process.stdin.fileno(), data) :]

    def check_exit(self) -> None:
        """Wait for the process to end. Raises DeviceError if it failed."""
        assert self._process.stderr is not None
        check_exit(self._process.wait(), self._process.stderr.read())


def _pipe(*, short: bool) -> tuple[int, int]:
    """Create a pipe. It is short, so that the device does not run far ahead of its reader."""
    reading, writing = os.pipe()
    if short:
        import fcntl

        with contextlib.suppress(AttributeError, OSError):  # Linux alone can
            fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, CARRY)
    return reading, writing


def check_exit(code: int, stderr: bytes) -> None:
    """Raise the last message of a simulator that failed: InputError for bad input, DeviceError for anything else."""
    if code:
        lines = stderr.decode("utf-8", "replace").strip().splitlines() or [f"exit code {code}"]
        raise (InputError if code == 2 else DeviceError)(f"simulated device: {lines[-1]}")


def serve(
    commands: Sequence[Sequence[str]],
    outlet: Outlet,
    *,
    wait_for_reader: bool,
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Carry bytes between the simulators and the reader of the outlet, until the simulators end and everything is read.

    There is one simulator for each sensor of the board. Commands go to all of them, and sentences are passed on whole. The
    simulators start with the first reader. With ``wait_for_reader`` they wait while there is no reader; without it they go
    on in their own time, and sentences without a reader are lost, as on a wire.

    Raises:
        DeviceError: a simulator failed.
    """
    while not outlet.connected():
        if stopped():
            return
        time.sleep(WAIT_S)
    with contextlib.ExitStack() as stack:
        sims = [stack.enter_context(Simulator(command, short=wait_for_reader)) for command in commands]
        _carry(sims, outlet, wait_for_reader, stopped)
        if stopped():
            return
        for sim in sims:
            sim.check_exit()
        _drain(outlet, stopped)


def _carry(sims: Sequence[Simulator], outlet: Outlet, wait_for_reader: bool, stopped: Callable[[], bool]) -> None:
    pending = b""
    replays = not any("--bench" in sim.command for sim in sims)
    going = list(sims)
    for sim in sims:
        sim.write(b"hello\n")  # its first hello comes before its settings
    while (going or pending) and not stopped():
        there = outlet.connected()
        if not there and not wait_for_reader:
            pending = b""
        poll = select.poll()
        for sim in [] if pending else going:
            poll.register(sim.fd, select.POLLIN)
        if there:
            poll.register(outlet.fd(), select.POLLIN | (select.POLLOUT if pending else 0))
        poll.poll(1000 * WAIT_S)
        if there:
            said = outlet.read()
            for sim in sims:
                sim.write(said)
            pending = pending[outlet.write(pending) :] if pending else b""
        if not pending:
            ready = select.select([sim.fd for sim in going], [], [], 0)[0]
            pending = b"".join(sim.read() for sim in going if sim.fd in ready)
            if replays:
                pending = HELLO_TAKEN.sub(rb"\g<0># %s\n" % REPLAY_NOTE.encode(), pending)
            going = [sim for sim in going if not sim.ended]


def _drain(outlet: Outlet, stopped: Callable[[], bool]) -> None:
    """Wait until the reader has read all pending bytes, or has gone."""
    quiet = 0
    while outlet.connected() and quiet < 2 and not stopped():
        quiet = quiet + 1 if outlet.drained() else 0
        time.sleep(WAIT_S)
