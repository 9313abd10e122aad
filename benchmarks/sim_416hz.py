"""Ten minutes of device time at 416 Hz through the simulated device: no sample lost? python benchmarks/sim_416hz.py"""

from __future__ import annotations

import time

import numpy as np
import polars as pl

from gyrocal.device import simulated as device
from gyrocal.device import wire
from gyrocal.device.port import Link, PortGone
from gyrocal.recording.session import Run, Session

RATE_HZ = 416.0
SECONDS = 300.0


def make_session() -> Session:
    rng = np.random.default_rng(0)
    n = round(SECONDS * RATE_HZ)
    runs = []
    for i, face in enumerate(("up", "down")):
        sign = 1.0 if face == "up" else -1.0
        rates = rng.normal([0.1, -0.2, sign * 78.3], 0.045, (n, 3))
        frame = pl.DataFrame({"t_s": np.arange(n) / RATE_HZ, **{f"g{a}_dps": rates[:, k] for k, a in enumerate("xyz")}})
        power_on_s = 3.0 + i * (SECONDS + 10.0)
        runs.append(Run(i, f"{face}.csv", "s000", face, "z", 78.0, None, None, power_on_s, RATE_HZ, frame=frame))  # type: ignore[arg-type]
    return Session(RATE_HZ, tuple(runs))


def main() -> int:
    session = make_session()
    rows = sum(len(run) for run in session.runs)

    began = time.perf_counter()
    raw = wire.raw_table(s for s in device.replay(session) if s.tag == "RAW")
    by_pipe_s = time.perf_counter() - began

    with device.SimulatedDevice(session) as simulated, Link(simulated.port) as link:
        began = time.perf_counter()
        samples = 0
        try:
            while True:
                samples += sum(s.tag == "RAW" for s in link.receive())
        except PortGone:
            by_pty_s = time.perf_counter() - began
        reader = link.reader

    print(f"{rows} rows, {2 * SECONDS / 60:.0f} min of device time at {RATE_HZ:.0f} Hz")
    print(f"by a pipe             {len(raw)} samples, {rows - len(raw)} lost, {by_pipe_s:.1f} s")
    print(f"by a pseudo terminal  {samples} samples, {reader.lost + reader.bad} lost, {by_pty_s:.1f} s")
    return 0 if len(raw) == samples == rows and reader.lost == reader.bad == 0 else 1


if __name__ == "__main__":
    raise SystemExit(main())
