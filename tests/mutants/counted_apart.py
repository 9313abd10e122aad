"""A plugin of pytest: what the C core executes (GYROCAL_CORE_COVERAGE) is counted in a folder for each file of tests."""

import os
from pathlib import Path

import pytest


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    os.environ["GCOV_PREFIX"] = str(Path(os.environ["GYROCAL_COUNTS"]) / item.path.relative_to(item.config.rootpath))
