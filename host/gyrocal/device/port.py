"""A device at a port: a serial device, a pseudo terminal, ``tcp://host:port``, ``ble://name``, or ``socket://host:port``.

The other modules use :class:`Link`, which receives sentences and sends commands. Opening a serial port may reset the board,
so the host waits for the device's hello before it sends anything else.
"""

from __future__ import annotations

import contextlib
import errno
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from gyrocal.device.address import BLE, TOKEN_VARIABLE, Address, is_address, without_token
from gyrocal.device.wire import PROTOCOL, Reader, Sentence
from gyrocal.errors import DeviceError

BAUD = 921600
TEXT_MOST_HZ = 1000.0
"""The fastest samples that go as text: what a day later still fits ``BAUD`` (docs/wire.md)."""
POLL_S = 0.05
"""The longest time that a read takes."""
CHUNK = 65536
HELLO_S = 10.0
"""A board that starts searches its buses first; one without a sensor searches other pins too."""
ANSWER_S = 3.0
RETRY_S = 0.5
REPLAY_NOTE = "replay: this device starts and stops its runs by itself"
"""The log line that a simulated device sends before each answer to a hello."""
BUSY = "another program has it open; close that one first"
BUSY_NOTE = "busy: " + BUSY
"""The log line with which a simulated device rejects a second reader."""
TOKEN_NOTE = "token: this device was not given its token"
"""The log line with which a device rejects a reader that does not know its token (gc_remote.h)."""
QUIET_S, ASKS = 5, 3
"""A network's device of which nothing comes for so long is asked by TCP so many times, a second apart, whether it is there."""
REFUSALS = range(-29, -19)
"""Error codes (gc_error.h) that answer a command. All others concern the sensor."""
SETTINGS = ("rate_hz", "table_dps", "full_scale_dps")
"""The settings that advice names."""


class PortGone(DeviceError):
    """The device was unplugged, or the simulated device ended."""


class Port(Protocol):
    """A port that carries bytes. ``read`` waits for at most ``POLL_S`` and returns an empty answer if nothing came."""

    def read(self) -> bytes:
        """The bytes that have arrived. Raises DeviceError if the port is gone."""

    def write(self, data: bytes) -> None:
        """Write all bytes. Raises DeviceError if the port is gone."""

    def close(self) -> None:
        """Close the port."""


class SerialPort(Port):
    """A serial device or a pseudo terminal, through pyserial (its other URLs too)."""

    def __init__(self, name: str, baud: int = BAUD) -> None:
        import serial

        self.name = name
        try:
            self._serial = serial.serial_for_url(
                name, baudrate=baud, timeout=POLL_S, write_timeout=ANSWER_S, exclusive=True
            )
        except (OSError, ValueError, serial.SerialException) as error:
            raise DeviceError(_why_not_open(name, error)) from None

    def read(self) -> bytes:
        try:
            return self._serial.read(min(self._serial.in_waiting or 1, CHUNK))
        except (OSError, TypeError) as error:  # pyserial's own errors are OSErrors; a closed port gives TypeError
            raise _gone(self.name, error) from None

    def write(self, data: bytes) -> None:
        import serial

        try:
            self._serial.write(data)
        except serial.SerialTimeoutException:
            raise DeviceError(
                f"{self.name}: the device does not take commands; unplug it and plug it in again"
            ) from None
        except OSError as error:
            raise _gone(self.name, error) from None

    def close(self) -> None:
        """Close the port without a reset of the board.

        RTS alone pulls the reset line, and Windows lets go of DTR first when a port is closed: so RTS goes before it.
        """
        with contextlib.suppress(OSError):
            self._serial.rts = False
            self._serial.dtr = False
        with contextlib.suppress(OSError):
            self._serial.close()


