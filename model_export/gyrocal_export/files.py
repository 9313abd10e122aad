"""Several files that are written all or none, and helpers of run folders."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gyrocal.errors import GyrocalError


def write_all(folder: Path, contents: Mapping[str, bytes]) -> list[Path]:
    """Write several files. They get their names only when all of them are on the disk.

    Raises:
        GyrocalError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".partial-") as partial:
            for name, content in contents.items():
                Path(partial, name).write_bytes(content)
            for name in contents:
                os.replace(Path(partial, name), folder / name)
    except OSError as error:
        raise GyrocalError(f"{folder}: cannot be written ({error.strerror}); choose another folder with --out") from error
    return [folder / name for name in contents]


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write JSON with an indent of two and a final newline."""
    path.write_text(json.dumps(content, indent=2) + "\n")


def two_digits_up(value: float) -> float:
    """Round up to two digits, for a range that need not be exact."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return round(math.ceil(value / step) * step, 9)
