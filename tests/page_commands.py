"""The commands of a page of docs/, and how they are run.

``GYROCAL_PYTHON`` names the Python of another environment, in which the commands then run: ``make wheel`` sets it.
"""

import os
import re
import shlex
import subprocess
from pathlib import Path

import pytest

from gyrocal.cli import main
from real_recordings import REALDATA

DOCS = Path(__file__).resolve().parents[1] / "docs"
OTHER = os.environ.get("GYROCAL_PYTHON")


def sections(page: str) -> dict[str, list[list[str]]]:
    """The commands of each section of a page that has a block of ``sh``, as words after ``gyrocal``."""
    out = {}
    for title, block in re.findall(r"^##+ (.+?)\n(.*?)(?=^##|\Z)", (DOCS / page).read_text(), re.M | re.S):
        lines = [line for code in re.findall(r"^```sh\n(.*?)^```", block, re.M | re.S) for line in code.splitlines()]
        if lines:
            out[title] = [shlex.split(line)[1:] for line in lines]
    return out


def preparation(page: str, title: str) -> str:
    """The block of Python of a section, empty if it has none."""
    found = re.search(rf"^##+ {re.escape(title)}\n(.*?)(?=^##|\Z)", (DOCS / page).read_text(), re.M | re.S)
    assert found is not None
    return "\n".join(re.findall(r"^```python\n(.*?)^```", found[1], re.M | re.S))


def beside(published: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder with the recording's folder in it the current one; the test is skipped if the recording is not there."""
    path = REALDATA / published
    if not path.exists():
        pytest.skip(f"{path} is not there; GYROCAL_REALDATA names the folder of real recordings")
    (folder / path.parent.name).symlink_to(path.parent)
    monkeypatch.chdir(folder)


def run(words: list[str]) -> int:
    """The exit code of ``gyrocal`` with these words."""
    if OTHER is None:
        return main(words)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run([OTHER, "-m", "gyrocal", *words], env=environment).returncode
