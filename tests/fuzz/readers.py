"""Hostile files for each reader of the host: valid files, mutated.

``python tests/fuzz/readers.py --seconds 600`` runs each reader for ten minutes, prints a table, and leaves the input of each
finding in the folder that is printed. Names of readers run only these. With atheris, which is no dependency,
coverage of the Python code guides the mutations. A finding is an error other than the reader's own in one line, more than
``SLOWEST_S`` of processor time, or more than ``LARGEST_MB`` of memory beyond what the program holds.
"""

from __future__ import annotations

import argparse
import io
import json
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from frames import stream
from gyrocal.calibration.apply import apply
from gyrocal.device import wire
from gyrocal.device.port import Link
from gyrocal.device.record import Recorder
from gyrocal.device.run_stream import RunStream
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import DeviceError, GyrocalError, InputError
from gyrocal.fleet import listing
from gyrocal.recording import cut, importer
from gyrocal.recording.plan_file import PlannedRuns
from gyrocal.recording.session import Session

SLOWEST_S = 1.0
LARGEST_MB = 1024
LONGEST = 4096
"""Bytes of an input."""
ROWS = "t_s,gx_dps,gy_dps,gz_dps\n" + "".join(f"{k / 100},{k % 3},{k % 5 - 2},{78 + k % 4}\n" for k in range(20))
HEADER = """format = "gyrocal-session/1"
sensor = "LSM6DSO"
axis = "z"
sample_rate_hz = 100.0
full_scale_dps = 250.0
lsb_dps = 0.00875
latitude_deg = 32.8
accept = ["bias_implausible:z"]
[[run]]
file = "a.csv"
scenario = "s000"
face = "up"
table_rate_dps = 78.0
day = 1
power_on_s = 3.0
"""
PLAN = """format = "gyrocal-plan/1"
[[run]]
axis = "z"
face = "up"
table_rate_dps = 78.0
seconds = 10.0
scenario = "s000"
"""
TOKENS = [
    b"", b"-", b"1e999", b"-1e300", b"nan", b"inf", b"99999999999999999999", b"9" * 400, b"9" * 5000, b"[" * 2000,
    b"{a=" * 700, b"(" * 900, b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n", b"\n\n[[run]]\n", b"'", b'"', b'"""', b"../",
    b"#", b"=", b",", b";", b"**9**9", b"1-" * 400, b"true", b"1979-05-27", b"x\xc3\xa9",
]  # fmt: skip
"""What is inserted besides bytes of other inputs."""

OWN = FormulaEffect("k*sin(w*t); w=3", "own")
FITTED = Model(
    "fitted",
    (Term("scale", "z", {"scale": 0.004}), Term("bias", "z", {"bias_dps": 0.1}), Term.of(OWN, "z", {"k": 1.0, "w": 3.0})),
)

Read = Callable[[bytes, Path], object]


def _parquet(table: pl.DataFrame) -> bytes:
    out = io.BytesIO()
    table.write_parquet(out)
    return out.getvalue()


def _npz() -> bytes:
    out = io.BytesIO()
    np.savez(out, **{name: np.arange(5.0) for name in ("t", "x", "y", "z")})
    return out.getvalue()


def _sentences() -> bytes:
    hello = {
        "proto": 1, "fw": "fake", "sensor": "LSM6DSO", "rate_hz": 100.0, "full_scale_dps": 250.0, "lsb_dps": 0.00875,
        "lsb_g": 6.1e-05, "lsb_c": 0.00390625, "zero_c": 25.0, "axis": "z", "table_dps": 78.0, "turn_deg": 0.0,
    }  # fmt: skip
    run = {"face": "up", "axis": "z", "table_dps": 78.0, "turn_deg": 0.0, "n": 4, "first": 0}
    said: list[tuple[str, Any]] = [("ACK", {"cmd": "hello"}), ("HEL", hello), ("RUN", {"state": "start", **run, "n": 0})]
    said += [("RAW", [n, 1, -2, 8914, 0, 0, 16393, 256]) for n in range(4)]
    said += [("STA", {"state": "recording", "face": "up", "n": 4}), ("RUN", {"state": "end", **run})]
    said += [("CAL", {"method": "baseline", "scale": 0.004}), ("ERR", {"code": -1, "name": "bus_nack"})]
    return b"".join(wire.encode(tag, k, 10_000 * k, 0, fields) for k, (tag, fields) in enumerate(said))


def _signed(data: bytes) -> bytes:
    """The lines of a stream with the check sums that they should have, so that damage passes them."""
    lines = []
    for line in data.split(b"\n"):
        body = line.rpartition(b"*")[0] or line
        lines.append(body + b"*%04X" % wire.crc16(body[1:]) if body.startswith(b"$") else line)
    return b"\n".join(lines)


