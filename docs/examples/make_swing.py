"""Make ``swing.csv.gz``, the log of docs/tutorials/log.md: a stage that swings, written as a logger of another make would.

Its scale differs between the directions by 0.4 %. ``python docs/examples/make_swing.py`` writes the same bytes again.
"""

import gzip
import math
import tempfile
from pathlib import Path

from gyrocal.cli import main
from gyrocal.recording.session import Session

OUT = Path(__file__).with_name("swing.csv.gz")
EVERY = 2
"""Samples of the simulation from one row to the next."""


def rows(session: Session) -> list[str]:
    """Lines of the log, from the session's first run."""
    frame = session.runs[0].table
    lines = ["time_ms;gyr_x_rad_s;gyr_y_rad_s;gyr_z_rad_s;temperature;stage_rad_s"]
    columns = ("gx_dps", "gy_dps", "gz_dps", "temp_c", "rate_ref_dps")
    for t_s, *rates, temp_c, ref_dps in frame.select("t_s", *columns).gather_every(EVERY).iter_rows():
        x, y, z, ref = (f"{math.radians(rate):.6f}" for rate in (*rates, ref_dps))
        lines.append(f"{1e3 * t_s:.1f};{x};{y};{z};{temp_c:.2f};{ref}")
    return lines


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        made = f"{folder}/swing"
        asked = "--campaign swing --scenarios 1 --seconds 60 --effect scale_asymmetry:k=0.002 --seed 1"
        assert main(["simulate", made, *asked.split()]) == 0
        text = "\n".join(rows(Session.open(made))) + "\n"
    with OUT.open("wb") as file, gzip.GzipFile(fileobj=file, mode="wb", mtime=0) as packed:
        packed.write(text.encode())
