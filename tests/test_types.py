"""The types of host, model_export and the lines of Python in the docs, by mypy."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = {"lines_of_readme.py": ROOT / "README.md", "lines_of_api.py": ROOT / "docs" / "api.md"}


@pytest.mark.slow
def test_types_are_right(require_module: Callable[[str], None], tmp_path: Path) -> None:
    require_module("mypy")
    for name, page in PAGES.items():
        blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        assert blocks, page
        (tmp_path / name).write_text("\n".join(blocks), encoding="utf-8")
    of_library = [sys.executable, "-m", "mypy"]
    of_pages = [*of_library, "--strict", "--follow-imports=silent", "--cache-dir", str(ROOT / ".mypy_cache/docs")]
    for words in (of_library, [*of_pages, *(str(tmp_path / name) for name in PAGES)]):
        done = subprocess.run(words, cwd=ROOT, env=os.environ, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
