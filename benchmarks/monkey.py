"""Random use of every page of the workbench from a seed: no error in the browser's console, no traceback in the server.

python benchmarks/monkey.py [--acts 4000] [--seed 1]
"""

from __future__ import annotations

import argparse
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from workbench import ARGUMENTS  # the other benchmark of the page

from gyrocal.simulation.simulate import simulate
from web.monkey import play

COSTLY = "Train it"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--acts", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    from playwright.sync_api import sync_playwright

    complaints: list[str] = []
    with tempfile.TemporaryDirectory() as scratch, tempfile.TemporaryFile("w+") as said:
        folder = Path(scratch)
        simulate(folder / "s", "paper", ["table_ripple"], 3, scenarios=5, seconds=20)
        command = [sys.executable, "-m", "gyrocal", "workbench", "--no-browser", "s"]
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=said, text=True)
        assert process.stdout is not None
        found = re.match(r"workbench: (\S+)", process.stdout.readline())
        if not found:
            sys.exit("the workbench did not start")
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=ARGUMENTS)
            page = browser.new_page(viewport={"width": 1280, "height": 720})
            page.on("console", lambda m: complaints.append(f"{m.type}: {m.text}") if m.type in ("error", "warning") else None)
            page.on("pageerror", lambda error: complaints.append(str(error)))
            play(page, found[1], given.seed, given.acts, COSTLY)
            browser.close()
        alive = process.poll() is None
        process.send_signal(signal.SIGINT)
        process.wait(60)
        said.seek(0)
        text = said.read()
    traces = text.count("(most recent call last)")
    print(f"{given.acts} acts: {len(complaints)} complaints of the browser, {traces} of the server")
    print("\n".join([*complaints[:20], text[-3000:] if traces else ""]).strip())
    return 0 if alive and not complaints and not traces else 1


if __name__ == "__main__":
    raise SystemExit(main())
