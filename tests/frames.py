"""Frames of samples, written apart from the core and from the host."""

import struct

import numpy as np

from gyrocal.device.wire import Sentence, crc16, encode


def stuffed(data: bytes) -> bytes:
    """Consistent overhead byte stuffing, one block at a time; written apart from the core's."""
    blocks = []
    for part in data.split(b"\0"):
        while len(part) >= 254:
            blocks.append(b"\xff" + part[:254])
            part = part[254:]
        blocks.append(bytes([len(part) + 1]) + part)
    return b"".join(blocks)


def frame(seq: int, t_us: int, count: int, number: int = 0, imu: int = 0) -> tuple[bytes, list[Sentence]]:
    rng = np.random.default_rng(seq)
    rest = rng.integers(-32768, 32768, 4)
    steps, rates = rng.integers(0, 65536, count), rng.integers(-32768, 32768, (count, 3))
    steps[0] = 0
    body = struct.pack("<BBBIQi4h", 1, imu, count, seq, t_us, number, *rest)
    body += b"".join(struct.pack("<H3h", step, *rate) for step, rate in zip(steps, rates, strict=True))
    sentences = [
        Sentence("RAW", seq + k, t_us + int(steps[: k + 1].sum()), imu, ",".join(map(str, [n, *rates[k], *rest])))
        for k, n in enumerate(range(number, number + count) if number >= 0 else [number] * count)
    ]
    return b"\0" + stuffed(body + struct.pack("<H", crc16(body))) + b"\0", sentences


def stream() -> tuple[bytes, list[Sentence]]:
    """Frames of all lengths, between sentences and logs."""
    data, sentences, seq = b"# begins\n", [], 0
    for count in (1, 2, 31, 32, 1, 7, 32, 32, 16):
        text = encode("ACK", seq, 5 * seq, 0, {"cmd": "status"})
        part, samples = frame(seq + 1, 1000 * seq, count, seq - 1)
        data += text + part
        sentences += [Sentence("ACK", seq, 5 * seq, 0, "cmd=status"), *samples]
        seq += 1 + count
    return data, sentences
