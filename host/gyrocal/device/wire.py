"""The codec of the wire: sentences to and from bytes, as the core's PROTOCOL.md specifies (version 1).

The host reads in chunks of any length: :class:`Reader` cuts them into lines, checks each line's CRC and each sensor's
sequence numbers, and counts what is missing.
"""

from __future__ import annotations

import binascii
import math
import re
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from gyrocal.device.packed import MAX_FRAME, unpack
from gyrocal.errors import DeviceError

PROTOCOL = 1
MAX_LINE = 320
"""The longest line in bytes, with its line end."""
MAX_FIELDS = 24

RAW_FIELDS = ("n", "gx", "gy", "gz", "ax", "ay", "az", "temp")
_REAL = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?").fullmatch
SEQ_RANGE = 1 << 32
_T_RANGE = 1 << 64
_IMU_RANGE = 1 << 8

Field = str | int | float | None


class Sentence(NamedTuple):
    """One sentence whose CRC is correct. ``t_us`` is the device time in microseconds, ``text`` the fields as they came."""

    tag: str
    seq: int
    t_us: int
    imu: int
    text: str

    @property
    def fields(self) -> dict[str, str]:
        """The ``name=value`` fields. A missing value is an empty string."""
        return {name: value for name, equals, value in (p.partition("=") for p in self.text.split(",")) if equals}

    def real(self, name: str) -> float | None:
        """The field ``name`` as a number; None if it is absent, empty or not a finite number."""
        return parse_real(self.fields.get(name, ""))


@dataclass(frozen=True)
class RawTable:
    """The samples of ``$RAW`` sentences, in order.

    ``t_us`` int64 [n], device time; ``imu`` int64 [n]; ``number`` int64 [n], the sample's number in its run or -1;
    ``counts`` float64 [n, 7]: gx, gy, gz, ax, ay, az, temp in raw counts, NaN where the device has none.
    """

    t_us: np.ndarray[Any, np.dtype[np.int64]]
    imu: np.ndarray[Any, np.dtype[np.int64]]
    number: np.ndarray[Any, np.dtype[np.int64]]
    counts: np.ndarray[Any, np.dtype[np.float64]]

    def __len__(self) -> int:
        return len(self.t_us)


def raw_table(sentences: Iterable[Sentence]) -> RawTable:
    """The ``$RAW`` sentences among ``sentences`` as arrays. Raises DeviceError if one lacks a field or holds a wrong value."""
    raw = [s for s in sentences if s.tag == "RAW"]
    for sentence in raw:
        if sentence.text.count(",") != len(RAW_FIELDS) - 1 or sentence.t_us >= _T_RANGE // 2:
            raise _not_raw(sentence)
    try:
        values = _integers([s.text for s in raw])
    except (ValueError, OverflowError):
        for sentence in raw:
            try:
                _integers([sentence.text])
            except (ValueError, OverflowError):
                raise _not_raw(sentence) from None
        raise
    return RawTable(
        np.fromiter((s.t_us for s in raw), np.int64, len(raw)),
        np.fromiter((s.imu for s in raw), np.int64, len(raw)),
        values[:, 0].astype(np.int64),
        values[:, 1:],
    )


def _integers(texts: list[str]) -> np.ndarray[Any, np.dtype[np.float64]]:
    cells = ",".join(texts).split(",") if texts else []
    values = np.array([int(cell) if cell else math.nan for cell in cells], np.float64).reshape(-1, len(RAW_FIELDS))
    if not np.all(np.abs(values[:, 0]) < SEQ_RANGE):
        raise ValueError("a sample without a number")
    return values


def _not_raw(sentence: Sentence) -> DeviceError:
    return DeviceError(f"sentence {sentence.seq}: $RAW wants the counts {','.join(RAW_FIELDS)}, got {sentence.text!r}")


def crc16(body: bytes) -> int:
    """CRC-16/CCITT-FALSE of the bytes between ``$`` and ``*``."""
    return binascii.crc_hqx(body, 0xFFFF)


