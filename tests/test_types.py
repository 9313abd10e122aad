"""The types of host, model_export and the lines of Python in the docs, by mypy, these as strictly as it can."""

import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = {"lines_of_readme.py": ROOT / "README.md", "lines_of_api.py": ROOT / "docs" / "api.md"}


STRICT = """
[[tool.mypy.overrides]]
module = ["lines_of_readme", "lines_of_api"]
disallow_any_generics = true
disallow_subclassing_any = true
disallow_untyped_calls = true
disallow_incomplete_defs = true
disallow_untyped_decorators = true
warn_return_any = true
no_implicit_reexport = true
strict_equality = true
extra_checks = true
"""
"""What ``--strict`` adds to pyproject.toml, for the lines of the pages alone: one run reads the library once."""


@pytest.mark.wide
def test_types_are_right(require_module: Callable[[str], None], tmp_path: Path) -> None:
    require_module("mypy")
    for name, page in PAGES.items():
        blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        assert blocks, page
        (tmp_path / name).write_text("\n".join(blocks), encoding="utf-8")
    settings = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (tmp_path / "mypy.toml").write_text(settings + STRICT, encoding="utf-8")
    of_library = tomllib.loads(settings)["tool"]["mypy"]["files"]
    words = ["--config-file", str(tmp_path / "mypy.toml"), *of_library, *(str(tmp_path / name) for name in PAGES)]
    done = subprocess.run([sys.executable, "-m", "mypy", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
