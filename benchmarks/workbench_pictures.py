"""The pictures of the workbench in the docs: python benchmarks/workbench_pictures.py docs/images

A recording of nine power cycles on a table with ripple is compared, diagnosed, completed and calibrated in headless Chromium,
and the simulated device is listened to until its answer is complete.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

from gyrocal.simulation.simulate import simulate

sys.path.insert(0, str(Path(__file__).parent))
from workbench import chromium, served  # the other benchmark of the page

PATIENCE_MS = 600_000
SIZE = {"width": 1280, "height": 720}


def finished(page: Any) -> None:
    """Wait until no work is under way and the charts stand still."""
    page.wait_for_timeout(1000)
    page.locator(".job").wait_for(state="hidden")
    page.mouse.move(5, 300)
    page.wait_for_timeout(2500)


def of_session(page: Any, url: str, out: Path) -> None:
    """Compare, Diagnose after Add, and Calibrate."""
    page.goto(f"{url}compare?session=ripple")
    page.locator(".figure b").first.wait_for()
    finished(page)
    page.screenshot(path=out / "workbench_compare.png")
    page.get_by_role("button", name="What is missing?").click()
    page.locator("article.add").get_by_role("button", name="Add to the model").first.click()
    page.get_by_text("in the model now").wait_for()
    finished(page)
    page.screenshot(path=out / "workbench_diagnose.png")
    page.get_by_role("button", name="Calibrate & export").click()
    page.locator("table.plain", has_text="misfit").first.wait_for()
    finished(page)
    page.screenshot(path=out / "workbench_calibrate.png")


def of_device(page: Any, url: str, out: Path) -> None:
    """Live, when both faces were measured."""
    page.goto(f"{url}live")
    page.get_by_role("button", name="Start a simulated device").click()
    page.get_by_text(re.compile("the answer is complete|Both faces are measured")).first.wait_for()
    page.mouse.move(5, 300)
    page.wait_for_timeout(2500)
    page.screenshot(path=out / "workbench_live.png")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    out = parser.parse_args().out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch, chromium() as browser:
        simulate(Path(scratch) / "ripple", "paper", ["table_ripple"], 3, scenarios=9, seconds=20.0)
        with served(Path(scratch)) as (url, _, _):
            page = browser.new_page(viewport=SIZE)
            page.set_default_timeout(PATIENCE_MS)
            of_session(page, url, out)
            of_device(page, url, out)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