class _Once:
    """A port that says all at once and is gone."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def read(self) -> bytes:
        data, self._data = self._data, b""
        if not data:
            raise DeviceError("gone")
        return data

    def write(self, data: bytes) -> None:
        pass

    def close(self) -> None:
        pass


def _header(data: bytes, folder: Path) -> object:
    (folder / "a.csv").write_text(ROWS)
    (folder / "session.toml").write_bytes(data)
    return Session.open(folder)


def _table(name: str) -> Read:
    def read(data: bytes, folder: Path) -> object:
        (folder / "session.toml").write_text(HEADER.replace("a.csv", name))
        (folder / name).write_bytes(data)
        return [run.table for run in Session.open(folder).runs]

    return read


def _import(data: bytes, folder: Path) -> object:
    (folder / "source").write_bytes(data)
    maps = ["t_s=t", "gx_dps=x", "gy_dps=y", "gz_dps=z"]
    return importer.import_recording(folder / "source", folder / "out", maps, defaults={"table_rate_dps": 0.0})


def _sections(data: bytes, folder: Path) -> object:
    (folder / "sections.json").write_bytes(data)
    return cut.read_sections(folder / "sections.json")


def _model(data: bytes, folder: Path) -> object:
    (folder / "model.toml").write_bytes(data)
    return Model.open(folder / "model.toml")


def _formula(data: bytes, folder: Path) -> object:
    effect = FormulaEffect(data.decode("utf-8", "replace"))
    (folder / "session.toml").write_text(HEADER)
    (folder / "a.csv").write_text(ROWS)
    run = Session.open(folder).runs[0]
    return effect.columns(run, 2, dict.fromkeys(effect.nonlinear, 1.0)) if effect.missing([run], 2) is None else None


def _plan(data: bytes, folder: Path) -> object:
    (folder / "plan.toml").write_bytes(data)
    return PlannedRuns.open(folder / "plan.toml")


def _wire(data: bytes, folder: Path) -> object:
    sentences = wire.Reader().feed(_signed(data))
    try:
        wire.raw_table(sentences)
    except DeviceError as error:
        one_line(error)
    return RunStream().feed(sentences)


def _recorder(data: bytes, folder: Path) -> object:
    port = _Once(_signed(data))
    with Link("fuzz", opener=lambda name, baud: port) as link:
        return Recorder(link, folder / "out", wanted=None).record()


def _estimates(data: bytes, folder: Path) -> object:
    (folder / "told.json").write_bytes(data)
    (folder / "r.csv").write_text(ROWS)
    return apply(folder / "r.csv", FITTED, folder / "out.csv", str(folder / "told.json"))


def _listing(data: bytes, folder: Path) -> object:
    (folder / "list.json").write_bytes(data)
    return listing.sessions(str(folder / "list.json"))


def _seeds() -> dict[str, tuple[Read, list[bytes]]]:
    table = pl.read_csv(ROWS.encode()).cast(pl.Float64)
    others = pl.DataFrame({name: [0.0, 1.0, 2.0] for name in ("t", "x", "y", "z")})
    csv = b"# a log\nt,x,y,z\n0,1,2,3\n0.01,1,2,3\n0.02,2,1,0\n"
    with tempfile.TemporaryDirectory() as folder:
        models = []
        for model in (Model.builtin("default"), FITTED):
            model.save(Path(folder) / "m.toml")
            models.append((Path(folder) / "m.toml").read_bytes())
    formulas = [b"k*t", b"k*sin(w*t); w=3", b"a*rate+b", b"k*exp(-t/tau); tau=5; each run", b"k*temp_c**2 + c*abs(rate)"]
    told = json.dumps(
        {"estimates": [{"scenario": "s", "axis": "z", "bias_dps": 0.1, "bias_se_dps": 0.01, "trusted": True}]}
    ).encode()
    sections = json.dumps({"a": {"start": 0, "end": 10}}).encode()
    return {
        "header": (_header, [HEADER.encode()]),
        "csv": (_table("a.csv"), [ROWS.encode()]),
        "parquet": (_table("a.parquet"), [_parquet(table)]),
        "import": (_import, [csv, csv.replace(b",", b";"), _npz(), _parquet(others)]),
        "sections": (_sections, [sections]),
        "model": (_model, models),
        "formula": (_formula, formulas),
        "plan": (_plan, [PLAN.encode()]),
        "wire": (_wire, [_sentences(), stream()[0]]),
        "recorder": (_recorder, [_sentences()]),
        "estimates": (_estimates, [told]),
        "listing": (_listing, [b'["a", "b/c"]']),
    }


READERS = _seeds()


class Finding(AssertionError):
    """What a reader must not do."""


def one_line(error: GyrocalError) -> None:
    """Raise Finding unless the error's text is one line."""
    text = str(error)
    if not text.strip() or "\n" in text.strip():
        raise Finding(f"not one line: {text[:200]!r}") from error


