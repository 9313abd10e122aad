"""A session whose reference is gravity opens with its rests and its comparison by angle."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gyrocal.cli import main
from gyrocal.simulation.simulate import simulate


def test_rests_and_comparison_are_those_of_the_command_line(
    serve: Callable[..., Any], look: Callable[..., Any], chromium: Any, tmp_path: Path
) -> None:
    simulate(tmp_path / "hand", "hands", [], 3)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(["compare", str(tmp_path / "hand"), "--json"]) == 0
    compared = json.loads(out.getvalue())
    page = look(serve(tmp_path, "hand").url)
    page.locator(".figure b").first.wait_for()
    assert page.locator(".session-name").inner_text() == "hand"
    shown = page.locator(".figure b").all_inner_texts()
    assert shown == [f"{compared[name]:.4f}" for name in ("rms_deg", "floor_deg", "excess_deg")]
    assert page.locator("[aria-label='Rests'] tbody tr").count() == compared["rests"]
    assert page.locator("[aria-label='Movements between them'] tbody tr").count() == compared["movements"]
    budgets = page.locator("[aria-label='error budget'] table")
    assert budgets.count() == 3
    assert "sample clock" in budgets.first.inner_text()
    assert page.locator(".preview img").evaluate("i => i.complete && i.naturalWidth > 100")
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280
