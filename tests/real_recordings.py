"""Recordings of real sensors, which lie beside the repository or in the folder that GYROCAL_REALDATA names."""

import os
from pathlib import Path

import pytest

REALDATA = Path(os.environ.get("GYROCAL_REALDATA") or Path(__file__).parents[2] / "shared" / "realdata")


def recording(folder: str, file: str) -> Path:
    """The path of a recording. The test is skipped if it is not there."""
    path = REALDATA / folder / file
    if not path.exists():
        pytest.skip(f"{path} is not there; GYROCAL_REALDATA names the folder of real recordings")
    return path
