"""A workbench served from a folder of its own, and a headless Chromium that looks at it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

ARGUMENTS = [
    "--no-sandbox", "--headless", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]  # fmt: skip
"""The last one: Chromium asks for names of its maker's hosts as it starts, and gets none."""
LOOK_MS = 100.0
"""Between two looks at a condition. Playwright looks at each frame, and a chart copies all its data for each look."""
PATIENCE_S, MOST_PATIENCE_S = 60.0, 180.0


def patience_s() -> float:
    """How long a page may take for one step: only one that hangs takes as long. A busy machine is given more time."""
    return min(MOST_PATIENCE_S, PATIENCE_S * (1 + os.getloadavg()[0] / (os.cpu_count() or 1)))


@dataclass
class Served:
    """A running workbench: its address, the folder it was started in."""

    url: str
    folder: Path
    process: subprocess.Popen[str] = field(repr=False)


@contextmanager
def serving() -> Iterator[Callable[..., Served]]:
    """What starts `gyrocal workbench` in a folder, with arguments. All end with the context, and none has complained."""
    started: list[subprocess.Popen[str]] = []

    def start(folder: Path, *arguments: str) -> Served:
        # NiceGUI behaves otherwise where it finds itself under pytest
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
        command = [sys.executable, "-m", "gyrocal", "workbench", "--no-browser", *arguments]
        process = subprocess.Popen(
            command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
        )
        started.append(process)
        assert process.stdout is not None
        line = process.stdout.readline()
        found = re.match(r"workbench: (http://\S+)", line)
        assert found, line + (process.stderr.read() if process.stderr and not line else "")
        return Served(found[1], folder, process)

    yield start
    for process in started:
        process.send_signal(signal.SIGINT)
        try:
            _, problems = process.communicate(timeout=patience_s())
        except subprocess.TimeoutExpired:
            process.kill()
            raise
        assert process.returncode == 0, problems
        assert "(most recent call last)" not in problems, problems


@pytest.fixture(scope="module")
def serve() -> Iterator[Callable[..., Served]]:
    """`serve(folder, *arguments)` starts a workbench of its own for a module."""
    with serving() as start:
        yield start


@pytest.fixture(scope="session")
def workbench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One workbench for many modules: its start, its worker's and the browser's first page take ten seconds together.

    Each module puts its sessions into the folder, under names that no other module gives, and opens them by their address.
    """
    with serving() as start:
        yield start(tmp_path_factory.mktemp("workbench"))


@pytest.fixture(scope="session")
def chromium(require_tool: Callable[[str], str], require_module: Callable[[str], None]) -> Iterator[Any]:
    path = require_tool("chromium")
    require_module("playwright")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield browser
        browser.close()


STILL: dict[str, Any] = {"reduced_motion": "reduce", "viewport": {"width": 1280, "height": 720}}


@pytest.fixture(scope="session")
def visitor(chromium: Any) -> Iterator[Any]:
    """The browser context of all pages. What one of them has fetched and compiled, the next ones have: half of their time.

    The browser keeps it as long as a page of the context is open, which the first one is.
    """
    context = chromium.new_context(**STILL)
    context.new_page()
    yield context
    context.close()


@pytest.fixture
def look(chromium: Any, visitor: Any) -> Iterator[Callable[..., Any]]:
    """`look(url)` opens a page; at the end none has asked another host for anything, nor complained.

    Nothing moves unless ``reduced_motion="no-preference"``: each frame of a motion is drawn by the processor. A page with other
    options than of media has a context of its own. The cookies of the others go with the test.
    """
    complaints: list[str] = []
    contexts = []

    def open_page(url: str, **options: Any) -> Any:
        context = visitor
        if not options.keys() <= {"color_scheme", "reduced_motion"}:
            context = chromium.new_context(**STILL | options)
            contexts.append(context)
        page = context.new_page()
        if context is visitor:
            page.emulate_media(**options)
        page.set_default_timeout(1e3 * patience_s())
        page.wait_for_function = partial(page.wait_for_function, polling=LOOK_MS)
        host = urlsplit(url).netloc

        def request(asked: Any) -> None:
            if urlsplit(asked.url).scheme in ("http", "https", "ws", "wss") and urlsplit(asked.url).netloc != host:
                complaints.append(f"asked for {asked.url}")

        page.on("request", request)
        page.on("console", lambda m: complaints.append(f"{m.type}: {m.text}") if m.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(url)
        return page

    yield open_page
    for context in contexts:
        context.close()
    for page in visitor.pages[1:]:
        page.close()
    visitor.clear_cookies()
    assert not complaints, complaints