@contextmanager
def _limits() -> Iterator[None]:
    def too_slow(*_: object) -> None:
        raise Finding(f"more than {SLOWEST_S:g} s")

    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    before = signal.signal(signal.SIGPROF, too_slow)
    signal.setitimer(signal.ITIMER_PROF, SLOWEST_S)
    resource.setrlimit(resource.RLIMIT_AS, (size + (LARGEST_MB << 20), hard))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def check(name: str, data: bytes) -> None:
    """Let a reader read. Raises Finding if it neither reads nor refuses in one line, within the limits of time and memory."""
    read, _ = READERS[name]
    allowed = (InputError, DeviceError) if name in ("wire", "recorder") else (InputError,)
    with tempfile.TemporaryDirectory() as folder:
        try:
            with _limits():
                read(data, Path(folder))
        except allowed as error:
            one_line(error)
        except Finding:
            raise
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            raise Finding(f"{type(error).__name__}: {str(error)[:300]}") from error


def mutated(name: str, rng: np.random.Generator) -> bytes:
    """One of the reader's valid files after one to six changes."""
    seeds = READERS[name][1]
    data = seeds[rng.integers(len(seeds))]
    for _ in range(rng.integers(1, 7)):
        at, to = sorted(rng.integers(0, len(data) + 1, 2))
        token = TOKENS[rng.integers(len(TOKENS))]
        numbers = list(re.finditer(rb"[-0-9.e]+|[A-Za-z_]+", data))
        word = numbers[rng.integers(len(numbers))].span() if numbers else (at, at)
        kind = rng.integers(6)
        if kind == 0 and data:  # a bit
            i = min(at, len(data) - 1)
            data = data[:i] + bytes([data[i] ^ 1 << rng.integers(8)]) + data[i + 1 :]
        elif kind == 1:  # cut out
            data = data[:at] + data[min(to, at + rng.integers(1, 40)) :]
        elif kind == 2:  # twice
            data = data[:to] + data[at:to] + data[to:]
        elif kind == 3:
            data = data[:at] + token + data[at:]
        else:  # another number or word
            data = data[: word[0]] + token + data[word[1] :]
        data = data[: 4 * LONGEST]
    return data


def fuzz(name: str, seconds: float, seed: int = 0) -> tuple[int, bytes | None, str]:
    """Run a reader on its valid files and then on mutations. Returns the executions, the input of a finding and what it was."""
    rng = np.random.default_rng([seed, *name.encode()])
    end_s, executions = time.monotonic() + seconds, 0
    valid = iter(READERS[name][1])
    while time.monotonic() < end_s:
        data = next(valid, None) or mutated(name, rng)
        executions += 1
        try:
            check(name, data)
        except Finding as finding:
            return executions, data, str(finding)
    return executions, None, ""


def guided(name: str, seconds: int, found: Path, seed: int = 0) -> None:
    """Let atheris run a reader in this process, which ends with it. The input of a finding goes to ``found``."""
    import atheris

    rng = np.random.default_rng(seed)
    corpus = found / "corpus"
    corpus.mkdir()
    for k, data in enumerate([*READERS[name][1], *(mutated(name, rng) for _ in range(200))]):
        (corpus / f"{k:04d}").write_bytes(data)
    limits = [f"-max_total_time={seconds}", f"-max_len={LONGEST}", f"-seed={seed + 1}"]  # 0 would be the time of day
    limits += ["-rss_limit_mb=0", "-print_final_stats=1"]
    atheris.Setup([sys.argv[0], *limits, f"-artifact_prefix={found}/", str(corpus)], lambda data: check(name, data))
    atheris.Fuzz()


GUIDED = """
import sys, atheris
sys.path.insert(0, sys.argv[1])
with atheris.instrument_imports(include=["gyrocal", "tomllib"]):
    import readers
readers.guided(sys.argv[2], int(sys.argv[3]), readers.Path(sys.argv[4]), int(sys.argv[5]))
"""


def _run(name: str, seconds: int, found: Path, seed: int) -> tuple[int, str]:
    """The executions and the finding of one reader, by atheris if it is installed."""
    if find_spec("atheris") is None:
        executions, data, why = fuzz(name, seconds, seed)
        if data is not None:
            (found / "input").write_bytes(data)
        return executions, why
    command = [sys.executable, "-c", GUIDED, str(Path(__file__).parent), name, str(seconds), str(found), str(seed)]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
    said = done.stderr.decode(errors="replace")
    counts = re.findall(r"stat::number_of_executed_units:\s+(\d+)|^#(\d+)\t", said, re.MULTILINE)
    executions = int(max((a or b for a, b in counts), key=int, default="0"))
    return executions, "" if done.returncode == 0 else said[-3000:]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("readers", nargs="*", default=list(READERS), metavar="READER", help=", ".join(READERS))
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    print("| Reader | Executions | Found |\n|---|---:|---|")
    failed = False
    for name in chosen.readers:
        found = Path(tempfile.mkdtemp(prefix=f"gyrocal-fuzz-{name}-"))
        executions, why = _run(name, chosen.seconds, found, chosen.seed)
        failed = failed or bool(why)
        print(f"| `{name}` | {executions} | {found if why else 'nothing'} |", flush=True)
        if why:
            print(why, file=sys.stderr)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
