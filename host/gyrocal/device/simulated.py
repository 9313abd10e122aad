"""The simulated device: the firmware's own C core processes a session's rows, behind a virtual port or without one.

The simulator uses its standard input and output, which a pseudo terminal or a TCP port is connected to. The replay begins when
the port is first opened.
"""

from __future__ import annotations

import contextlib
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path

from gyrocal.device.outlet import make_outlet
from gyrocal.device.rows import rows_file
from gyrocal.device.simulator import DEFAULT_BUS, DEFAULT_PART, check_exit, serve, sim_command
from gyrocal.device.wire import Reader, Sentence
from gyrocal.errors import DeviceError, GyrocalError, InputError
from gyrocal.recording.session import Session


def replay(
    session: Session | str | Path,
    *,
    stream: str = "raw",
    faults: Sequence[str] = (),
    fifo: int = 0,
    part: str = DEFAULT_PART,
    bus: str = DEFAULT_BUS,
    include_dir: Path | None = None,
) -> list[Sentence]:
    """Run a session through the device at full speed, without a port, and return its sentences.

    Raises:
        DeviceError: the simulator failed, or a sentence was lost.
    """
    with rows_file(session) as rows:
        command = sim_command(rows, stream=stream, faults=faults, fifo=fifo, part=part, bus=bus, include_dir=include_dir)
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    check_exit(done.returncode, done.stderr)
    reader = Reader()
    sentences = reader.feed(done.stdout)
    if reader.bad or reader.lost or reader.overlong:
        raise DeviceError(f"simulated device: {reader.bad} bad, {reader.lost} lost, {reader.overlong} overlong sentences")
    return sentences


class SimulatedDevice:
    """The simulated device at a virtual port, as a context manager. ``port`` is the name to open.

    Args:
        session: the session to replay, or its folder; several for a board with one sensor for each.
        speed: ``max``, or the factor by which it is faster than real time.
        fifo: the number of samples that the device takes from the sensor's FIFO at once; 0 for none.
        part: the kind of sensor.
        bus: i2c or spi, between the sensor and its board.
        include_dir: the folder of calibration.h and weights.h, if not the shipped ones.
        tcp: ``HOST:PORT`` for a TCP port instead of a pseudo terminal.
        token: what a reader of the TCP port must say first, as a board wants it by Wi-Fi.
        hold: True to keep the device running after the last row, so that it answers commands.
        bench: True to replay nothing: the device lies still, with noise and flash, and answers commands.
    """

    def __init__(
        self,
        session: Session | str | Path | Sequence[Session],
        speed: str | float = "max",
        include_dir: Path | None = None,
        *,
        stream: str = "raw",
        faults: Sequence[str] = (),
        fifo: int = 0,
        part: str = DEFAULT_PART,
        bus: str = DEFAULT_BUS,
        tcp: str | None = None,
        token: str | None = None,
        symlink: Path | None = None,
        hold: bool = False,
        bench: bool = False,
    ) -> None:
        self._stack = contextlib.ExitStack()
        self._stopped = threading.Event()
        self._error: GyrocalError | None = None
        with contextlib.ExitStack() as stack:
            text = check_speed(speed)
            sensors = [session] if isinstance(session, Session | str | Path) else session
            self._commands = [
                sim_command(
                    stack.enter_context(rows_file(one)), imu=imu, speed=text, stream=stream, faults=faults, fifo=fifo,
                    part=part, bus=bus, hold=hold, bench=bench, include_dir=include_dir,
                )
                for imu, one in enumerate(sensors)
            ]  # fmt: skip
            self._outlet = make_outlet(tcp, symlink, token)
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
        """Wait until the device has ended and everything was read. Returns False if it is still running."""
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
    """Simulate one scenario of the paper's campaign, face up then face down, with planted effects."""
    from gyrocal.simulation import simulate

    session, _ = simulate.simulate(None, "paper", effects, seed, scenarios=1)
    return session


def check_speed(speed: str | float) -> str:
    """Check a speed, ``max`` or a positive factor, and return it as an argument of the simulator."""
    text = speed if isinstance(speed, str) else f"{speed:g}"
    if text != "max":
        try:
            if not 0.0 < float(text) < float("inf"):
                raise ValueError
        except ValueError:
            raise InputError(f"--speed {text}: write max, or how many times faster than real time (1 = real time)") from None
    return text
