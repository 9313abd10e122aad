"""A network trained for seconds, and its files."""

from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def tiny_run(require_module: Callable[[str], None], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder of a net of another shape than the shipped one: wider kernels, longer than the pools before them."""
    require_module("torch")
    from gyrocal_export.nets.paper import Shape
    from gyrocal_export.train import Config, train

    shape = Shape(
        head_channels=3, head_kernel=9, head_pool=5, combined_channels=5, combined_kernel=7, combined_pool=4, hidden=7
    )
    out = tmp_path_factory.mktemp("runs") / "tiny"
    train(Config(epochs=2, scenarios=600, validation_scenarios=100, batch=32, shape=shape), out, lambda *_: None)
    return out


@pytest.fixture(scope="session")
def tiny_files(tiny_run: Path, require_module: Callable[[str], None], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `gyrocal export` writes of it."""
    require_module("onnx")
    from gyrocal_export.export import export_run
    from gyrocal_export.files import write_all

    out = tmp_path_factory.mktemp("export")
    write_all(out, export_run(tiny_run))
    return out
