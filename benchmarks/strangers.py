"""Public recordings as a stranger has them: whether `import` reads each rightly, graded fact by fact.

The truth of each fact is taken from the file by numpy (and by pyulog) alone, before gyrocal is asked. The recordings are not
part of the repository: the reader clones the repositories, each into FOLDER/OWNER/NAME at the commit in `RECORDINGS`, and names
FOLDER by GYROCAL_STRANGERS. What is absent is skipped, and said so.

    GYROCAL_STRANGERS=FOLDER gyrocal benchmark strangers      # on the screen
    GYROCAL_STRANGERS=FOLDER python benchmarks/strangers.py   # the table of docs/real.md
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.real import markdown
from benchmarks.real_facts import Fact, close, said

from gyrocal.present.output import stdout, table
from gyrocal.recording.session import Array

STRANGERS = Path(os.environ.get("GYROCAL_STRANGERS") or Path(__file__).parents[2] / "shared" / "strangers")
MOVES_DPS = 10.0
"""Means of seconds that differ by more are of a movement."""
SECONDS = 20.0
"""Processor time that one import may take, s."""


@dataclass(frozen=True)
class Recording:
    """A file of a repository. ``columns`` are its time and its three rates, ``units`` their sizes in s and deg/s, by its own
    documentation; ``topic`` is that of a ULog, and ``corrected`` what gyrocal must say of rates that an autopilot corrected.
    """

    kind: str
    repository: str
    commit: str
    licence: str
    path: str
    columns: tuple[str, str, str, str]
    units: tuple[float, float]
    topic: str | None = None
    corrected: bool = False

    @property
    def name(self) -> str:
        """Repository and file, short."""
        return f"{self.repository.split('/')[1]}: {Path(self.path).stem}"

    @property
    def file(self) -> Path:
        """Where the reader's clone has it."""
        return STRANGERS / self.repository / self.path


FUSION = ("xioTechnologies/Fusion", "d69784c8f7058a6545802b8852d26d6fcfd5e119", "MIT")
ROCKET = ("NCSU-High-Powered-Rocketry-Club/AirbrakesV2", "73fa7963a095b13be4f61965446dd36eb2a1655f", "MIT")
PYULOG = ("PX4/pyulog", "3cf17793f14709713ab297d3743314c658874068", "BSD-3-Clause")
OF_ROCKET = ("timestamp_seconds", *(f"raw_angular_rate_{a}_deg_per_s" for a in "xyz"))
DEG = 180 / np.pi
RECORDINGS = (
    Recording("hands", *FUSION, "Examples/Python/sensor_data.csv",
              ("Time (s)", *(f"Gyroscope {a} (deg/s)" for a in "XYZ")), (1.0, 1.0)),  # type: ignore[arg-type]
    *(
        Recording("vehicles", *ROCKET, f"launch_data/{path}.csv", OF_ROCKET, (1.0, 1.0))  # type: ignore[arg-type]
        for path in (
            "real_firm_launches/jackpot_launch_1", "real_firm_launches/jackpot_launch_3",
            "pretended_firm_launches/government_work_1_airbrakes", "pretended_firm_launches/jackpot_1_nosecone",
        )
    ),
    Recording("drones", *PYULOG, "test/sample.ulg", ("timestamp", "gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"), (1e-6, DEG),
              "sensor_combined", corrected=True),
    *(
        Recording("drones", *PYULOG, f"test/{path}.ulg", ("timestamp", "x", "y", "z"), (1e-6, DEG), "sensor_gyro")
        for path in ("sample_log_small", "sample_px4_events", "sample_logging_tagged_and_default_params")
    ),
)  # fmt: skip
KINDS_WITHOUT = ("rate tables", "encoders", "motion capture", "thermal logs", "hours at rest", "phones")
"""Kinds of which no recording with a licence was found that is not in ``benchmark real`` already."""


def columns_of(one: Recording) -> tuple[Array, Array]:
    """Times [n], s, from the first, and rates [n, 3], deg/s, read by numpy alone. Rows without a number are left out."""
    if one.topic is not None:
        from pyulog import ULog

        data = next(d for d in ULog(str(one.file)).data_list if d.name == one.topic).data
        cells = np.column_stack([np.asarray(data[name], dtype=float) for name in one.columns])
    else:
        with one.file.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        cells = np.array([[float(row[name] or "nan") for name in one.columns] for row in rows])
    cells = cells[np.isfinite(cells).all(axis=1)]
    return (cells[:, 0] - cells[0, 0]) * one.units[0], cells[:, 1:] * one.units[1]


