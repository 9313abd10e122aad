"""PlatformIO: every environment is valid; the native one builds, passes its tests and its checks, and fails when it should."""

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from gyrocal_firmware import ROOT

from .conftest import NOT_OPTIMISED, REPOSITORY, Pio

PROJECTS = pytest.mark.parametrize("project", [REPOSITORY, ROOT], ids=["repository", "firmware"])
Require = Callable[[str], str]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The firmware's project, to be spoilt."""
    return Path(shutil.copytree(ROOT, tmp_path / "project"))


def without_sources(project: Path, *but: str) -> None:
    """Take a project's C away: what one source decides is known before the others are read."""
    for source in project.rglob("*.c"):
        if source.name not in but:
            source.unlink()


def spoil(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


@PROJECTS
def test_configuration_is_valid(pio: Pio, project: Path) -> None:
    done = pio("project", "config", "--lint", cwd=project)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "free from linting errors" in done.stdout, done.stdout


@PROJECTS
def test_boards_and_pins(pio: Pio, project: Path) -> None:
    """Each board's environment names its pins; the platform's version is pinned."""
    shown = pio("project", "config", cwd=project).stdout
    for name in ("thing_plus_micro_b", "thing_plus_usb_c", "esp32_c3", "esp32_s3", "esp32_s3_usb"):
        text = shown.partition(f"env:{name}\n")[2].partition("\nenv:")[0]
        assert "espressif32@6.5.0" in text, shown
        assert "921600" in text
        assert re.search(r"monitor_echo += +(yes|True)", text)  # what is typed is seen
        assert "esp32_exception_decoder" in text
        assert ("-DARDUINO_USB_CDC_ON_BOOT=1" in text) == name.endswith("_usb")
        assert all(flag in text for flag in ("-DGYROCAL_SDA=", "-DGYROCAL_SCL=", "-ffp-contract=off", "LED="))


@pytest.mark.parametrize("project", [REPOSITORY, pytest.param(ROOT, marks=pytest.mark.wide)], ids=["repository", "firmware"])
def test_native_build_is_the_simulated_device(pio: Pio, require_tool: Require, project: Path, workspace: Path) -> None:
    require_tool("cc")
    done = pio("run", "-e", "native", cwd=project, PLATFORMIO_BUILD_FLAGS=NOT_OPTIMISED)
    assert done.returncode == 0, done.stdout + done.stderr
    program = workspace / "build" / "native" / "program"
    faults = subprocess.run([program, "--fault", "list"], capture_output=True, text=True, check=True).stdout
    assert "brownout" in faults
    program.unlink()


def test_a_source_that_does_not_compile_fails(pio: Pio, require_tool: Require, copy: Path) -> None:
    require_tool("cc")
    spoil(copy / "lib" / "gyrocal_core" / "gc_wire.c", '#include "gc_error.h"', '#include "no_such_header.h"')
    without_sources(copy, "gc_wire.c", "main.c")
    done = pio("run", "-e", "native", cwd=copy)
    assert done.returncode != 0
    assert "no_such_header.h" in done.stderr


def test_native_tests_pass(pio: Pio, require_tool: Require) -> None:
    require_tool("cc")
    done = pio("test", "-e", "native")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "5 test cases: 5 succeeded" in done.stdout


@pytest.mark.wide
def test_other_bits_fail(pio: Pio, require_tool: Require, copy: Path) -> None:
    """A build that may reorder sums is found out by name."""
    require_tool("cc")
    spoil(copy / "lib" / "gyrocal_core" / "library.json", '"-ffp-contract=off"', '"-Ofast"')
    done = pio("test", "-e", "native", cwd=copy)
    assert done.returncode != 0
    assert "inference" in done.stdout
    assert "FAILED" in done.stdout


def test_static_analysis_is_clean(pio: Pio, require_tool: Require) -> None:
    require_tool("cppcheck")
    done = pio("check", "-e", "native", "--fail-on-defect", "medium", "--fail-on-defect", "high")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "No defects found" in done.stdout


def test_static_analysis_sees_a_defect(pio: Pio, require_tool: Require, copy: Path) -> None:
    require_tool("cppcheck")
    without_sources(copy)
    (copy / "sim" / "spoilt.c").write_text("int spoilt(void);\nint spoilt(void) { int a[2]; a[2] = 1; return a[0]; }\n")
    done = pio("check", "-e", "native", "--fail-on-defect", "high", cwd=copy)
    assert done.returncode != 0
