"""The firmware's sources with chosen headers: a PlatformIO project to be flashed, or the core as a library."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from gyrocal.errors import InputError
from gyrocal_firmware import CORE, INCLUDE, LIBRARY, ROOT, SRC

PARTS = ("platformio.ini", "partitions.csv", "src", "lib", "include", "sim", "test", "monitor")
HEADERS = ("calibration.h", "weights.h")
MINE = "; The firmware as a PlatformIO project"
PART_FILE = "part_file.h"
PART_FILE_MOST = 8192
"""Bytes that a part takes at most."""
LIBRARY_MANIFEST = "library.properties"
LIBRARY_MINE = "name=gyrocal_core"
_NO_CACHES = shutil.ignore_patterns("__pycache__", "*.pyc")


def create(
    directory: Path,
    model: str | None = None,
    include: Path | None = None,
    axis: str = "z",
    part_file: Path | None = None,
) -> None:
    """Write the project. A project that was written before is updated; other files in it stay.

    Args:
        directory: the folder to write: new, empty, or a project written before.
        model: error model, by name or file, that becomes ``calibration.h`` for ``axis``.
        include: the folder of ``calibration.h`` and ``weights.h``; a header that is missing there is the shipped one.
        part_file: the file that a sensor's maker wants it to be given at each start, as bytes or as the maker's C source.

    Raises:
        InputError: the folder holds something else, ``include`` holds neither header, the device cannot hold the model, or
            ``part_file`` holds no such file.
    """
    _check_target(directory)
    headers = _headers(model, include, axis, part_file)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for part in PARTS:
            if (ROOT / part).is_dir():
                shutil.copytree(ROOT / part, directory / part, dirs_exist_ok=True, ignore=_NO_CACHES)
            else:
                shutil.copyfile(ROOT / part, directory / part)
        for name, text in headers.items():
            (directory / "include" / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{error.filename}: {error.strerror}") from None


def create_library(
    directory: Path,
    model: str | None = None,
    include: Path | None = None,
    axis: str = "z",
    part_file: Path | None = None,
) -> None:
    """Write the core as a library for Arduino, PlatformIO, ESP-IDF and CMake. One that was written before is updated.

    Args:
        directory: the folder to write: new, empty, or a library written before.
        model, include, axis, part_file: as :func:`create`.

    Raises:
        InputError: as :func:`create`.
    """
    _check_target(directory, LIBRARY_MANIFEST, LIBRARY_MINE)
    headers = _headers(model, include, axis, part_file)
    try:
        shutil.copytree(LIBRARY, directory, dirs_exist_ok=True, ignore=_NO_CACHES)
        shutil.copytree(CORE, directory / "src", dirs_exist_ok=True, ignore=shutil.ignore_patterns("library.json", "*.pyc"))
        for name in ("headers.c", "headers.h"):
            shutil.copyfile(SRC / name, directory / "src" / name)
        for name in (*HEADERS, PART_FILE):
            text = headers.get(name, (INCLUDE / name).read_text(encoding="utf-8"))
            (directory / "src" / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{error.filename}: {error.strerror}") from None


def _check_target(directory: Path, manifest: str = "platformio.ini", mine: str = MINE) -> None:
    if directory.exists() and not directory.is_dir():
        raise InputError(f"{directory}: not a folder; give a new one")
    if directory.is_dir() and any(directory.iterdir()):
        project = directory / manifest
        if not project.is_file() or not project.read_text(encoding="utf-8", errors="replace").startswith(mine):
            raise InputError(f"{directory}: not empty, and not what gyrocal wrote there before; give a new folder")


def _headers(model: str | None, include: Path | None, axis: str, part_file: Path | None) -> dict[str, str]:
    folder = INCLUDE if include is None else include
    found = {name: folder / name for name in HEADERS if (folder / name).is_file()}
    if not found:
        raise InputError(f"{folder}: neither {HEADERS[0]} nor {HEADERS[1]} is there; `gyrocal export` writes them")
    headers = {name: path.read_text(encoding="utf-8") for name, path in found.items()}
    if model is not None:
        from gyrocal.calibration.header import render
        from gyrocal.error_model.model import Model

        headers[HEADERS[0]] = render(Model.open(model), axis)
    if part_file is not None:
        headers[PART_FILE] = _part_file_header(_part_file_bytes(part_file))
    return headers


def _part_file_bytes(path: Path) -> bytes:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    if path.suffix in (".c", ".h"):
        text = re.sub(r"//[^\n]*|/\*.*?\*/", " ", data.decode("utf-8", "replace"), flags=re.DOTALL)
        arrays = re.findall(r"uint8_t\s+\w+\s*\[[^]]*\]\s*=\s*\{([0-9a-fA-FxX,\s]+)\}", text)
        numbers = [int(word, 0) for word in max(arrays, key=len, default="").replace(",", " ").split()]
        if not all(0 <= number < 256 for number in numbers):
            raise InputError(f"{path}: its array holds more than bytes")
        data = bytes(numbers)
    if not data or len(data) % 2 or len(data) > PART_FILE_MOST:
        wanted = f"want the maker's configuration file, an even number up to {PART_FILE_MOST}"
        raise InputError(f"{path}: {len(data)} bytes; {wanted}")
    return data


def _part_file_header(data: bytes) -> str:
    rows = [", ".join(f"0x{byte:02X}" for byte in data[at : at + 16]) for at in range(0, len(data), 16)]
    return (
        "/* The configuration file of a sensor's maker, under its licence. Written by gyrocal firmware --part-file. */\n"
        "#ifndef PART_FILE_H\n#define PART_FILE_H\n\n#include <stdint.h>\n\n"
        f"#define PART_FILE_BYTES {len(data)}\n\n"
        "static const uint8_t part_file[PART_FILE_BYTES] = {\n    " + ",\n    ".join(rows) + ",\n};\n\n#endif\n"
    )
