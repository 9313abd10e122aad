"""How fast the host reads sentences: CRC and gap check, and samples into arrays. python benchmarks/host_parser.py"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

from gyrocal.device import wire

SENTENCES = 400_000
CHUNK = 4096
AIM_PER_S = 200_000


def per_second(stream: bytes, use: Callable[[list[wire.Sentence]], object]) -> float:
    reader = wire.Reader()
    began = time.process_time()
    for k in range(0, len(stream), CHUNK):
        use(reader.feed(stream[k : k + CHUNK]))
    took = time.process_time() - began
    if (reader.good, reader.lost, reader.bad) != (SENTENCES, 0, 0):
        sys.exit(f"the reader miscounted: {reader.good} good, {reader.lost} lost, {reader.bad} bad")
    return SENTENCES / took


def main() -> int:
    stream = b"".join(
        wire.encode("RAW", i, i * 6897, 0, [i, i % 30000, -13, 8921, 12, -44, 16393, i % 300]) for i in range(SENTENCES)
    )
    checked = max(per_second(stream, len) for _ in range(3))
    arrays = max(per_second(stream, wire.raw_table) for _ in range(3))
    print(f"{SENTENCES} $RAW sentences, {len(stream) / SENTENCES:.0f} bytes each, in chunks of {CHUNK}; processor time")
    print(f"CRC and gap check        {checked:9.0f} sentences/s")
    print(f"and samples into arrays  {arrays:9.0f} sentences/s")
    return 0 if checked >= AIM_PER_S else 1


if __name__ == "__main__":
    raise SystemExit(main())
