"""A visit of the workbench in an empty home: it asks no other host for anything, and leaves nothing that was not asked for."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gyrocal.simulation.simulate import simulate
from gyrocal.web.server import POLICY
from watched import FONTS, ONE_THREAD, Watched

from .conftest import patience_s

EXTERNAL = re.compile(r"""["'(=](?:https?:|wss?:)?//(?!www\.w3\.org/|127\.0\.0\.1:)[\w.-]+""")
"""An address of another host that a page could fetch something from. Those of w3.org are names of formats."""


def test_a_visit(watched: Watched, look: Callable[..., Any], require_tool: Callable[[str], str]) -> None:
    """Every panel of a session; the network, which calibrates, runs onnxruntime."""
    source = watched.root / "sessions"
    simulate(source / "s", "paper", ["table_ripple"], 3, scenarios=2, seconds=8)
    watched.bring(source)
    process = watched.gyrocal("workbench", "s", "--no-browser", "--http-port", "0")
    assert process.stdout is not None
    found = re.match(r"workbench: (http://127\.0\.0\.1:\d+/)", process.stdout.readline())
    assert found
    try:
        page = look(found[1])
        for panel in ("Live", "Compare", "Diagnose", "Calibrate & export"):
            page.get_by_role("button", name=panel, exact=True).click()
            page.get_by_role("heading", name=panel, exact=True).wait_for(state="attached")
            assert EXTERNAL.findall(page.content()) == []
        page.locator("table.plain tbody tr").first.wait_for()
        assert page.request.get(found[1]).headers["content-security-policy"] == POLICY
        page.close()
    finally:
        os.killpg(process.pid, signal.SIGINT)
        told, _ = process.communicate(timeout=patience_s())
    assert process.returncode == 0, told
    watched.check((), FONTS, serves=True)


@pytest.mark.parametrize("name", ["SIGINT", *(pytest.param(name, marks=pytest.mark.wide) for name in ("SIGTERM", "SIGHUP"))])
def test_however_it_ends_its_traces_go(name: str, tmp_path: Path) -> None:
    """SIGHUP comes when the terminal is closed."""
    simulate(tmp_path / "s", "paper", [], 3, scenarios=1, seconds=4)
    scratch, number = tmp_path / "tmp", getattr(signal, name)
    scratch.mkdir()

    def heard() -> None:
        signal.signal(number, signal.SIG_DFL)  # under nohup the signal is ignored, and the workbench leaves it so

    # NiceGUI behaves otherwise where it finds itself under pytest
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")} | ONE_THREAD | {"TMPDIR": str(scratch)}
    command = [sys.executable, "-m", "gyrocal", "workbench", "s", "--no-browser", "--http-port", "0"]
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment, preexec_fn=heard, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("workbench: ")
        assert list(scratch.iterdir()) != []
        process.send_signal(number)
        process.wait(patience_s())
    assert list(scratch.iterdir()) == []
