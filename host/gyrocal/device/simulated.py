"""The simulated device: the firmware's own C core as a process, fed with a session's rows, behind a virtual port.

The process (``gyrocal-sim``) talks through its standard input and output. Here its rows are made, and a pseudo terminal
or a TCP port is put in front of it. The replay begins when the port is first opened.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from gyrocal.device.port import BUSY_NOTE, CHUNK, REPLAY_NOTE
from gyrocal.device.wire import Reader, Sentence
from gyrocal.errors import DeviceError, GyrocalError, InputError
from gyrocal.recording.session import Run, Session

LSB_DPS = {125.0: 0.004375, 250.0: 0.00875, 500.0: 0.0175, 1000.0: 0.035, 2000.0: 0.07}
"""LSM6DSO datasheet: full scale, deg/s -> one count, deg/s."""
DEFAULT_FULL_SCALE_DPS = 250.0
LSB_G = 6.1e-5
COUNTS_PER_C = 256.0
ZERO_C = 25.0

ROWS_MAGIC = b"GCSIM01\0"
_RUN = np.dtype(
    [("first_row", "<u4"), ("n_rows", "<u4"), ("face", "<i4"), ("axis", "<i4"), ("table_dps", "<f4"),
     ("turn_deg", "<f4"), ("power_on_s", "<f4"), ("power_cycle", "<u4")]
)  # fmt: skip
_ROW = np.dtype([("t_us", "<i8"), ("temp", "<i2"), ("gyro", "<i2", 3), ("acc", "<i2", 3), ("flags", "<u2")])

PSEUDO_TERMINALS = "/dev/"
"""What a link to one points into."""
WAIT_S = 0.02
TURN_AWAY_S = 0.2
"""So long a second reader waits: the first may have hung up, its last words not yet read."""
CARRY = 4096


def full_scale_for(session: Session) -> float:
    """The LSM6DSO's full scale: the session's own or 250 dps, or the smallest above it that holds the data, deg/s."""
    wanted = session.full_scale_dps or DEFAULT_FULL_SCALE_DPS
    peak = max(float(np.abs(run.gyro_dps).max()) for run in session.runs)
    for full_scale, lsb in LSB_DPS.items():
        if full_scale >= wanted and peak <= 32767.5 * lsb:
            return full_scale
    raise InputError(f"the session reaches {max(peak, wanted):.0f} deg/s; the simulated LSM6DSO measures up to 2000")


def rows_bytes(session: Session) -> bytes:
    """A session as the simulator's ROWS file (see its main.c): raw counts, each row at its own time.

    Without an accelerometer a run has +-1 g along its axis by its face, without temperature 25 degC.
    """
    full_scale = full_scale_for(session)
    cycles = {name: i for i, name in enumerate(session.scenarios)}
    entries = np.zeros(len(session.runs), _RUN)
    tables = []
    first = 0
    for entry, run in zip(entries, session.runs, strict=True):
        rows = _rows(run, LSB_DPS[full_scale])
        entry["first_row"], entry["n_rows"] = first, len(rows)
        entry["face"], entry["axis"] = int(run.face_sign), run.axis_index
        entry["table_dps"] = np.nan if run.table_rate_dps is None else run.table_rate_dps
        entry["turn_deg"] = np.nan if run.turn_deg is None else run.turn_deg
        entry["power_on_s"] = 0.0 if run.power_on_s is None else run.power_on_s
        entry["power_cycle"] = cycles[run.scenario]
        first += len(rows)
        tables.append(rows)
    head = struct.pack("<8sIIff8x", ROWS_MAGIC, len(entries), first, session.sample_rate_hz, full_scale)
    return b"".join([head, entries.tobytes(), *(rows.tobytes() for rows in tables)])


def _rows(run: Run, lsb_dps: float) -> np.ndarray[Any, Any]:
    rows = np.zeros(len(run), _ROW)
    rows["t_us"] = run.t_us
    # Each rounding error is carried into the next sample: rates off the part's grid keep their means and integrals.
    whole = np.rint(np.cumsum(run.gyro_dps / lsb_dps, axis=0))
    rows["gyro"] = _counts(np.diff(whole, axis=0, prepend=0.0))
    still = np.zeros((len(run), 3))
    still[:, run.axis_index] = run.face_sign
    acc_g = still if run.acc_g is None else np.where(np.isnan(run.acc_g), still, run.acc_g)
    rows["acc"] = _counts(acc_g / LSB_G)
    temp_c = np.full(len(run), ZERO_C) if run.temp_c is None else np.nan_to_num(run.temp_c, nan=ZERO_C)
    rows["temp"] = _counts((temp_c - ZERO_C) * COUNTS_PER_C)
    return rows


def _counts(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return np.clip(np.rint(values), -32768, 32767).astype(np.int16)


def sim_command(
    rows: Path,
    *,
    imu: int = 0,
    speed: str = "max",
    stream: str = "raw",
    fault: str | None = None,
    fifo: int = 0,
    hold: bool = False,
    include_dir: Path | None = None,
) -> list[str]:
    """The simulator's command line; compiles it if need be.

    ``imu``: the sensor's number on its board. ``fifo``: samples that the device takes at once out of the sensor's FIFO,
    0 = none. ``include_dir``: other calibration.h and weights.h.
    """
    from gyrocal.core import library

    binary = library.build_sim() if include_dir is None else library.build_sim(include_dir)
    command = [str(binary), str(rows), "--imu", str(imu), "--speed", speed, "--stream", stream, "--fifo", str(fifo)]
    if fault is not None:
        known = [line.split("\t")[0] for line in faults().splitlines()]
        if fault not in known:
            raise InputError(f"--fault {fault}: there are {', '.join(known)}")
        command += ["--fault", fault]
    return [*command, "--hold"] if hold else command


def replay(
    session: Session | str | Path,
    *,
    stream: str = "raw",
    fault: str | None = None,
    fifo: int = 0,
    include_dir: Path | None = None,
) -> list[Sentence]:
    """Run a session through the device as fast as it goes, without a port; all that it said.

    Raises:
        DeviceError: the simulator failed, or a sentence was lost.
    """
    with _rows_file(session) as rows:
        command = sim_command(rows, stream=stream, fault=fault, fifo=fifo, include_dir=include_dir)
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    _check_exit(done.returncode, done.stderr)
    reader = Reader()
    sentences = reader.feed(done.stdout)
    if reader.bad or reader.lost or reader.overlong:
        raise DeviceError(f"simulated device: {reader.bad} bad, {reader.lost} lost, {reader.overlong} overlong sentences")
    return sentences


@contextlib.contextmanager
def _rows_file(session: Session | str | Path) -> Iterator[Path]:
    content = rows_bytes(session if isinstance(session, Session) else Session.open(session))
    with tempfile.TemporaryDirectory(prefix="gyrocal-") as folder:
        path = Path(folder) / "rows"
        path.write_bytes(content)
        yield path


def _check_exit(code: int, stderr: bytes) -> None:
    if code:
        lines = stderr.decode("utf-8", "replace").strip().splitlines() or [f"exit code {code}"]
        raise (InputError if code == 2 else DeviceError)(f"simulated device: {lines[-1]}")


class Outlet(Protocol):
    """Where a reader connects: one at a time, any number after each other.

    ``connected`` tells whether one is there; ``read`` and ``write`` never block; ``fd`` is what to wait for.
    """

    name: str

    def connected(self) -> bool: ...
    def fd(self) -> int: ...
    def read(self) -> bytes: ...
    def write(self, data: bytes) -> int: ...
    def drained(self) -> bool: ...
    def close(self) -> None: ...


class PtyOutlet:
    """A pseudo terminal; ``symlink`` gives it a name that lasts."""

    def __init__(self, symlink: Path | None = None) -> None:
        import tty

        self._master, slave = os.openpty()
        tty.setraw(slave)  # else what the device says would come back to it as commands
        self._slave_name = self.name = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, 0)
        self._symlink = symlink
        if symlink is not None:
            self.name = str(symlink)
            try:
                if symlink.is_symlink() and os.readlink(symlink).startswith(PSEUDO_TERMINALS):
                    symlink.unlink()  # an earlier device's
                symlink.symlink_to(self._slave_name)
            except OSError as error:
                os.close(self._master)
                raise InputError(f"{symlink}: cannot make this link: {error.strerror}") from None

    def connected(self) -> bool:
        return not any(event & select.POLLHUP for _, event in self._poll.poll(0))

    def fd(self) -> int:
        return self._master

    def read(self) -> bytes:
        try:
            return os.read(self._master, CHUNK)
        except OSError:  # nothing there, or the reader has just gone
            return b""

    def write(self, data: bytes) -> int:
        try:
            return os.write(self._master, data)
        except OSError:
            return 0

    def drained(self) -> bool:
        """Whether the reader has read everything: what it has not read would be lost with the port."""
        import fcntl
        import termios

        slave = os.open(self._slave_name, os.O_RDWR | os.O_NOCTTY)
        try:
            unread = fcntl.ioctl(slave, termios.FIONREAD, b"\0\0\0\0")
        finally:
            os.close(slave)
        return unread == b"\0\0\0\0"

    def close(self) -> None:
        os.close(self._master)
        if self._symlink is not None and self._symlink.is_symlink() and os.readlink(self._symlink) == self._slave_name:
            self._symlink.unlink()


class TcpOutlet:
    """A TCP port for ``socket://host:port``; port 0 takes a free one."""

    def __init__(self, address: str) -> None:
        host, _, number = address.rpartition(":")
        try:
            self._server = socket.create_server((host or "127.0.0.1", int(number)))
        except (OSError, ValueError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or "want HOST:PORT, for example 127.0.0.1:5000"
            raise InputError(f"--tcp {address}: {reason}") from None
        self._server.setblocking(False)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 * CARRY)
        self._client: socket.socket | None = None
        self._second: socket.socket | None = None
        self._second_s = 0.0
        self.name = f"socket://{host or '127.0.0.1'}:{self._server.getsockname()[1]}"

    def connected(self) -> bool:
        if self._client is None:
            self._client, self._second = self._second or self._accept(), None
        elif self._second is None:
            self._second, self._second_s = self._accept(), time.monotonic()
        elif time.monotonic() - self._second_s > TURN_AWAY_S:
            with contextlib.suppress(OSError):
                self._second.send(f"# {BUSY_NOTE}\n".encode())
            self._second.close()
            self._second = None
        return self._client is not None

    def _accept(self) -> socket.socket | None:
        try:
            client, _ = self._server.accept()
        except BlockingIOError:
            return None
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return client

    def fd(self) -> int:
        return self._server.fileno() if self._client is None else self._client.fileno()

    def read(self) -> bytes:
        assert self._client is not None
        try:
            data = self._client.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._drop()
        return data

    def write(self, data: bytes) -> int:
        if self._client is None:
            return 0
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._drop()
            return 0

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def drained(self) -> bool:
        """Whether the reader has hung up after the end of the stream: closing before that could take data from it."""
        if self._client is not None:
            with contextlib.suppress(OSError):
                self._client.shutdown(socket.SHUT_WR)
            self.read()
        return self._client is None

    def close(self) -> None:
        self._drop()
        if self._second is not None:
            self._second.close()
        self._server.close()


