"""PlatformIO without its registry: what it would download, laid out from what is installed."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

HERE = Path(__file__).parent
REPOSITORY = HERE.parents[1]
NOT_OPTIMISED = "-O0"
"""Comes behind a project's own flags, where a test asks whether it builds."""

SCONS = """\
import sys
sys.path.insert(0, {folder!r})
from SCons.Script.Main import main
main()
"""

Pio = Callable[..., subprocess.CompletedProcess[str]]


def package(folder: Path, kind: str, name: str, version: str) -> None:
    """What makes a folder an installed package."""
    spec = {"owner": "platformio", "id": None, "name": name, "requirements": None, "uri": None}
    meta = {"type": kind, "name": name, "version": version, "spec": spec}
    (folder / ".piopm").write_text(json.dumps(meta))
    if kind == "tool":
        (folder / "package.json").write_text(json.dumps({"name": name, "version": version}))


@pytest.fixture(scope="session")
def core_dir(require_module: Callable[[str], None], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A PLATFORMIO_CORE_DIR with SCons, cppcheck where it is installed, and a platform `native`."""
    require_module("platformio")
    require_module("SCons")
    core = tmp_path_factory.mktemp("platformio")
    scons = core / "packages" / "tool-scons"
    scons.mkdir(parents=True)
    found = importlib.util.find_spec("SCons")
    assert found is not None
    assert found.origin is not None
    (scons / "scons.py").write_text(SCONS.format(folder=str(Path(found.origin).parents[1])))
    package(scons, "tool", "tool-scons", "4.41101.0")
    cppcheck = shutil.which("cppcheck")
    if cppcheck is not None:
        tool = core / "packages" / "tool-cppcheck"
        tool.mkdir()
        (tool / "cppcheck").symlink_to(cppcheck)
        package(tool, "tool", "tool-cppcheck", "1.21100.0")
    native = core / "platforms" / "native"
    shutil.copytree(HERE / "native_platform", native)
    package(native, "platform", "native", "1.2.1")
    return core


@pytest.fixture(scope="session")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where built files go."""
    return tmp_path_factory.mktemp("pio-build")


@pytest.fixture(scope="session")
def pio(core_dir: Path, workspace: Path) -> Pio:
    """`pio("run", "-e", "native", cwd=DIR)`, with further variables of the environment"""
    settings = {
        "PLATFORMIO_CORE_DIR": str(core_dir),
        "PLATFORMIO_WORKSPACE_DIR": str(workspace),
        "PLATFORMIO_SETTING_ENABLE_TELEMETRY": "no",
        "PLATFORMIO_SETTING_CHECK_PLATFORMIO_INTERVAL": "10000",
    }

    def run(*arguments: str, cwd: Path = REPOSITORY, **more: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "platformio", *arguments]
        environment = {**os.environ, **settings, **more}
        return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300)

    return run
