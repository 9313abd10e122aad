"""gyrocal beside other tools on the same files: figures, lines typed, seconds and megabytes, as the tables of docs/compared.md.

    GYROCAL_REALDATA=FOLDER python benchmarks/beside.py

Each tool gets a fresh environment from the package index and the lines below, which are what its user types. The first file is
made here: an hour at rest at 100 Hz, of white noise and a walk of the rate that are known. The second is imucal's own example.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.weight import ROOT, megabytes

REST_HZ, REST_S = 100.0, 3600
WHITE, WALK = 0.005, 0.0002
"""White noise, dps/sqrt(Hz), two-sided, and a walk of the rate, dps/sqrt(s)."""
FERRARIS = "nilspod_ferraris_360/example_ferraris_session"


@dataclass(frozen=True)
class Tool:
    """A tool: what is installed, and the lines that its user types, for the shell or for Python."""

    name: str
    package: str
    lines: str
    shell: bool = False

    @property
    def typed(self) -> int:
        """Lines typed."""
        return sum(bool(line.strip()) for line in self.lines.splitlines())


ALLAN = (
    Tool("allantools", "allantools==2024.6", """
import allantools
import numpy as np
t, gx, gy, gz = np.loadtxt("rest.csv", delimiter=",", skiprows=1).T
taus, deviation, _, _ = allantools.oadev(gz, rate=100.0, data_type="freq", taus="octave")
print("white", np.interp(1.0, taus, deviation), "lowest", deviation.min(), "at", taus[deviation.argmin()])
"""),
    Tool("allan-variance", "allan-variance==1.0", """
import numpy as np
from allan_variance import compute_avar, estimate_parameters
t, gx, gy, gz = np.loadtxt("rest.csv", delimiter=",", skiprows=1).T
tau, avar = compute_avar(gz, dt=0.01)
print(estimate_parameters(tau, avar)[0])
"""),
    Tool("gyrocal", f"{ROOT}", """
gyrocal import rest.csv lab --rate 0 --yes
gyrocal allan lab | tail -n 2
gyrocal compare lab --axis z --json | grep -A 4 colored_noise
""", shell=True),
)  # fmt: skip
TURNS = (
    Tool("imucal", "imucal==2.6.0", """
import json
import pandas as pd
from imucal import FerrarisCalibration, FerrarisSignalRegions, ferraris_regions_from_section_list
data = pd.read_csv("ferraris.csv").set_index("n_samples")
sections = pd.DataFrame(json.load(open("ferraris.json"))).T
regions = ferraris_regions_from_section_list(data, sections)
found = FerrarisCalibration().compute(regions, sampling_rate_hz=102.4, from_acc_unit="m/s^2", from_gyr_unit="deg/s")
print(found.K_g.round(5), found.b_g.round(4), found.R_g.round(5))
"""),
    Tool("gyrocal", f"{ROOT}", """
gyrocal import ferraris.csv lab --rate-hz 102.4 --yes --sections ferraris.json --rate 0 \\
    --run-meta 'x_*:axis=x' --run-meta 'y_*:axis=y' --run-meta '*_a:face=down' --run-meta '*_rot:turn=-360'
gyrocal add misalignment lab --axis x -o model.toml
gyrocal add misalignment lab --axis y --model model.toml
gyrocal add misalignment lab --axis z --model model.toml
gyrocal info model.toml
""", shell=True),
)  # fmt: skip


def rest(file: Path) -> None:
    """An hour at rest."""
    random, n = np.random.default_rng(11), round(REST_HZ * REST_S)
    white = random.normal(0.0, WHITE * np.sqrt(REST_HZ), (n, 3))
    walk = np.cumsum(random.normal(0.0, WALK / np.sqrt(REST_HZ), (n, 3)), axis=0)
    table = np.column_stack([np.arange(n) / REST_HZ, white + walk])
    np.savetxt(file, table, delimiter=",", header="t_s,gx_dps,gy_dps,gz_dps", comments="", fmt=["%.2f", "%.6f", "%.6f", "%.6f"])


def ran(tool: Tool, scratch: Path, folder: Path) -> tuple[str, float, int]:
    """What a tool says in a fresh folder, its processor time, s, and its largest memory, MB. Raises SystemExit if it fails."""
    python = scratch / "bin" / "python"
    code = f"set -e\n{tool.lines}" if tool.shell else tool.lines
    command = ["sh", "-c", code] if tool.shell else [str(python), "-c", code]
    path = {**os.environ, "PATH": f"{python.parent}:{os.environ['PATH']}"}
    with (folder / "said.txt").open("w") as said:
        started = subprocess.Popen(command, cwd=folder, env=path, stdout=said, stderr=subprocess.STDOUT)
        _, status, used = os.wait4(started.pid, 0)
    text = (folder / "said.txt").read_text(encoding="utf-8")
    if status:
        sys.exit(f"{tool.name}: {text}")
    return text, used.ru_utime + used.ru_stime, round(used.ru_maxrss / 1024)


def compared(tools: tuple[Tool, ...], files: dict[str, Path]) -> None:
    """Print what each tool says, and the table."""
    rows = []
    for tool in tools:
        with tempfile.TemporaryDirectory() as scratch, tempfile.TemporaryDirectory() as work:
            subprocess.run([sys.executable, "-m", "venv", scratch], check=True)
            pip = [f"{scratch}/bin/pip", "install", "--quiet", "--disable-pip-version-check"]
            subprocess.run([*pip, tool.package], check=True, stderr=subprocess.DEVNULL)
            for name, file in files.items():
                Path(work, name).symlink_to(file)
            begun = time.monotonic()
            text, cpu, memory = ran(tool, Path(scratch), Path(work))
            wall, size = time.monotonic() - begun, megabytes(Path(scratch, "bin", "python"))[0]
        print(f"--- {tool.name}\n{text}", flush=True)
        rows.append(f"| {tool.name} | {tool.typed} | {wall:.1f} | {cpu:.1f} | {memory} | {size} |")
    print("| tool | lines typed | s | processor s | memory, MB | installed, MB |\n| --- | ---: | ---: | ---: | ---: | ---: |")
    print("\n".join(rows), flush=True)


def main() -> None:
    with tempfile.TemporaryDirectory() as made:
        file = Path(made, "rest.csv")
        rest(file)
        print(f"white noise {WHITE} dps/sqrt(Hz), walk {WALK} dps/sqrt(s)")
        compared(ALLAN, {"rest.csv": file})
    stem = Path(os.environ.get("GYROCAL_REALDATA") or ROOT.parent / "shared" / "realdata", FERRARIS)
    if not stem.with_suffix(".csv").is_file():
        sys.exit(f"{stem}.csv is absent: GYROCAL_REALDATA names the folder of recordings")
    compared(TURNS, {"ferraris.csv": stem.with_suffix(".csv"), "ferraris.json": stem.with_name(f"{stem.name}_list.json")})


if __name__ == "__main__":
    main()
