"""`gyrocal firmware DIR`: a project that PlatformIO takes, with the headers asked for, from an installed wheel too."""

import importlib.util
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from gyrocal.cli import main
from gyrocal.core.firmware_project import create
from gyrocal.errors import InputError
from gyrocal_firmware import INCLUDE, ROOT

from .conftest import NOT_OPTIMISED, REPOSITORY, Pio

MODEL = """
format = "gyrocal-model/1"
name = "rippling"
white_sd_dps = { z = 0.0448 }
effects = [
  { id = "scale", axis = "z" },
  { id = "bias", axis = "z" },
  { id = "table_ripple", axis = "z", amplitude_1 = 0.0016, amplitude_1_se = 0.0002 },
]
"""


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def replay(program: Path) -> str:
    """What the simulated device says at boot, of nothing but rows at rest."""
    rows = program.with_suffix(".rows")
    head = b"GCSIM01\0" + (1).to_bytes(4, "little") * 2 + bytes.fromhex("00001143 00007a43") + bytes(8)
    run = bytes(4) + (1).to_bytes(4, "little") * 2 + (2).to_bytes(4, "little") + bytes(16)
    rows.write_bytes(head + run + bytes(24))
    return subprocess.run([program, rows, "--speed", "max"], capture_output=True, text=True, check=True).stdout


def test_it_lints_builds_and_holds_the_model(
    pio: Pio, require_tool: Callable[[str], str], workspace: Path, tmp_path: Path
) -> None:
    require_tool("cc")
    model, project = tmp_path / "m.toml", tmp_path / "p"
    model.write_text(MODEL)
    assert main(["firmware", str(project), "--model", str(model)]) == 0
    assert pio("project", "config", "--lint", cwd=project).returncode == 0
    done = pio("run", "-e", "native", cwd=project, PLATFORMIO_BUILD_FLAGS=NOT_OPTIMISED)
    assert done.returncode == 0, done.stdout + done.stderr
    program = workspace / "build" / "native" / "program"
    assert "cal=rippling," in replay(program)
    program.unlink()


def test_shipped_headers_unless_told_and_a_project_is_brought_up_to_date(tmp_path: Path) -> None:
    project = tmp_path / "p"
    assert main(["firmware", str(project)]) == 0
    assert files(project / "include") == files(INCLUDE)
    assert files(project / "lib") == files(ROOT / "lib")
    (project / "notes.txt").write_text("mine")
    (project / "src" / "main.cpp").write_text("broken")
    headers = tmp_path / "export"
    headers.mkdir()
    (headers / "weights.h").write_text("/* other weights */")
    assert main(["firmware", str(project), "--include", str(headers)]) == 0
    assert (project / "include" / "weights.h").read_text() == "/* other weights */"
    assert (project / "include" / "calibration.h").read_bytes() == (INCLUDE / "calibration.h").read_bytes()
    assert files(project / "src") == files(ROOT / "src")
    assert (project / "notes.txt").read_text() == "mine"


def test_what_cannot_be_is_refused_before_anything_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    full = tmp_path / "full"
    full.mkdir()
    (full / "thesis.tex").write_text("mine")
    empty = tmp_path / "empty"
    empty.mkdir()
    model = tmp_path / "m.toml"
    model.write_text(MODEL.replace("white_sd_dps", "other"))
    cases = {
        (str(full),): "not empty",
        (str(full / "thesis.tex"),): "not a folder",
        (str(tmp_path / "p"), "--include", str(empty)): "neither calibration.h nor weights.h",
        (str(tmp_path / "p"), "--model", str(tmp_path / "none.toml")): "no such model",
        (str(tmp_path / "p"), "--model", str(model)): "white",
        (str(tmp_path / "p"), "--axis", "w"): "want x, y or z",
    }
    for arguments, reason in cases.items():
        assert main(["firmware", *arguments]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert reason in line
    assert files(full) == {"thesis.tex": b"mine"}
    assert not (tmp_path / "p").exists()


def test_from_a_wheel_unpacked_elsewhere(require_module: Callable[[str], None], tmp_path: Path) -> None:
    """The wheel carries the sources: without the repository the same project comes out."""
    require_module("hatchling")
    wheels, site, project = tmp_path / "wheels", tmp_path / "site", tmp_path / "p"
    build = "import os, hatchling.build as b; os.chdir(os.environ['REPOSITORY']); print(b.build_wheel(os.environ['WHEELS']))"
    wheels.mkdir()
    environment = {**os.environ, "REPOSITORY": str(REPOSITORY), "WHEELS": str(wheels)}
    subprocess.run([sys.executable, "-c", build], env=environment, check=True, capture_output=True)
    (wheel,) = wheels.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    code = "import sys, gyrocal, gyrocal.cli; print(gyrocal.__file__); sys.exit(gyrocal.cli.main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", code, "firmware", str(project)],
        env={**os.environ, "PYTHONPATH": str(site)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert str(site) in done.stdout
    want = tmp_path / "want"
    assert main(["firmware", str(want)]) == 0
    assert files(project) == files(want)
    assert importlib.util.find_spec("gyrocal_firmware") is not None


def test_a_makers_file_becomes_a_header(tmp_path: Path) -> None:
    """As bytes, or as C like Bosch's bmi270.c: the longest array of bytes in it, comments left out."""
    data = bytes((7 * i + 3) % 256 for i in range(328))
    rows = ", ".join(f"0x{byte:02x}" for byte in data)
    small = "/* uint8_t not[] = {1}; */\nstatic const uint8_t small[] = {0x01, 2};\n"
    source = f"{small}const uint8_t file[] = {{\n {rows} // end\n}};\n"
    (tmp_path / "maker.c").write_text(source)
    (tmp_path / "maker.bin").write_bytes(data)
    headers = []
    for name in ("maker.c", "maker.bin"):
        create(tmp_path / name.replace(".", "_"), part_file=tmp_path / name)
        headers.append((tmp_path / name.replace(".", "_") / "include" / "part_file.h").read_text())
    assert headers[0] == headers[1]
    found = bytes(int(word, 16) for word in re.findall(r"0x[0-9A-F]{2}", headers[0]))
    assert found == data
    assert "#define PART_FILE_BYTES 328\n" in headers[0]


@pytest.mark.parametrize(("name", "content"), [("a.c", b"int x;"), ("a.bin", b"abc"), ("a.bin", b""), ("b.bin", b"x" * 9000)])
def test_what_is_no_makers_file_is_refused(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match="want the maker's configuration file"):
        create(tmp_path / "project", part_file=tmp_path / name)
    assert not (tmp_path / "project").exists()
