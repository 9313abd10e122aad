"""Each fuzz target takes its corpus and some seconds of inputs made from it, without a finding; `make fuzz` takes longer."""

from collections.abc import Callable
from pathlib import Path

import fuzzing
import pytest

SECONDS = 2


@pytest.fixture(scope="module")
def clang(require_tool: Callable[[str], str]) -> str:
    return require_tool("clang")


@pytest.fixture(scope="module")
def objects(clang: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzzed")
    fuzzing.compile_core(clang, folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("target", [pytest.param(t, marks=[pytest.mark.wide] * (t == "bus")) for t in fuzzing.TARGETS])
def test_nothing_is_found(clang: str, objects: Path, target: str, tmp_path: Path) -> None:
    done = fuzzing.fuzz(fuzzing.link(clang, objects, target), SECONDS, tmp_path, seed=1)
    assert done.found is None, done.found
    assert done.executions > 100
    assert done.reached > 30
