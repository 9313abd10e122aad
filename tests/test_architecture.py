"""The folders are the layers: an import that points up, or a folder or module that no layer knows, fails."""

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
HOST, EXPORT, FIRMWARE = ROOT / "host/gyrocal", ROOT / "model_export/gyrocal_export", ROOT / "firmware/gyrocal_firmware"

# From the bottom up. A folder (or a single module beside the folders) may import itself and what stands before it.
LAYERS = [
    "__init__", "errors", "digits", "units", "parameter", "extras", "verbosity", "threads", "tails", "warning", "files",
    "policy", "shown",
    "recording", "noise", "effects", "variables", "error_model", "simulation", "inference",
    "plausibility", "evidence", "diagnosis", "planning", "calibration", "gravity", "fleet",
    "core", "device", "present",
    "calls", "api", "ros_node", "demo", "benchmark", "web",
    "json_small", "json_events", "json_grades", "json_benchmarks", "json_schemas", "commands", "cli", "__main__",
]  # fmt: skip
INNER = {
    "diagnosis": ["residual", "naming", "answer"],
    "web": ["values", "pictures", "worker", "device", "state", "page", "widgets", "panels", "server"],
}
"""The order within a folder that has folders of its own."""
DOTTED = re.compile(r"gyrocal(?:\.\w+)+\.?")
"""A module's name written as text, as in ``import_module("gyrocal.web.panels")``."""


@cache
def imports(path: Path, package: str = "") -> frozenset[str]:
    """Dotted names that a file imports, anywhere in it: inside functions, for type checking, relative, or named as text."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    prose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            module = ".".join([*above, *([node.module] if node.module else [])])
            found |= {f"{module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose:
            found |= {node.value.rstrip(".")} if DOTTED.fullmatch(node.value) and not node.value.endswith(".onnx") else set()
    return frozenset(found)


def python_files(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.py"))


def layer_of(path: Path, host: Path) -> str:
    return path.relative_to(host).parts[0].removesuffix(".py")


def layers_found(host: Path) -> set[str]:
    """The folders that hold Python files, and the single modules beside them."""
    return {layer_of(path, host) for path in python_files(host)}


def arrows_up(host: Path) -> Iterator[str]:
    """One line for each import of the package that does not point to the importer's own layer or one below it."""
    for path in python_files(host):
        package = ".".join(["gyrocal", *path.relative_to(host).parent.parts])
        importer = layer_of(path, host)
        for name in sorted(imports(path, package)):
            pieces = name.split(".")
            if pieces[0] != "gyrocal":
                continue
            imported = pieces[1] if len(pieces) > 1 and not pieces[1].startswith("__") else "__init__"
            if imported not in LAYERS:
                yield f"{path.relative_to(host)} imports {name}, which no layer knows"
            elif LAYERS.index(imported) > LAYERS.index(importer):
                yield f"{path.relative_to(host)} imports {name}, which stands above it"


def test_every_folder_and_module_is_a_layer() -> None:
    assert layers_found(HOST) == set(LAYERS)


def test_a_folder_of_tests_is_a_layer_or_named_in_the_map() -> None:
    named = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").split("    tests/  ")[1].split("## ")[0]
    others = set(re.findall(r"(\w+)/", named))
    folders = {p.name for p in (ROOT / "tests").iterdir() if p.is_dir() and p.name != "__pycache__"}
    assert folders - set(LAYERS) <= others
    assert {layer for layer in LAYERS if (HOST / layer).is_dir()} - folders == {"commands"}, "commands have tests/test_cli.py"


def test_imports_point_down() -> None:
    assert list(arrows_up(HOST)) == []


@pytest.mark.parametrize("folder", INNER)
def test_imports_within_a_folder_point_down_too(folder: str) -> None:
    order, up = INNER[folder], []
    for path in python_files(HOST / folder):
        mine = path.relative_to(HOST / folder).parts[0].removesuffix(".py")
        for name in imports(path, ".".join(["gyrocal", *path.relative_to(HOST).parent.parts])):
            pieces = name.split(".")
            if pieces[:2] != ["gyrocal", folder] or len(pieces) < 3 or (mine, name) == ("page", "gyrocal.web.panels"):
                continue  # the page opens a panel by the name in its address
            up += [f"{path.name} imports {name}"] if order.index(pieces[2]) > order.index(mine) else []
    assert up == []


def test_every_folder_says_what_it_may_import() -> None:
    for layer in LAYERS:
        if (HOST / layer).is_dir():
            text = ast.get_docstring(ast.parse((HOST / layer / "__init__.py").read_text(encoding="utf-8"))) or ""
            assert "imports" in text, f"{layer}/__init__.py"


