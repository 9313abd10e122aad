"""The scripts of ``benchmarks/`` as modules, for tests that use their sessions."""

import importlib.util
import sys
from pathlib import Path
from typing import Any


def study(name: str) -> Any:
    """The module of ``benchmarks/NAME.py``."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).parents[1] / f"benchmarks/{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
