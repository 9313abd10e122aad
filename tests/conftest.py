"""What all tests share: a missing tool skips a test and says so, or fails it where everything must be there."""

import importlib.util
import os
import shutil
from collections.abc import Callable, Iterator

import pytest


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


@pytest.fixture
def library() -> Iterator[dict[str, object]]:
    """The effects by id, to be changed at will: after the test they are what they were, in their order."""
    from gyrocal.effects.base import effects

    everything = dict(effects())
    yield effects()
    effects().clear()
    effects().update(everything)
