"""A write that ends at any byte of any file leaves what was there before, or what it makes, and no third thing."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from device.damage import Lines
from gyrocal.calibration import header
from gyrocal.device import wire
from gyrocal.device.port import Link
from gyrocal.device.record import Recorder, Report
from gyrocal.error_model.model import Model
from gyrocal.errors import GyrocalError
from gyrocal.noise.axis import AxisNoise
from gyrocal.recording.importer import import_recording
from gyrocal.recording.session import Session
from gyrocal_export.files import write_all
from make_runs import make_run, make_session

KILLED_AT = (1, 150)
Write = Callable[[Path], object]


def samples(face: int) -> np.ndarray:
    return np.round(np.random.default_rng(3).normal(78.0 * face, 0.1, (5, 3)), 3)


def write_model(path: Path) -> None:
    Model.builtin("default").save(path)


def write_header(path: Path) -> None:
    header.write(replace(Model.builtin("paper"), noise={"z": AxisNoise(white_sd_dps=0.05)}), path)


def write_session(path: Path) -> None:
    t_s = np.arange(5) / 100.0
    make_session(*(make_run(t_s, samples(f), face=name) for name, f in (("up", 1), ("down", -1)))).save(path)


def write_import(path: Path) -> None:
    rows = [f"{k / 100},{x},{y},{z}" for k, (x, y, z) in enumerate(samples(1))]
    source = path.parent / "source.csv"
    if not source.exists():
        source.write_text("\n".join(["t,x,y,z", *rows, ""]))
    maps = ["t_s=t", "gx_dps=x", "gy_dps=y", "gz_dps=z"]
    import_recording(source, path, maps, defaults={"table_rate_dps": 78.0, "face": "up"})


def write_export(path: Path) -> None:
    write_all(path, {"imu.yaml": bytes(range(97, 123)) * 3, "notes.txt": b"notes" * 10})


WRITES: dict[str, tuple[str, Write]] = {
    "model": ("model.toml", write_model), "header": ("calibration.h", write_header),
    "session": ("s", write_session), "import": ("s", write_import), "export": ("e", write_export),
}  # fmt: skip


def content(path: Path) -> dict[str, bytes] | None:
    """Every file at or under a path with its bytes; None if there is nothing."""
    if path.is_file():
        return {"": path.read_bytes()}
    return {p.name: p.read_bytes() for p in sorted(path.iterdir())} if path.exists() else None


@contextmanager
def no_file_beyond(size: int) -> Iterator[None]:
    """No file can grow beyond ``size`` bytes: a write that would exceed it fails there, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("what", WRITES)
def test_a_full_disk_at_any_byte(what: str, tmp_path: Path) -> None:
    name, write = WRITES[what]
    (tmp_path / "whole").mkdir()
    write(tmp_path / "whole" / name)
    whole = content(tmp_path / "whole" / name)
    assert whole is not None
    longest = max(map(len, whole.values()))
    failed = 0
    for limit in range(longest):
        folder = tmp_path / str(limit)
        folder.mkdir()
        target = folder / name
        if what in ("model", "header"):
            target.write_text("what was there")
        if what == "export":
            write_all(target, {"imu.yaml": b"what was there", "mine.txt": b"mine"})
        if what == "import":
            (folder / "source.csv").write_bytes((tmp_path / "whole/source.csv").read_bytes())
        before, beside = content(target), {p.name for p in folder.iterdir()}
        with no_file_beyond(limit):
            try:
                write(target)
            except (OSError, GyrocalError):
                failed += 1
        assert content(target) == before
        assert {p.name for p in folder.iterdir()} == beside
    assert failed == longest


KILLED = """
import resource, signal, sys
from pathlib import Path
sys.path[:0] = sys.argv[4:]
import test_interrupted
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), resource.RLIM_INFINITY))
signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
test_interrupted.WRITES[sys.argv[1]][1](Path(sys.argv[2]))
"""


@pytest.mark.parametrize("size", KILLED_AT)
@pytest.mark.parametrize("what", ["model", "session"])
def test_a_killed_process_leaves_the_file_or_nothing(what: str, size: int, tmp_path: Path) -> None:
    name, write = WRITES[what]
    target = tmp_path / name
    if what == "model":
        write(target)
    before = content(target)
    command = [sys.executable, "-c", KILLED, what, str(target), str(size), str(Path(__file__).parent)]
    assert subprocess.run(command, capture_output=True, check=False).returncode < 0
    assert content(target) == before
    if what == "session":
        write(target)
        assert len(Session.open(target).runs) == 2


def recorded(path: Path) -> Report:
    """Record a run of twelve samples, each in a write of its own."""
    hello = {
        "proto": 1, "sensor": "LSM6DSO", "rate_hz": 100.0, "full_scale_dps": 250.0, "lsb_dps": 0.00875, "lsb_g": 6.1e-05,
        "lsb_c": 0.00390625, "zero_c": 25.0, "axis": "z", "table_dps": 78.0, "turn_deg": 0.0,
    }  # fmt: skip
    run = {"face": "up", "axis": "z", "table_dps": 78.0, "turn_deg": 0.0}
    said = [("ACK", {"cmd": "hello"}), ("HEL", hello), ("ACK", {"cmd": "stream"}), ("RUN", {"state": "start", **run, "n": 0})]
    said += [("RAW", [n, 1, -2, 8914 + n, 0, 0, 16393, 256]) for n in range(12)]  # type: ignore[list-item]
    said += [("RUN", {"state": "end", **run, "n": 12})]
    lines = [wire.encode(tag, k, 10_000 * k, 0, fields)[:-1] for k, (tag, fields) in enumerate(said)]
    with Link("lines", opener=lambda name, baud: Lines(lines, at_once=1)) as link:
        return Recorder(link, path, wanted=None).record()


def test_a_recording_on_a_full_disk_at_any_byte_keeps_whole_rows(tmp_path: Path) -> None:
    recorded(tmp_path / "whole")
    whole = (tmp_path / "whole" / "000_up.csv").read_bytes()
    header = (tmp_path / "whole" / "session.toml").read_bytes()
    for limit in range(len(whole)):
        out = tmp_path / str(limit)
        with no_file_beyond(limit), pytest.raises(GyrocalError, match=r"make room|cannot be written"):
            recorded(out)
        kept = (out / "000_up.csv").read_bytes() if (out / "000_up.csv").exists() else b""
        assert whole.startswith(kept)
        assert kept.endswith(b"\n") or not kept
        assert len(kept) <= limit < len(kept) + 80 or limit < len(header)
        if (out / "session.toml").exists():
            assert (out / "session.toml").read_bytes() == header
            assert len(Session.open(out).runs[0]) == kept.count(b"\n") - 1
