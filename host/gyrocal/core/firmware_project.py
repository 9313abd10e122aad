"""A PlatformIO project with the firmware's sources and chosen headers: what is flashed to a board."""

from __future__ import annotations

import shutil
from pathlib import Path

from gyrocal.errors import InputError
from gyrocal_firmware import INCLUDE, ROOT

PARTS = ("platformio.ini", "partitions.csv", "src", "lib", "include", "sim", "test", "monitor")
HEADERS = ("calibration.h", "weights.h")
MINE = "; The firmware as a PlatformIO project"


def create(directory: Path, model: str | None = None, include: Path | None = None, axis: str = "z") -> None:
    """Write the project. A project that was written before is updated; other files in it stay.

    Args:
        directory: the folder to write: new, empty, or a project written before.
        model: error model, by name or file, that becomes ``calibration.h`` for ``axis``.
        include: the folder of ``calibration.h`` and ``weights.h``; a header that is missing there is the shipped one.

    Raises:
        InputError: the folder holds something else, ``include`` holds neither header, or the device cannot hold the model.
    """
    _check_target(directory)
    headers = _headers(model, include, axis)
    ignore = shutil.ignore_patterns("__pycache__", "*.pyc")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for part in PARTS:
            if (ROOT / part).is_dir():
                shutil.copytree(ROOT / part, directory / part, dirs_exist_ok=True, ignore=ignore)
            else:
                shutil.copyfile(ROOT / part, directory / part)
        for name, text in headers.items():
            (directory / "include" / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{error.filename}: {error.strerror}") from None


def _check_target(directory: Path) -> None:
    if directory.exists() and not directory.is_dir():
        raise InputError(f"{directory}: not a folder; give a new one")
    if directory.is_dir() and any(directory.iterdir()):
        project = directory / "platformio.ini"
        if not project.is_file() or not project.read_text(encoding="utf-8", errors="replace").startswith(MINE):
            raise InputError(f"{directory}: not empty, and no project of gyrocal's; give a new folder")


def _headers(model: str | None, include: Path | None, axis: str) -> dict[str, str]:
    folder = INCLUDE if include is None else include
    found = {name: folder / name for name in HEADERS if (folder / name).is_file()}
    if not found:
        raise InputError(f"{folder}: neither {HEADERS[0]} nor {HEADERS[1]} is there; `gyrocal export` writes them")
    headers = {name: path.read_text(encoding="utf-8") for name, path in found.items()}
    if model is not None:
        from gyrocal.calibration.header import render
        from gyrocal.error_model.model import Model

        headers[HEADERS[0]] = render(Model.open(model), axis)
    return headers
