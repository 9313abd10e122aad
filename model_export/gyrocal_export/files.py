"""Several files written all or none."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from gyrocal.errors import GyrocalError


def write_all(folder: Path, contents: Mapping[str, bytes]) -> list[Path]:
    """Write each file whole; only when all of them are on the disk they take their names.

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
        raise GyrocalError(
            f"{folder}: cannot be written ({error.strerror}); choose another folder with --out"
        ) from error
    return [folder / name for name in contents]
