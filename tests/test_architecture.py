"""Arrows point one way: this fails when an import points the other."""

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
HOST, EXPORT, FIRMWARE = ROOT / "host/gyrocal", ROOT / "model_export/gyrocal_export", ROOT / "firmware/gyrocal_firmware"

# From the bottom up; a file may import what stands in its own row or a row above it. Folders stand for their files.
LAYERS = [
    {"errors", "threads", "__init__"},
    {"session", "output", "wire", "core", "network", "spectrum", "climate", "campaigns"},
    {"port"},
    {"outliers"},
    {"effects"},
    {"variables"},
    {"formula"},
    {"model", "blocks", "noise"},
    {"allan", "fit"},
    {"heldout", "probes", "simulate", "estimator", "importer"},
    {"scenarios", "spreads", "device", "record", "monitor", "verify"},
    {"compare", "calibrate", "calibration_header", "core_estimator", "limit"},
    {"diagnose", "custom", "pictures"},
    {"report", "api"},
    {"demo", "web"},
]


def imports(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def python_files(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.py"))


def test_torch_and_onnx_live_in_model_export_alone() -> None:
    for path in [*python_files(HOST), *python_files(FIRMWARE)]:
        for name in imports(path):
            assert name.split(".")[0] not in ("torch", "onnx", "onnxscript"), f"{path} imports {name}"


def test_host_never_imports_model_export() -> None:
    for path in [*python_files(HOST), *python_files(FIRMWARE)]:
        assert not any(name.startswith("gyrocal_export") for name in imports(path)), path


def test_firmware_package_knows_nobody() -> None:
    for path in [p for p in python_files(FIRMWARE) if p.parent.name not in ("test", "monitor")]:  # PlatformIO's plug-ins
        names = {name.split(".")[0] for name in imports(path)}
        assert names <= set(sys.stdlib_module_names), path


@pytest.mark.parametrize("path", python_files(HOST), ids=lambda p: str(p.relative_to(HOST)))
def test_host_reads_from_the_bottom_up(path: Path) -> None:
    parts = path.relative_to(HOST).parts
    room = parts[0].removesuffix(".py")
    height = {name: i for i, layer in enumerate(LAYERS) for name in layer}
    for name in imports(path):
        pieces = name.split(".")
        if pieces[0] != "gyrocal" or len(pieces) < 2:
            continue
        other = pieces[1]
        assert room in ("commands", "cli", "web", "__main__") or other not in ("commands", "cli", "web"), (
            f"{path.name} imports {name}"
        )
        if room in height and other in height:
            assert height[other] <= height[room], f"{path.name} imports {name}, which stands above it"


def test_core_includes_only_itself_and_freestanding_c() -> None:
    core = FIRMWARE / "lib/gyrocal_core"
    allowed = {"stdint.h", "stddef.h", "stdbool.h", "string.h", "limits.h", "float.h", "math.h"}
    for path in [*core.rglob("*.c"), *core.rglob("*.h")]:
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.startswith("#include <"):
                assert line.split("<")[1].split(">")[0] in allowed, f"{path.name}: {line}"
            elif line.startswith("#include"):
                assert "gc_" in line, f"{path.name}: {line}"
