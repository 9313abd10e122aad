"""Processor seconds of the tests, by folder, by file and by test, child processes included, whatever else the machine does.

    python benchmarks/suite.py                        # all tests, one after the other
    python benchmarks/suite.py tests/web tests/pins   # these
    python benchmarks/suite.py tests -m "not slow"    # whatever pytest takes

A busy machine makes processor seconds too, by up to a half: compare figures of one afternoon.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Generator

import pytest

LONGEST = 30


class Costs:
    """A plugin of pytest that adds up the processor seconds of each test with its fixtures."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Time one test. A fixture of a file counts with the first test that asks for it."""
        start_s = processor_s()
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] += processor_s() - start_s


def processor_s() -> float:
    """Processor seconds of this process and of its children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def show(title: str, seconds: Counter[str]) -> None:
    """Print the largest sums."""
    print(f"\n{title}")
    for name, of in seconds.most_common(LONGEST):
        print(f"{of:8.1f}  {name}")


if __name__ == "__main__":
    costs = Costs()
    code = pytest.main(["-p", "no:cacheprovider", *sys.argv[1:]], plugins=[costs])
    files: Counter[str] = Counter()
    folders: Counter[str] = Counter()
    for test, of in costs.seconds.items():
        file = test.partition("::")[0]
        files[file] += of
        folders["/".join(file.split("/")[:2])] += of
    show("by folder", folders)
    show("by file", files)
    show("by test", costs.seconds)
    print(f"\n{sum(files.values()):.0f} s of processor in all")
    sys.exit(code)