@pytest.mark.parametrize(
    "source",
    [
        "from gyrocal.diagnosis.answer.diagnose import diagnose\n",
        "import gyrocal.diagnosis\n",
        "from gyrocal import diagnosis\n",
        "from ..diagnosis import diagnose\n",
        "from .. import diagnosis\n",
        "def f() -> None:\n    from gyrocal.diagnosis import diagnose\n",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from gyrocal.diagnosis import diagnose\n",
        "from importlib import import_module\nimport_module('gyrocal.diagnosis.answer.diagnose')\n",
        "from importlib import import_module\nimport_module(f'gyrocal.diagnosis.{1}')\n",
        "from gyrocal.attic import old\n",
    ],
)
def test_no_import_upwards_escapes(source: str, tmp_path: Path) -> None:
    (tmp_path / "inference").mkdir()
    (tmp_path / "inference" / "fit.py").write_text(source)
    assert len(list(arrows_up(tmp_path))) == 1


def test_an_unknown_folder_is_seen(tmp_path: Path) -> None:
    (tmp_path / "attic").mkdir()
    (tmp_path / "attic" / "old.py").touch()
    assert layers_found(tmp_path) - set(LAYERS) == {"attic"}


def test_torch_and_onnx_live_in_model_export_alone() -> None:
    for path in [*python_files(HOST), *python_files(FIRMWARE)]:
        for name in imports(path):
            assert name.split(".")[0] not in ("torch", "onnx", "onnxscript"), f"{path} imports {name}"


IMPORTED = re.compile(
    r"""(?m)(?:^\s*|[;"'])(?:import\s+onnxruntime\b|from\s+onnxruntime[.\w]*\s+import)"""
    r"""|(?:import_module|__import__|importorskip)\(\W*onnxruntime\b"""
)
"""A line that imports onnxruntime, also in a text that is run as a program, or its name handed to what imports it."""


def imports_onnxruntime(path: Path) -> bool:
    text = path.read_text(encoding="utf-8")
    in_code = path.suffix == ".py" and any(name.split(".")[0] == "onnxruntime" for name in imports(path))
    return in_code or IMPORTED.search(text) is not None


def test_one_file_imports_onnxruntime() -> None:
    """It turns the telemetry off before the import; after one import elsewhere, nobody could any more."""
    folders = ("host", "model_export", "firmware", "tests", "benchmarks", "docs")
    texts = [path for folder in folders for kind in ("py", "md", "ipynb") for path in (ROOT / folder).rglob(f"*.{kind}")]
    assert {path for path in [*texts, *ROOT.glob("*.md")] if imports_onnxruntime(path)} == {HOST / "calibration" / "runtime.py"}


@pytest.mark.parametrize(
    "source",
    [
        "import {0}\n", "import {0} as ort\n", "def f():\n    import numpy, {0}.capi\n", "from {0} import InferenceSession\n",
        "from importlib import import_module\nimport_module('{0}')\n", "import pytest\npytest.importorskip(\"{0}\")\n",
        "run([sys.executable, '-c', 'import {0}'])\n",
    ],
)  # fmt: skip
def test_no_import_of_onnxruntime_escapes(source: str, tmp_path: Path) -> None:
    path = tmp_path / "file.py"
    path.write_text(source.format("onnxruntime"))
    assert imports_onnxruntime(path)


def test_host_never_imports_model_export() -> None:
    for path in [*python_files(HOST), *python_files(FIRMWARE)]:
        assert not any(name.startswith("gyrocal_export") for name in imports(path)), path


def test_firmware_package_knows_nobody() -> None:
    for path in [p for p in python_files(FIRMWARE) if p.parent.name not in ("test", "monitor")]:  # PlatformIO's plug-ins
        names = {name.split(".")[0] for name in imports(path)}
        assert names <= set(sys.stdlib_module_names), path


def test_core_includes_only_itself_and_freestanding_c() -> None:
    core = FIRMWARE / "lib/gyrocal_core"
    freestanding = {"stdint.h", "stddef.h", "stdbool.h", "string.h", "limits.h", "float.h", "math.h"}
    intrinsics = {"gc_halfwords.h": {"arm_acle.h"}}  # the compiler's own header, where the CPU has the instructions
    for path in [*core.rglob("*.c"), *core.rglob("*.h")]:
        allowed = freestanding | intrinsics.get(path.name, set())
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.startswith("#include <"):
                assert line.split("<")[1].split(">")[0] in allowed, f"{path.name}: {line}"
            elif line.startswith("#include"):
                assert "gc_" in line, f"{path.name}: {line}"