def format_field(value: Field) -> str:
    """The text of a field: 9 significant digits for real numbers, empty for a missing value."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def parse_real(text: str) -> float | None:
    """The text of a field as a number; None if it is empty or not a finite decimal number."""
    value = float(text) if _REAL(text) else math.nan
    return value if math.isfinite(value) else None


def parse_value(text: str) -> int | float | str | None:
    """The text of a field as the type that it has: an integer, a real number, None or a word."""
    if re.fullmatch(r"-?[0-9]{1,18}", text):
        return int(text)
    number = parse_real(text)
    return number if number is not None or not text else text


def encode(tag: str, seq: int, t_us: int, imu: int, fields: Mapping[str, Field] | Iterable[Field]) -> bytes:
    """Write one sentence with its newline. A mapping gives ``name=value`` fields, other values give positional ones."""
    if isinstance(fields, Mapping):
        texts = [f"{name}={format_field(value)}" for name, value in fields.items()]
    else:
        texts = [format_field(value) for value in fields]
    body = ",".join([tag, str(seq), str(t_us), str(imu), *texts]).encode("utf-8")
    line = b"$%s*%04X" % (body, crc16(body))
    decode(line)
    return line + b"\n"


def decode(line: bytes) -> Sentence:
    """Read one sentence from a line, with or without its newline. Raises DeviceError if the line is not a valid sentence."""
    line = line.removesuffix(b"\n")
    sentence = _parse(line)
    if sentence is not None:
        return sentence
    shown = ascii(line[:80])[1:]
    line = line.removesuffix(b"\r")
    body, star, check = line.partition(b"*")
    if len(line) >= MAX_LINE:
        raise DeviceError(f"a sentence of {len(line)} bytes, {MAX_LINE} are allowed: {shown}...")
    if not line.startswith(b"$") or not star:
        raise DeviceError(f"not a sentence, $TAG,SEQ,T_US,IMU,...*CRC: {shown}")
    if check != b"%04X" % crc16(body[1:]):
        raise DeviceError(f"the CRC of these bytes is {crc16(body[1:]):04X}, another one was sent: {shown}")
    raise DeviceError(f"want $TAG,SEQ,T_US,IMU: three capitals, whole numbers, then 24 fields at most; got {shown}")


def _parse(line: bytes) -> Sentence | None:
    """The sentence in a line without its newline; None if it is not valid."""
    if line.endswith(b"\r"):
        line = line[:-1]
    body, _, check = line.partition(b"*")
    if check != b"%04X" % binascii.crc_hqx(body[1:], 0xFFFF) or len(line) >= MAX_LINE or not line.startswith(b"$"):
        return None
    parts = str(body, "latin-1").split(",", 4)
    if len(parts) == 4:
        parts.append("")
    elif len(parts) < 4:
        return None
    tag, seq_text, t_text, imu_text, text = parts
    if not (seq_text.isdecimal() and t_text.isdecimal() and imu_text.isdecimal() and body.isascii()):
        return None
    seq, t_us, imu = int(seq_text), int(t_text), int(imu_text)
    if seq >= SEQ_RANGE or t_us >= _T_RANGE or imu >= _IMU_RANGE or text.count(",") >= MAX_FIELDS:
        return None
    if len(tag) != 4 or not (tag[1:].isalpha() and tag.isupper() and text.isprintable()):
        return None
    return Sentence(tag[1:], seq, t_us, imu, text)


@dataclass
class Reader:
    """Cuts a stream of chunks into sentences and counts errors.

    A sentence is what follows the last ``$`` of a line. In front of it may be noise: a board that starts sends the log of its
    boot at another speed and without a newline.

    ``bad`` counts lines that start with ``$`` but are not valid, ``lost`` sentences that never came, because the device dropped
    them or they were damaged, ``overlong`` lines of the protocol of more than 320 bytes, ``skipped`` bytes that belong to no
    line of the protocol, ``restarts`` decreases of a sequence number, which show a restart of the device. ``logs`` holds the
    latest ``#`` lines.

    Frames of samples (packed.py), each between two zeros, may lie between the lines. What is damaged between zeros counts as a
    line would: its samples are lost, and it is bad if frames came before it.
    """

    good: int = 0
    bad: int = 0
    lost: int = 0
    overlong: int = 0
    skipped: int = 0
    restarts: int = 0
    logs: deque[str] = field(default_factory=lambda: deque(maxlen=100))
    _rest: bytes = b""
    _is_cut: bool = False
    """The beginning of the line in progress has been dropped and counted."""
    _is_noise: bool = False
    _next: dict[int, int] = field(default_factory=dict)
    _in_frame: bool = False
    """A zero came, and what follows may be a frame."""
    _knows_frames: bool = False

    def feed(self, chunk: bytes) -> list[Sentence]:
        """Take a chunk and return the sentences that it completes, in order."""
        if b"\0" not in chunk and not self._in_frame:
            return self._feed_text(chunk)
        sentences: list[Sentence] = []
        for part in re.split(b"(\0)", chunk):
            if part == b"\0":
                sentences += self._end_part()
            elif self._in_frame:
                self._rest += part
                sentences += self._leave_frame()
            else:
                sentences += self._feed_text(part)
        return sentences

    def _end_part(self) -> list[Sentence]:
        """A zero ends what is in progress, a line or a frame, and may begin a frame."""
        rest, self._rest = self._rest, b""
        if not self._in_frame:
            self._in_frame = True
            self._count_cut(rest)
            return []
        sentences = [Sentence("RAW", *each) for each in unpack(rest)]
        if sentences:
            self._in_frame, self._knows_frames = False, True
            self._note(sentences)
        elif rest:
            good, was = self.good, self.bad
            sentences = self._feed_text(rest)
            self._count_cut(self._rest)
            self._rest = b""
            self.bad = was + (1 if self._knows_frames and good == self.good else 0)
        return sentences

    def _leave_frame(self) -> list[Sentence]:
        """What is too long for a frame, or holds a sentence, is text."""
        lines = self._rest.split(b"\n")[:-1]
        if len(self._rest) <= MAX_FRAME and not any(_parse(line[max(line.rfind(b"$"), 0) :]) for line in lines):
            return []
        text, self._rest, self._in_frame = self._rest, b"", False
        return self._feed_text(text)

    def _note(self, sentences: list[Sentence]) -> None:
        """Count sentences, and those that are missing before each."""
        following = self._next
        for _, seq, _, imu, _ in sentences:
            if seq != following.get(imu, seq):
                self._count_jump((seq - following[imu]) % SEQ_RANGE)
            following[imu] = (seq + 1) % SEQ_RANGE
        self.good += len(sentences)

    def _feed_text(self, chunk: bytes) -> list[Sentence]:
        lines = (self._rest + chunk).split(b"\n")
        self._rest = lines.pop()
        sentences = []
        for line in lines:
            sentence = _parse(line)
            if sentence is None:
                sentence = self._rescue(line)
            self._is_cut = False
            if sentence is None:
                continue
            sentences.append(sentence)
        if len(self._rest) >= MAX_LINE:
            self._drop_beginning()
        self._note(sentences)
        return sentences

    def cut(self) -> None:
        """The connection has ended: what came of a line is damaged, and the next chunk begins a new one."""
        self._count_cut(self._rest)
        self._rest, self._in_frame = b"", False

    def _count_cut(self, rest: bytes) -> None:
        if rest:
            self._count_other(rest, is_overlong=False)
        self._is_cut = False

    def _count_jump(self, missing: int) -> None:
        if missing < SEQ_RANGE // 2:
            self.lost += missing
        else:
            self.restarts += 1

    def _rescue(self, line: bytes) -> Sentence | None:
        """The sentence after the last ``$`` of a line that is not a sentence as a whole."""
        at = line.rfind(b"$")
        sentence = _parse(line[at:]) if at > 0 else None
        self._count_other(line if sentence is None else line[:at], len(line) >= MAX_LINE)
        return sentence

    def _drop_beginning(self) -> None:
        """Keep of a line that is too long only what may be the beginning of a sentence."""
        at = self._rest.rfind(b"$")
        kept = self._rest[at:] if at > 0 and len(self._rest) - at < MAX_LINE else b""
        self._count_other(self._rest[: len(self._rest) - len(kept)], is_overlong=True)
        self._rest, self._is_cut = kept, True

    def _count_other(self, other: bytes, is_overlong: bool) -> None:
        if not self._is_cut:
            self._is_noise = other[:1] not in (b"$", b"#", b">")
            if self._is_noise:
                pass
            elif is_overlong:
                self.overlong += 1
            elif other.startswith(b"$"):
                self.bad += 1
            elif other.startswith(b"#"):
                self.logs.append(other[1:].decode("utf-8", "replace").strip())
        if self._is_noise:
            self.skipped += len(other)
