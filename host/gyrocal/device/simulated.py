"""The simulated device: a session's rows through the firmware's own C core, behind a virtual port or without one.

The simulator talks through its standard input and output; a pseudo terminal or a TCP port is put in front of it. The replay
begins when the port is first opened.
"""

from __future__ import annotations

import contextlib
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path

from gyrocal.device.outlet import make_outlet
from gyrocal.device.rows import rows_file
from gyrocal.device.simulator import check_exit, serve, sim_command
from gyrocal.device.wire import Reader, Sentence
from gyrocal.errors import DeviceError, GyrocalError, InputError
from gyrocal.recording.session import Session


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
    with rows_file(session) as rows:
        command = sim_command(rows, stream=stream, fault=fault, fifo=fifo, include_dir=include_dir)
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    check_exit(done.returncode, done.stderr)
    reader = Reader()
    sentences = reader.feed(done.stdout)
    if reader.bad or reader.lost or reader.overlong:
        raise DeviceError(f"simulated device: {reader.bad} bad, {reader.lost} lost, {reader.overlong} overlong sentences")
    return sentences


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
                    stack.enter_context(rows_file(one)), imu=imu, speed=text, stream=stream, fault=fault, fifo=fifo,
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
