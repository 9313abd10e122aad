"""Functions stay of a size that a reader takes in, 60 lines. A file holds one concept; 600 lines are no longer one."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("host", "model_export", "firmware", "benchmarks", "tests")
LINES_OF = dict.fromkeys((".py", ".c", ".h", ".cpp"), 600)
FUNCTION_LINES = 60


def sources() -> list[Path]:
    found = (path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*")))
    return [path for path in found if path.suffix in LINES_OF and not {".pio", "__pycache__"} & set(path.parts)]


def long_functions(text: str, limit: int = FUNCTION_LINES) -> Iterator[str]:
    """Name and length of each function, from its ``def`` on, that is longer than the limit."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            if lines > limit:
                yield f"{node.name} ({lines} lines)"


def long_files() -> dict[str, int]:
    lines = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in sources()}
    return {name: count for name, count in lines.items() if count > LINES_OF[Path(name).suffix]}


def test_files_are_short() -> None:
    assert long_files() == {}


def test_functions_are_short() -> None:
    python = [path for path in sources() if path.suffix == ".py"]
    assert len(python) > 500
    found = {str(path.relative_to(ROOT)): list(long_functions(path.read_text(encoding="utf-8"))) for path in python}
    assert {name: long for name, long in found.items() if long} == {}


def test_a_long_function_is_seen_also_within_a_class() -> None:
    method = "class A:\n    def long(self):\n" + "        pass\n" * FUNCTION_LINES
    assert list(long_functions(method)) == [f"long ({FUNCTION_LINES + 1} lines)"]