def moves(t_s: Array, rates_dps: Array) -> bool:
    """True if the means over single seconds differ as no bias does."""
    second = np.floor(t_s).astype(int)
    counts = np.bincount(second)
    means = np.column_stack([np.bincount(second, r)[counts > 0] / counts[counts > 0] for r in rates_dps.T])
    return bool(np.ptp(means, axis=0).max() > MOVES_DPS)


def graded(one: Recording, work: Path) -> Iterator[Fact]:
    """What `import --yes` says of a recording that is said to be at rest, and what the session then holds."""
    import polars as pl

    t_s, rates_dps = columns_of(one)
    steps_s = np.diff(t_s)
    usual_s = float(np.mean(steps_s[steps_s < 5 * np.median(steps_s)]))
    command = [sys.executable, "-m", "gyrocal", "import", str(one.file), str(work / "lab"), "--rate", "0", "--json"]
    before = os.times()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    spent_s = os.times().children_user - before.children_user
    yield said(one.name, "imported", f"exit {done.returncode} {done.stderr.strip()[:80]}", "exit 0", "a table with a header",
               done.returncode == 0)  # fmt: skip
    if done.returncode:
        return
    told = json.loads(done.stdout)
    mapped = [g.partition("=")[2] for g in told["guessed"]]
    wanted = [f"{one.topic}.{name}" if one.topic else name for name in one.columns]
    right = all(any(m.rpartition(":")[0] == name or m == name for m in mapped) for name in wanted)
    yield said(one.name, "time and rates are of their columns", "yes" if right else ", ".join(mapped), ", ".join(wanted),
               "the repository", right)  # fmt: skip
    yield close(one.name, "samples", told["rows"], len(t_s), 0, "rows with numbers")
    yield close(one.name, "samples a second", told["sample_rate_hz"], 1 / usual_s, 0.005 / usual_s, "mean step without gaps")
    run = pl.read_csv(next((work / "lab").glob("*.csv")))
    yield close(one.name, "duration, s", float(run["t_s"][-1]), float(t_s[-1]), 2 * usual_s + 0.001 * t_s[-1], "numpy")
    largest = float(np.abs(rates_dps).max())
    ours = max(float(run[f"g{a}_dps"].abs().max()) for a in "xyz")  # type: ignore[arg-type]
    yield close(one.name, "largest rate, dps", ours, largest, 1e-3 * largest, "numpy, with the repository's unit")
    codes = {w["code"] for w in told["warnings"]}
    yield said(one.name, "it is not at rest", "told" if "not_at_rest" in codes else "not told",
               "told" if moves(t_s, rates_dps) else "not told", "means of seconds in numpy",
               ("not_at_rest" in codes) == moves(t_s, rates_dps))  # fmt: skip
    yield said(one.name, "an autopilot corrected the rates", "told" if "corrected_already" in codes else "not told",
               "told" if one.corrected else "not told", "its topic",
               ("corrected_already" in codes) == one.corrected)  # fmt: skip
    yield said(one.name, "processor time", f"{spent_s:.1f} s", f"at most {SECONDS:g} s", "measured", spent_s <= SECONDS)


def run(sample: bool, progress: Callable[[int, int], None]) -> dict[str, Any]:
    """Grade every recording that is present; ``sample`` grades the first two."""
    facts: list[Fact] = []
    absent = []
    chosen = RECORDINGS[: 2 if sample else None]
    for number, one in enumerate(chosen):
        progress(number, len(chosen))
        if not one.file.is_file():
            absent.append(f"{one.repository}/{one.path}")
            continue
        with tempfile.TemporaryDirectory() as work:
            facts += graded(one, Path(work))
    return {
        "facts": [asdict(f) for f in facts], "true": sum(f.ok for f in facts), "of": len(facts), "absent": absent,
        "kinds_without": list(KINDS_WITHOUT),
    }  # fmt: skip


def show(found: dict[str, Any]) -> None:
    rows = [[f["recording"], f["what"], f["ours"], f["truth"], "yes" if f["ok"] else "NO"] for f in found["facts"]]
    table("Recordings of strangers, fact by fact", ["recording:", "fact:", "gyrocal:", "truth:", "true:"], rows)
    stdout.print(f"{found['true']} of {found['of']} facts true")
    if found["absent"]:
        stdout.print(f"absent: {', '.join(found['absent'])}; GYROCAL_STRANGERS names the folder of clones")


if __name__ == "__main__":
    print(markdown(run(False, lambda done, total: None)))
