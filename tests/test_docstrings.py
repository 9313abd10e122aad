"""Public functions and methods are documented, those that take or give arrays with shapes or units; results have names."""

import ast
import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType, ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent
HOST = ROOT / "host/gyrocal"
FILES = [p for p in sorted(HOST.rglob("*.py")) if "web" not in p.parts and p.stem != "__main__"]
"""The panels of the workbench are documented by their files."""
ARRAYS = re.compile(r"Array|Index|Mask")
SHAPE_OR_UNIT = re.compile(
    r"\[|deg|dps|\bs\b|Hz|\bg\b|counts?\b|samples|rad|[Uu]nit|rows|shape|probabilit|likelihood|columns|number"
)
KEYS = {"best_first", "order", "key", "_shape"}
"""Functions that give a tuple to sort or to compare by."""


def module_of(path: Path) -> ModuleType:
    parts = path.relative_to(HOST.parent).with_suffix("").parts
    return importlib.import_module(".".join(p for p in parts if p != "__init__"))


def documented(module: ModuleType) -> Iterator[tuple[str, FunctionType, str]]:
    """Name, function and documentation (an overridden method's where it has none of its own) of all that is public."""
    own = [o for o in vars(module).values() if getattr(o, "__module__", "") == module.__name__]
    for item in own:
        name = getattr(item, "__name__", "_")
        if name.startswith("_"):
            continue
        if inspect.isfunction(item):
            yield name, item, inspect.getdoc(item) or ""
        for key, value in vars(item).items() if inspect.isclass(item) else ():
            function = value.fget if isinstance(value, property) else getattr(value, "__func__", getattr(value, "func", value))
            written = (
                inspect.isfunction(function)
                and function.__name__ != "<lambda>"
                and function.__code__.co_filename == module.__file__
            )
            if written and not key.startswith("_") and key != "to_json":
                yield f"{name}.{key}", function, inspect.getdoc(getattr(item, key)) or inspect.getdoc(function) or ""


@pytest.fixture(scope="module")
def public() -> list[tuple[str, FunctionType, str]]:
    """File and name, function and documentation of all that is public."""
    every = [(f"{path.relative_to(HOST)}: {name}", f, text) for path in FILES for name, f, text in documented(module_of(path))]
    assert len(every) > len(FILES) > 300
    return every


def test_what_is_public_is_documented(public: list[tuple[str, FunctionType, str]]) -> None:
    assert [name for name, _, text in public if not text] == []


def test_arrays_have_a_shape_or_a_unit(public: list[tuple[str, FunctionType, str]]) -> None:
    bare = [
        name
        for name, function, text in public
        if ARRAYS.search(" ".join(map(str, function.__annotations__.values()))) and not SHAPE_OR_UNIT.search(text)
    ]
    assert bare == []


def nameless(path: Path) -> Iterator[str]:
    """The public functions that return a tuple of three and more that are not all numbers."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef) and node.returns is not None and node.name not in KEYS and node.name[0] != "_":
            given = node.returns
            if isinstance(given, ast.Subscript) and ast.unparse(given.value) == "tuple" and isinstance(given.slice, ast.Tuple):
                kinds = [ast.unparse(e) for e in given.slice.elts]
                if len(kinds) > 2 and set(kinds) != {"float"}:
                    yield f"{path.relative_to(HOST)}: {node.name} gives {ast.unparse(given)}"


def test_a_result_of_three_and_more_has_names() -> None:
    assert [found for path in FILES for found in nameless(path)] == []
