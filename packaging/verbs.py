"""Run every verb that needs neither a device nor a C compiler, from an installed wheel: ``python packaging/verbs.py``.

It works in a new folder for temporary files, prints each command with its seconds, and ends with 1 if one failed.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

LOG = "log.csv"
STEPS = """\
version --json
effects
effects warmup --json
schema compare
simulate s --scenarios 3 --seconds 6 --effect table_ripple:amplitude_1=0.003 --seed 3
info s
compare s --json
compare s --html page.html
diagnose s
add table_ripple s --model m.toml
explain s
plan s --measure scale --minutes 2
calibrate s --method baseline,model --model m.toml --json
calibrate s --method cnn
allan s --axis z
plot s -o s.png
apply s --model m.toml --out corrected
import log.csv imported --yes --face up --rate 10
apply log.csv --model m.toml --out corrected.csv --yes
simulate held --campaign hands --scenarios 12
calibrate held
add misalignment held --model h.toml
export --model h.toml --format imu_tk --out out
export --model m.toml --format json
export --model m.toml --out out
compare s --model m.toml --as-is
firmware project
fleet fit boards --workers 0 -o fleet
""".splitlines()


def write_log(path: Path) -> None:
    """A small log with the names and units of a phone's recorder."""
    rows = ["time_ms,gyr_x,gyr_y,gyr_z"]
    rows += [f"{10 * k},{0.001 * (k % 5)},{0.002 * (k % 3)},{0.1745 + 0.001 * (k % 7)}" for k in range(600)]
    path.write_text("\n".join([*rows, ""]), encoding="utf-8")


def main() -> int:
    """Run all steps and return the exit code."""
    failed = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        write_log(folder / LOG)
        boards = [f"simulate boards/{n} --scenarios 2 --seconds 5 --seed {n}" for n in (1, 2)]
        for words in [*boards, *STEPS]:
            began = time.monotonic()
            done = subprocess.run(
                [sys.executable, "-m", "gyrocal", *words.split()], cwd=folder, capture_output=True, text=True, encoding="utf-8",
                errors="replace",
            )  # fmt: skip
            print(f"{time.monotonic() - began:6.1f} s  {done.returncode}  gyrocal {words}", flush=True)
            if done.returncode != 0:
                failed.append(words)
                print(done.stderr)
            elif "--json" in words:
                json.loads(done.stdout)
    print(f"{len(failed)} of {len(STEPS) + 2} failed: {', '.join(failed)}" if failed else f"{len(STEPS) + 2} commands done")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
