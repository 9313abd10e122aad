"""Samples as bytes: the frames of ``stream packed``, each of up to 32 ``$RAW`` sentences in a row (the core's PROTOCOL.md)."""

from __future__ import annotations

import binascii
import struct

MAX_FRAME = 288
"""The longest frame in bytes, without the zeros around it."""
_KIND = 1
_HEAD = struct.Struct("<BBBIQihhhh")
_SAMPLE = struct.Struct("<Hhhh")


def unstuffed(frame: bytes) -> bytes | None:
    """The bytes of a frame of consistent overhead byte stuffing; None if it is none."""
    blocks = []
    at = 0
    while at < len(frame):
        distance = frame[at]
        block = frame[at + 1 : at + distance]
        if distance == 0 or len(block) != distance - 1:
            return None
        at += distance
        blocks.append(block if distance == 255 or at == len(frame) else block + b"\0")
    return b"".join(blocks)


def end_of_whole(data: bytes) -> int:
    """Where the last line or frame ends that is whole, of what a device has sent since another such end."""
    at = 0
    while (zero := data.find(b"\0", at)) >= 0:
        end = data.find(b"\0", zero + 1)
        if end < 0:
            return max(at, data.rfind(b"\n", at, zero) + 1)
        at = end + 1
    return max(at, data.rfind(b"\n", at) + 1)


def unpack(frame: bytes) -> list[tuple[int, int, int, str]]:
    """The sentences in a frame, each as number, time, sensor and fields; none if it is damaged."""
    data = unstuffed(frame) if len(frame) <= MAX_FRAME else None
    if data is None or len(data) < _HEAD.size + 2 or data[0] != _KIND:
        return []
    body = data[:-2]
    _, imu, count, seq, t_us, number, *rest = _HEAD.unpack_from(body)
    if data[-2:] != struct.pack("<H", binascii.crc_hqx(body, 0xFFFF)) or len(body) != _HEAD.size + count * _SAMPLE.size:
        return []
    end = ",".join(map(str, rest))
    sentences = []
    for k, (step_us, *rates) in enumerate(_SAMPLE.iter_unpack(body[_HEAD.size :])):
        t_us += step_us
        n = number if number < 0 else number + k
        sentences.append(((seq + k) % (1 << 32), t_us, imu, f"{n},{','.join(map(str, rates))},{end}"))
    return sentences
