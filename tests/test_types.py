"""The types of host and model_export by mypy: a test among the others, with which it shares the processors."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.mark.slow
def test_types_are_right(require_module: Callable[[str], None]) -> None:
    require_module("mypy")
    root = Path(__file__).resolve().parents[1]
    done = subprocess.run([sys.executable, "-m", "mypy"], cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
