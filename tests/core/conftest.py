"""The core, the simulated device and small C programs of this folder, built with address and UB sanitizers."""

import binascii
import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from compiled import Objects
from gyrocal_firmware import CORE, INCLUDE, SIM

HERE = Path(__file__).parent
WARNINGS = ["-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wmissing-prototypes", "-pedantic"]
COVERAGE = os.environ.get("GYROCAL_CORE_COVERAGE")
"""A folder for objects that count what is executed, for benchmarks/core_coverage.py."""
SANITIZERS = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
FLAGS = ["-std=c99", "-g", "-ffp-contract=off", *(SANITIZERS if COVERAGE is None else ["-O0", "--coverage"])]
LSB_DPS = 0.00875

Build = Callable[..., Path]


@pytest.fixture(scope="session")
def cc(require_tool: Callable[[str], str]) -> str:
    return require_tool("cc")


@pytest.fixture(scope="session")
def objects(cc: str, compiled: Objects, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one object a source of the core and of the emulator."""
    folder = tmp_path_factory.mktemp("objects") if COVERAGE is None else Path(COVERAGE)
    sources = [*sorted(CORE.rglob("*.c")), *sorted(p for p in SIM.glob("*.c") if p.name != "main.c")]
    command = [cc, *FLAGS, f"-I{CORE}", f"-I{INCLUDE}"]
    if COVERAGE is None:
        compiled.into(folder, command, sources)
    else:
        subprocess.run([*command, "-c", *map(str, sources)], cwd=folder, check=True)
    return folder


@pytest.fixture(scope="session")
def build(cc: str, objects: Path, tmp_path_factory: pytest.TempPathFactory) -> Build:
    """`build(source, include)` links a program with the core; `include` comes before the shipped headers."""
    built: dict[tuple[Path, Path | None], Path] = {}

    def make(source: Path, include: Path | None = None) -> Path:
        key = (source, include)
        if key not in built:
            built[key] = tmp_path_factory.mktemp("programs") / source.stem
            folders = [*([include] if include else []), INCLUDE, CORE, SIM]
            linked = [str(path) for path in sorted(objects.glob("*.o"))]
            command = [cc, *FLAGS, *(f"-I{f}" for f in folders), str(source), *linked, "-lm", "-o", str(built[key])]
            subprocess.run(command, check=True)
        return built[key]

    return make


def run(program: Path, text: str, *arguments: str) -> str:
    """Runs a program on `text`; its output. A sanitizer's finding is a failure."""
    done = subprocess.run([program, *arguments], input=text.encode("latin1"), capture_output=True, timeout=300)
    assert done.returncode == 0, done.stderr.decode(errors="replace")[-4000:] + done.stdout.decode("latin1")[-2000:]
    return done.stdout.decode("latin1")


class Sentence(dict[str, str]):
    """A sentence's fields by name (positional ones by number), checked against binascii's CRC."""

    def __init__(self, line: str) -> None:
        body, _, crc = line.removeprefix("$").partition("*")
        assert crc == f"{binascii.crc_hqx(body.encode(), 0xFFFF):04X}", line
        self.tag, seq, t_us, imu, *fields = body.split(",")
        self.seq, self.t_us, self.imu = int(seq), int(t_us), int(imu)
        for i, field in enumerate(fields):
            name, equals, value = field.partition("=")
            self[name if equals else str(i)] = value if equals else name

    def number(self, name: str) -> float:
        return float(self[name]) if self[name] else float("nan")


def sentences(text: str, tag: str | None = None) -> list[Sentence]:
    found = [Sentence(line) for line in text.splitlines() if line.startswith("$")]
    return [s for s in found if tag is None or s.tag == tag]


def write_rows(path: Path, runs: list[dict], rate_hz: float = 145.0, full_scale_dps: float = 250.0) -> Path:
    """A ROWS file. A run: t_us, counts [n, 7] (temperature, gyroscope, accelerometer), face, axis, table_dps, ..."""
    n = sum(len(run["t_us"]) for run in runs)
    data = b"GCSIM01\0" + np.array([len(runs), n], "<u4").tobytes()
    data += np.array([rate_hz, full_scale_dps], "<f4").tobytes() + bytes(8)
    first = 0
    for r in runs:
        data += np.array([first, len(r["t_us"])], "<u4").tobytes()
        data += np.array([r.get("face", 1), r.get("axis", 2)], "<i4").tobytes()
        floats = [r.get("table_dps", 78.0), r.get("turn_deg", np.nan), r.get("power_on_s", np.nan)]
        data += np.array(floats, "<f4").tobytes() + np.array([r.get("power_cycle", 0)], "<u4").tobytes()
        first += len(r["t_us"])
    for r in runs:
        rows = np.zeros(len(r["t_us"]), [("t", "<i8"), ("w", "<i2", 7), ("flags", "<u2")])
        rows["t"], rows["w"] = r["t_us"], r["counts"]
        data += rows.tobytes()
    path.write_bytes(data)
    return path


def make_run(
    rng: np.random.Generator,
    rate_dps: NDArray[np.float64],
    t_us: NDArray[np.int64],
    face: int = 1,
    axis: int = 2,
    **more: object,
) -> dict:
    """Counts of a rate about one axis, with the sensor's white noise on all three."""
    counts = np.zeros((len(t_us), 7))
    counts[:, 1:4] = rng.normal(0, 0.0448, (len(t_us), 3)) / LSB_DPS
    counts[:, 1 + axis] += rate_dps / LSB_DPS
    counts[:, 4 + axis] = face / 0.000061
    counts[:, 0] = rng.integers(-200, 200, len(t_us))
    return {"t_us": t_us, "counts": np.rint(counts).astype(np.int16), "face": face, "axis": axis, **more}


def ticks(n: int, rate_hz: float = 145.0) -> NDArray[np.int64]:
    return np.round(np.arange(n) / rate_hz * 1e6).astype(np.int64)


def make_pair(rng: np.random.Generator, n: int = 900, w: float = 78.0, **more: object) -> list[dict]:
    """A run of ``n`` samples face up and one face down at ``w`` dps: scale 0.4 %, bias -0.05 dps."""
    return [make_run(rng, np.full(n, 1.004 * f * w - 0.05), ticks(n), f, table_dps=w, **more) for f in (1, -1)]


def without_gyrocal(folder: Path) -> Path:
    """A folder with a weights.h of network `paper` alone."""
    folder.mkdir()
    (folder / "weights.h").write_text((INCLUDE / "weights.h").read_text().replace("    .convnet = &gc_gyrocal,\n", ""))
    return folder


@pytest.fixture(scope="session")
def sim(build: Build) -> Callable[..., str]:
    """`sim(rows, *options, include=None, commands="")`: what the simulated device says at full speed."""

    def play(rows: Path, *options: str, include: Path | None = None, commands: str = "") -> str:
        return run(build(SIM / "main.c", include), commands, str(rows), "--speed", "max", *options)

    return play