class SocketPort(Port):
    """``tcp://host:port`` of a board, which is given its token first, or ``socket://host:port`` of ``gyrocal device --tcp``."""

    def __init__(self, name: str) -> None:
        self.name = without_token(name)
        to = Address.parse(name)
        try:
            self._socket = socket.create_connection((to.host, to.port), timeout=ANSWER_S)
        except OSError as error:
            reason = error.strerror or str(error)
            running = f"is `gyrocal device --tcp {to.host}:{to.port}` running there?"
            there = "is the board on, and in this network? Through the cable, `gyrocal wifi` tells its address"
            raise DeviceError(f"{self.name}: {reason}; {there if to.token else running}") from None
        self._socket.settimeout(POLL_S)
        _notice_silence(self._socket)
        if to.token:
            self.write(f"token {to.token}\n".encode("ascii"))

    def read(self) -> bytes:
        try:
            data = self._socket.recv(CHUNK)
        except TimeoutError:
            return b""
        except OSError as error:
            raise _gone(self.name, error) from None
        if not data:
            raise _gone(self.name)
        return data

    def write(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise _gone(self.name, error) from None

    def close(self) -> None:
        self._socket.close()


def _notice_silence(connection: socket.socket) -> None:
    """Let the system find out that a device is gone which went without a word, for example out of reach."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in {"TCP_KEEPIDLE": QUIET_S, "TCP_KEEPINTVL": 1, "TCP_KEEPCNT": ASKS}.items():
        if hasattr(socket, option):
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)


def open_port(name: str, baud: int = BAUD) -> Port:
    """Open a serial device, a pseudo terminal, an address, or a URL that pyserial knows. Raises DeviceError if that fails."""
    if name.startswith(f"{BLE}://"):
        from gyrocal.device.ble import BlePort

        return BlePort(name)
    return SocketPort(name) if is_address(name) else SerialPort(name, baud)


def _gone(name: str, error: BaseException | None = None) -> PortGone:
    why = f" ({error})" if error is not None and str(error) and not isinstance(error, TypeError) else ""
    return PortGone(f"{name}: the device is gone: unplugged, or it ended{why}")


def _why_not_open(name: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number == errno.EACCES:
        return f"{name}: no permission; add yourself to its group (sudo usermod -aG dialout $USER) and log in again"
    if number in (errno.EBUSY, errno.EWOULDBLOCK):  # taken, locked
        return f"{name}: {BUSY}"
    if number == errno.ENOENT or (number is None and not Path(name).exists() and "://" not in name):
        from serial.tools.list_ports import comports

        there = ", ".join(p.device for p in comports() if p.hwid != "n/a")
        starting = "" if name.startswith("/dev/") else ", or wait until `gyrocal device` has printed its name"
        return f"{name}: no such port; plug the device in{starting}. Ports here: {there or 'none'}"
    if number == errno.ENOTTY or Path(name).is_file():
        return f"{name}: a file and no port; give a serial device such as /dev/ttyUSB0, or socket://HOST:PORT"
    return f"{name}: cannot be opened as a serial port: {error}"


class Link:
    """A conversation with the device at a port.

    Args:
        name: the name of the port.
        reconnect: True to reopen the port until a device that went away is back, instead of raising PortGone.
        baud: the speed of a serial device, bits per second.
        opener: the function that opens a port by its name and speed.

    ``reader`` counts good, bad and lost sentences. ``hello`` is the latest ``$HEL``. ``answered`` is True if that answers a
    hello; otherwise the device has just started.
    """

    def __init__(
        self, name: str, *, reconnect: bool = False, baud: int = BAUD, opener: Callable[[str, int], Port] = open_port
    ) -> None:
        self.name = without_token(name)
        self._address = name
        self._opener = opener
        self.reader = Reader()
        self.hello: Sentence | None = None
        self.answered = False
        self._hello_taken = False
        self._baud = baud
        self._reconnect = reconnect
        self._kept: list[Sentence] = []
        self._retry_at = 0.0
        self._port: Port | None = opener(name, baud)

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the port if it is open."""
        if self._port is not None:
            self._port.close()
            self._port = None

    @property
    def connected(self) -> bool:
        """True while the port is open."""
        return self._port is not None

    @property
    def replays(self) -> bool:
        """True if this is a simulated device that starts and stops runs by itself."""
        return REPLAY_NOTE in self.reader.logs

    @property
    def stream(self) -> str:
        """The command for samples: as text, or packed where the device's rate is more than text carries."""
        rate_hz = self.hello.real("rate_hz") if self.hello is not None else None
        return "stream packed" if rate_hz is not None and rate_hz > TEXT_MOST_HZ else "stream raw"

    def receive(self) -> list[Sentence]:
        """The sentences that have come, after at most ``POLL_S``; empty if none came.

        Raises:
            PortGone: the device is gone, and ``reconnect`` is False.
        """
        if self._kept:
            kept, self._kept = self._kept, []
            return kept
        return self._read()

    def greet(self, timeout_s: float = HELLO_S) -> Sentence:
        """Send hello until the device answers. Sentences that come meanwhile are kept for :meth:`receive`.

        The ``$HEL`` of a device that starts does not count, because its settings may still follow.

        Raises:
            DeviceError: no answer, or one in another version of the protocol.
        """
        deadline = time.monotonic() + timeout_s
        say_at = 0.0
        kept: list[Sentence] = []
        self.answered = False
        try:
            while not self.answered:
                now = time.monotonic()
                if now > deadline:
                    reader = self.reader
                    damage = f"{reader.bad} lines that do not check, {reader.skipped} bytes that are no text of a device"
                    heard = f"{len(kept)} sentences but no $HEL" if kept else damage
                    raise DeviceError(
                        f"{self.name}: no hello from a gyrocal device within {timeout_s:g} s ({heard}); "
                        f"is its firmware on it, at {self._baud} baud?"
                    )
                if now >= say_at:
                    self.send("hello")
                    say_at = now + RETRY_S
                kept += self.receive()
        finally:
            self._kept = kept + self._kept
        assert self.hello is not None
        proto = self.hello.fields.get("proto")
        if proto != str(PROTOCOL):
            raise DeviceError(f"{self.name}: speaks protocol {proto}, this gyrocal speaks {PROTOCOL}; flash it again")
        return self.hello

    def send(self, text: str) -> None:
        """Send one command without waiting for its answer."""
        self._write(text.encode() + b"\n")

    def command(self, text: str, timeout_s: float = ANSWER_S, *, secret: str = "") -> Sentence:
        """Send one command and return its ``$ACK``. This and all others are kept for :meth:`receive`, so that none seems lost.

        Args:
            text: the command.
            timeout_s: how long to wait for the answer.
            secret: what is sent behind ``text`` and shown in no message.

        Raises:
            DeviceError: the device refused, with its own advice in the message, or it did not answer.
        """
        word = text.split()[0]
        self.send(text + secret)
        deadline = time.monotonic() + timeout_s
        why = "no answer"
        kept, self._kept = self._kept, []
        try:
            while time.monotonic() < deadline:
                fresh = self._read()
                for i, sentence in enumerate(fresh):
                    if sentence.tag == "ACK" and sentence.fields.get("cmd") == word:
                        kept += fresh[i:]
                        return sentence
                    kept.append(sentence)
                    if sentence.tag != "ERR":
                        continue
                    why = describe_error(sentence)
                    if sentence.real("code") in REFUSALS:
                        kept += fresh[i + 1 :]
                        raise DeviceError(f"{self.name}: `{text}` refused: {why}")
        finally:
            self._kept = kept
        raise DeviceError(f"{self.name}: `{text}` was not taken within {timeout_s:g} s: {why}")

    def take_before(self, answer: Sentence) -> list[Sentence]:
        """The kept sentences that came before an answer of :meth:`command`. The answer and the later ones stay kept."""
        at = self._kept.index(answer)
        earlier, self._kept = self._kept[:at], self._kept[at:]
        return earlier

    def _read(self) -> list[Sentence]:
        if self._port is None:
            self._reopen()
            return []
        try:
            sentences = self.reader.feed(self._port.read())
        except PortGone:
            self.reader.cut()
            if BUSY_NOTE in self.reader.logs and not self.reader.good:
                raise DeviceError(f"{self.name}: {BUSY}") from None
            if TOKEN_NOTE in self.reader.logs:
                raise DeviceError(
                    f"{self.name}: the device has another token; set {TOKEN_VARIABLE} to its own, or give it a new one by "
                    "`gyrocal wifi` through the cable"
                ) from None
            if not self._reconnect:
                raise
            self.close()
            return []
        for sentence in sentences:
            if sentence.tag == "HEL":
                self.hello, self.answered, self._hello_taken = sentence, self._hello_taken, False
            elif sentence.tag == "ACK" and sentence.fields.get("cmd") == "hello":
                self._hello_taken = True
        return sentences

    def _reopen(self) -> None:
        time.sleep(POLL_S)
        if time.monotonic() < self._retry_at:
            return
        self._retry_at = time.monotonic() + RETRY_S
        with contextlib.suppress(DeviceError):
            self._port = self._opener(self._address, self._baud)

    def _write(self, data: bytes) -> None:
        if self._port is None:
            return
        try:
            self._port.write(data)
        except PortGone:
            self._hear_last_words()
            if not self._reconnect:
                raise
            self.close()

    def _hear_last_words(self) -> None:
        """Read what a device sent before it closed the port: it may say why, and then this raises DeviceError."""
        deadline = time.monotonic() + RETRY_S
        while self._port is not None and time.monotonic() < deadline:
            self._kept += self._read()


def describe_error(sentence: Sentence) -> str:
    """An ``$ERR`` as text for the user: its name, code and advice."""
    fields = sentence.fields
    advice = fields.get("advice", "").replace("_", " ")
    for setting in SETTINGS:  # as they are typed: in a sentence a blank is an underscore, too
        advice = advice.replace(setting.replace("_", " "), setting)
    return f"{fields.get('name', '?')} ({fields.get('code', '?')})" + (f": {advice}" if advice else "")