def serve(
    commands: Sequence[Sequence[str]],
    outlet: Outlet,
    *,
    wait_for_reader: bool,
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Carry bytes between the simulators and whoever opens the outlet, until they end and all of it is read.

    There is one a sensor of the board; commands go to all, sentences come whole. They start with the first reader. With
    ``wait_for_reader`` they wait while nobody reads; without, they run on in their own time, and what is said while nobody
    listens is gone, as on a wire.

    Raises:
        DeviceError: a simulator failed.
    """
    while not outlet.connected():
        if stopped():
            return
        time.sleep(WAIT_S)
    with contextlib.ExitStack() as stack:
        sims = [stack.enter_context(_Sim(command, short=wait_for_reader)) for command in commands]
        _carry(sims, outlet, wait_for_reader, stopped)
        if stopped():
            return
        for sim in sims:
            sim.check_exit()
        _drain(outlet, stopped)


class _Sim:
    """A running simulator, for a ``with`` block. ``fd`` is what to wait for."""

    def __init__(self, command: Sequence[str], *, short: bool) -> None:
        self.ended = False
        self._rest = b""
        self.fd, to_host = _pipe(short=short)
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=to_host, stderr=pipe, bufsize=0)
        os.close(to_host)

    def __enter__(self) -> _Sim:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self.fd)
        for end in (self._process.stdin, self._process.stderr):
            if end is not None:
                end.close()

    def read(self) -> bytes:
        """The lines that have come whole, and at its end whatever is left."""
        data = os.read(self.fd, CARRY)
        self.ended = not data
        lines, newline, self._rest = (self._rest + data).rpartition(b"\n")
        return self._rest if self.ended else lines + newline

    def write(self, data: bytes) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            while data:
                data = data[os.write(self._process.stdin.fileno(), data) :]

    def check_exit(self) -> None:
        assert self._process.stderr is not None
        _check_exit(self._process.wait(), self._process.stderr.read())


def _carry(sims: Sequence[_Sim], outlet: Outlet, wait_for_reader: bool, stopped: Callable[[], bool]) -> None:
    pending = b""
    was_there = False
    going = list(sims)
    for sim in sims:
        sim.write(b"hello\n")  # its first hello comes before its settings
    while (going or pending) and not stopped():
        there = outlet.connected()
        if there and not was_there:
            pending = f"# {REPLAY_NOTE}\n".encode() + pending
        elif not there and not wait_for_reader:
            pending = b""
        was_there = there
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
            going = [sim for sim in going if not sim.ended]


def _pipe(*, short: bool) -> tuple[int, int]:
    """A pipe; a short one lets the device run no further ahead of its reader than it must."""
    reading, writing = os.pipe()
    if short:
        import fcntl

        with contextlib.suppress(AttributeError, OSError):  # Linux alone can
            fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, CARRY)
    return reading, writing


def _drain(outlet: Outlet, stopped: Callable[[], bool]) -> None:
    """Wait until the reader has taken what is on its way, or has gone."""
    quiet = 0
    while outlet.connected() and quiet < 2 and not stopped():
        quiet = quiet + 1 if outlet.drained() else 0
        time.sleep(WAIT_S)


def make_outlet(tcp: str | None = None, symlink: Path | None = None) -> Outlet:
    """A TCP port if ``tcp`` gives its address, else a pseudo terminal."""
    if tcp is not None:
        return TcpOutlet(tcp)
    if not hasattr(os, "openpty"):
        raise GyrocalError("this system has no pseudo terminals; use --tcp 127.0.0.1:5000")
    return PtyOutlet(symlink)


class SimulatedDevice:
    """The simulated device at a virtual port, for a ``with`` block; ``port`` is what to open.

    Args:
        session: the session to replay, open or by its folder; several: one a sensor of the board.
        speed: ``max``, or how many times faster than real time.
        fifo: samples that the device takes at once out of the sensor's FIFO, 0 = none.
        include_dir: other calibration.h and weights.h than the shipped ones.
        tcp: ``HOST:PORT`` instead of a pseudo terminal.
        hold: when all rows are served, stay and answer commands.
    """

    def __init__(
        self,
        session: Session | str | Path | Sequence[Session],
        speed: str | float = "max",
        include_dir: Path | None = None,
        *,
        stream: str = "raw",
        fault: str | None = None,
        fifo: int = 0,
        tcp: str | None = None,
        symlink: Path | None = None,
        hold: bool = False,
    ) -> None:
        self._stack = contextlib.ExitStack()
        self._stopped = threading.Event()
        self._error: GyrocalError | None = None
        with contextlib.ExitStack() as stack:
            text = check_speed(speed)
            sensors = [session] if isinstance(session, Session | str | Path) else session
            self._commands = [
                sim_command(
                    stack.enter_context(_rows_file(one)), imu=imu, speed=text, stream=stream, fault=fault, fifo=fifo,
                    hold=hold, include_dir=include_dir,
                )
                for imu, one in enumerate(sensors)
            ]  # fmt: skip
            self._outlet = make_outlet(tcp, symlink)
            stack.callback(self._outlet.close)
            self._wait_for_reader = text == "max" or float(text) > 1.0
            self._stack = stack.pop_all()
        self.port = self._outlet.name
        self._thread = threading.Thread(target=self._run, name="simulated device", daemon=True)

    def __enter__(self) -> SimulatedDevice:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._stopped.set()
        self._thread.join()
        if self._error is not None and kind is None:
            raise self._error

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the device has ended and everything was read; False if it still runs."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            serve(self._commands, self._outlet, wait_for_reader=self._wait_for_reader, stopped=self._stopped.is_set)
        except GyrocalError as error:
            self._error = error
        finally:
            self._stack.close()


def simulated_scenario(effects: Sequence[str], seed: int) -> Session:
    """One scenario of the paper's campaign, face up then face down, with effects planted."""
    from gyrocal.simulation import simulate

    session, _ = simulate.simulate(None, "paper", effects, seed, scenarios=1)
    return session


def faults() -> str:
    """The simulator's own list of faults, one a line: name, tab, what happens."""
    from gyrocal.core import library

    done = subprocess.run([library.build_sim(), "--fault", "list"], capture_output=True, text=True, check=False)
    return done.stdout


def check_speed(speed: str | float) -> str:
    """``max`` or a positive factor, as the simulator takes it."""
    text = speed if isinstance(speed, str) else f"{speed:g}"
    if text != "max":
        try:
            if not 0.0 < float(text) < float("inf"):
                raise ValueError
        except ValueError:
            raise InputError(f"--speed {text}: want max, or how many times faster than real time (1 = real time)") from None
    return text
