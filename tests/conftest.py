"""What all tests share: a missing tool skips a test and says so, or fails it where everything must be there."""

import importlib.util
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from compiled import Objects
from watched import ONE_THREAD, Watched

os.environ |= ONE_THREAD  # read as numpy, torch and polars are imported, also by the commands that a test starts


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--wide", action="store_true", help="also the tests that are marked wide")


@pytest.hookimpl(trylast=True)  # what -m leaves out decides nothing
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Files with a slow test begin first, so that at the end no worker waits for one of them. Wide tests are asked for."""
    if not config.getoption("--wide"):
        wide = [item for item in items if item.get_closest_marker("wide")]
        config.hook.pytest_deselected(items=wide)
        items[:] = [item for item in items if item not in wide]
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.fixture(scope="session")
def require_tool() -> Callable[[str], str]:
    """`require_tool("cc")` is the tool's path; skips where it is missing, fails with GYROCAL_REQUIRE=all."""

    def require(name: str) -> str:
        path = shutil.which(name)
        if path is None:
            if os.environ.get("GYROCAL_REQUIRE") == "all":
                pytest.fail(f"{name} is missing, and GYROCAL_REQUIRE=all")
            pytest.skip(f"{name} is not installed")
        return path

    return require


@pytest.fixture(scope="session")
def require_module() -> Callable[[str], None]:
    """`require_module("torch")` skips where the package is missing, fails with GYROCAL_REQUIRE=all."""

    def require(name: str) -> None:
        if importlib.util.find_spec(name) is None:
            if os.environ.get("GYROCAL_REQUIRE") == "all":
                pytest.fail(f"package {name} is missing, and GYROCAL_REQUIRE=all")
            pytest.skip(f"package {name} is not installed: pip install 'gyrocal[train]'")

    return require


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Objects:
    """Objects of C sources that all workers share, and with GYROCAL_OBJECTS, the folder that it names, later runs too."""
    if kept := os.environ.get("GYROCAL_OBJECTS"):
        return Objects(Path(kept))
    root = tmp_path_factory.getbasetemp()
    return Objects((root.parent if "PYTEST_XDIST_WORKER" in os.environ else root) / "compiled")


@pytest.fixture(scope="session", autouse=True)
def _compiled_here(compiled: Objects) -> Iterator[None]:
    """What ``gyrocal.core.library`` compiles is linked of these objects: all but those of other headers are there already."""
    from gyrocal.core import library

    compile_all = library._compile

    def once(command: Sequence[str], units: Sequence[str], output: Path) -> subprocess.CompletedProcess[str]:
        try:
            objects = compiled.of_all(command, [Path(unit) for unit in units])
        except subprocess.CalledProcessError as error:
            return subprocess.CompletedProcess(error.cmd, error.returncode, "", error.stderr.decode())
        return compile_all(command, [str(built) for built in objects], output)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(library, "_compile", once)
        yield


@pytest.fixture
def compiled_for_cpus(compiled: Objects, monkeypatch: pytest.MonkeyPatch) -> None:
    """What ``gyrocal.core.cpus`` compiles for a CPU is compiled once: each part is linked with the whole core."""
    from gyrocal.core import cpus

    output = cpus._output

    def once(cpu: cpus.Cpu, command: Sequence[str], *more: float) -> bytes:
        if "-c" not in command:
            return output(cpu, command, *more)
        *options, _, source, _, target = command
        shutil.copy(compiled.of(options, Path(source)), target)
        return b""

    monkeypatch.setattr(cpus, "_output", once)


@pytest.fixture
def watched(tmp_path: Path, require_tool: Callable[[str], str]) -> Watched:
    """A user with an empty home, whose commands run under strace."""
    strace = require_tool("strace")
    if subprocess.run([strace, "-o", os.devnull, "true"], stderr=subprocess.DEVNULL).returncode != 0:
        if os.environ.get("GYROCAL_REQUIRE") == "all":
            pytest.fail("strace may not trace here, and GYROCAL_REQUIRE=all")
        pytest.skip("strace may not trace here")
    return Watched(tmp_path)


@pytest.fixture(scope="module", name="known_answers")
def _known_answers() -> Iterator[None]:
    """What the tests of one file ask of the same session and the same model is computed once."""
    from known import known_answers

    with known_answers():
        yield


@pytest.fixture(scope="module")
def tests_alone() -> Iterator[None]:
    """The diagnoses of one file are without the evidence of sets: for files that ask what the tests of a residual name."""
    from known import without_evidence

    with without_evidence():
        yield


@pytest.fixture(name="measured_adds")
def _measured_adds() -> Iterator[None]:
    """``add`` leaves out the search for what the model then still lacks: for tests of its model and its files."""
    from known import measured_adds

    with measured_adds():
        yield


@pytest.fixture
def library() -> Iterator[dict[str, object]]:
    """The effects by id, to be changed at will: after the test they are what they were, in their order."""
    from gyrocal.effects.base import effects

    everything = dict(effects())
    yield effects()
    effects().clear()
    effects().update(everything)
