"""How fast the workbench is, in a real browser, and how old the newest line of the device gets while a diagnosis runs.

python benchmarks/workbench.py [--rows 240000] [--seconds 20]
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.wire import encode

RATE_HZ = 145.0
RUNS = 18
FIRST_PAGE_S, INTERACTION_S, NEWEST_S, FRAMES_HZ = 2.0, 0.2, 0.020, 20.0
AIM_ROWS = 240_000
ARGUMENTS = [
    "--no-sandbox", "--headless", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]  # fmt: skip
CHART = "getElement(Number(document.querySelector('.nicegui-echart').id.slice(1))).chart"


@contextlib.contextmanager
def served(folder: Path, *arguments: str) -> Iterator[tuple[str, float]]:
    """A workbench: its address, and when it was started."""
    began = time.monotonic()
    command = [sys.executable, "-m", "gyrocal", "workbench", "--no-browser", *arguments]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    found = re.match(r"workbench: (\S+)", process.stdout.readline())
    if not found:
        sys.exit("the workbench did not start")
    try:
        yield found[1], began
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(20)


HELLO = {
    "proto": 1, "fw": "bench", "sensor": "LSM6DSO", "rate_hz": RATE_HZ, "odr_hz": 416, "full_scale_dps": 250,
    "lsb_dps": 0.00875, "lsb_g": 6.1e-5, "lsb_c": 1 / 256, "zero_c": 25, "axis": "z", "table_dps": 78, "turn_deg": 0,
    "cal": "", "net": "",
}  # fmt: skip


class Board:
    """A device on a pseudo terminal, in a process of its own; its clock is this machine's, so that ages can be told."""

    def __init__(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        command = [sys.executable, __file__, "--board", str(self._master)]
        self._process = subprocess.Popen(command, pass_fds=[self._master], stdin=subprocess.DEVNULL)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._master)
        os.close(self._slave)


def board(master: int) -> None:
    """The board's life, in a process of its own: answers commands, sends samples on time."""
    seq, n, due, heard = 0, 0, time.monotonic(), b""

    def say(tag: str, fields: Any) -> None:
        nonlocal seq
        os.write(master, encode(tag, seq, round(time.monotonic() * 1e6), 0, fields))
        seq += 1

    while True:
        wait_s = max(0.0, due - time.monotonic())
        if select.select([master], [], [], wait_s)[0]:
            heard += os.read(master, 4096)
            *lines, heard = heard.split(b"\n")
            for line in lines:
                word = line.split(b" ")[0].decode()
                say("ACK", {"cmd": word})
                if word == "hello":
                    say("HEL", HELLO)
                if word == "status":
                    say("STA", {"state": "recording", "face": "up", "n": n, "lost": 0, "stale": 0, "resets": 0})
        if time.monotonic() >= due:
            say("RAW", [n, 3, -7, round(8914 + 10 * np.sin(n / 50)), 12, -4, 16393, n % 300])
            n += 1
            due += 1 / RATE_HZ


def ready(page: Any, seconds: float = 600.0) -> None:
    page.locator(".figure b").first.wait_for(timeout=1e3 * seconds)
    page.locator(".job").wait_for(state="hidden", timeout=1e3 * seconds)


PRESS = """async ([name, drawn]) => {
    const chart = %s, wanted = new Function("chart", "return " + drawn);
    const button = [...document.querySelectorAll("button")].find(
        b => b.getAttribute("aria-label") === name || b.innerText === name);
    let rendered = false;
    chart.one = () => { if (wanted(chart)) rendered = true; };
    chart.on("finished", chart.one);
    const began = performance.now();
    button.click();
    while (!rendered) await new Promise(requestAnimationFrame);
    chart.off("finished", chart.one);
    return (performance.now() - began) / 1e3;
}"""


def looks(url: str, browser: Any) -> dict[str, list[float]]:
    """Seconds from a click to the drawn chart, for what a person does most on the compare panel."""
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    page.goto(url)
    ready(page)
    page.wait_for_timeout(1000)
    found: dict[str, list[float]] = {}
    press = PRESS % CHART
    views = {
        "Temperature": "temperature, °C", "Table angle": "table angle, deg", "Spectrum": "frequency, Hz",
        "Timeline": "recordings one after another, s",
    }  # fmt: skip
    for _ in range(5):
        for view, axis in views.items():
            drawn = f"chart.getOption().xAxis.at(-1).name === '{axis}'"
            found.setdefault(view.lower(), []).append(page.evaluate(press, [view, drawn]))
    points = "chart.getOption().series[2].data"
    for word in ("zoom in",) * 6 + ("later", "earlier", "zoom out", "later", "zoom out"):
        first, last = page.evaluate(f"() => {{ const chart = {CHART}, p = {points}; return [p[0][0], p.at(-1)[0]]; }}")
        drawn = f"{points}[0][0] !== {first} || {points}.at(-1)[0] !== {last}"
        found.setdefault("zoom and shift", []).append(page.evaluate(press, [word, drawn]))
    page.close()
    return found


def first_page(folder: Path, browser: Any) -> float:
    """Seconds from the command to a page with everything on it."""
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    with served(folder) as (url, began):
        page.goto(url)
        page.get_by_role("button", name="Simulate and look").wait_for()
        took = time.monotonic() - began
        page.close()
    return took


def frames_per_second(url: str, browser: Any, seconds: float, *, diagnosing: bool) -> float:
    """Frames of the live page that the browser draws."""
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    if diagnosing:
        page.goto(f"{url}diagnose")
        page.get_by_role("button", name="Find what is missing").click(timeout=600_000)
        page.get_by_role("status").filter(has_text="Looking for what is missing").wait_for()
    page.goto(f"{url}live")
    page.locator(".reading b").nth(2).filter(has_text=re.compile(r"^7\d")).wait_for(timeout=60_000)
    page.wait_for_timeout(1500)
    page.evaluate(
        f"() => {{ window.frames_drawn = 0; const c = {CHART}, set = c.setOption.bind(c);"
        " c.setOption = (...what) => { window.frames_drawn++; return set(...what); }; }"
    )
    page.wait_for_timeout(1e3 * seconds)
    drawn = int(page.evaluate("() => window.frames_drawn"))
    if diagnosing:
        page.get_by_role("button", name="Stop").click()
    page.close()
    return drawn / seconds


async def newest(session: Path, port: str, seconds: float) -> dict[str, np.ndarray[Any, Any]]:
    """Ages of the newest sample that the page's state holds, looked at as often as the page draws, idle and diagnosing."""
    from gyrocal.web.state import Workbench

    bench = Workbench([session], lambda topic: None)
    bench.live.trusted.add(port)
    await bench.open(session)
    bench.live.connect(port)
    while not bench.live.newest[0]:
        await asyncio.sleep(0.1)
    found = {}
    for name in ("with nothing else to do", "while a diagnosis runs"):
        work = asyncio.create_task(bench.diagnose()) if "diagnosis" in name else None
        ages: list[float] = []
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            await asyncio.sleep(0.04)
            ages.append(time.monotonic() - bench.live.newest[0] * 1e-6)
            if work is not None and work.done():
                work = asyncio.create_task(bench.diagnose())
        if work is not None:
            bench.jobs.cancel()
            await work
        found[name] = np.array(ages)
    bench.close()
    return found


def in_browser(browser: Any, folder: Path, port: str, seconds: float, rows: int) -> bool:
    """Whether every aim was met."""
    took = sorted(first_page(folder, browser) for _ in range(3))[1]
    met = took <= FIRST_PAGE_S
    print(f"first page after the command       {took:5.2f} s   (aim {FIRST_PAGE_S:g}; median of 3)", flush=True)
    with served(folder, "s", "--port", port) as (url, _):
        for name, times in looks(url, browser).items():
            middle, worst = 1e3 * float(np.median(times)), 1e3 * max(times)
            met &= middle <= 1e3 * INTERACTION_S
            aim = f"aim {1e3 * INTERACTION_S:g}; worst {worst:.0f}; {rows} rows"
            print(f"{name:34s} {middle:5.0f} ms  ({aim})", flush=True)
        for diagnosing in (False, True):
            rate_hz = frames_per_second(url, browser, seconds, diagnosing=diagnosing)
            met &= rate_hz >= FRAMES_HZ
            told = "while a diagnosis runs" if diagnosing else "with nothing else to do"
            print(f"live frames drawn, {told}: {rate_hz:.1f} a second (aim {FRAMES_HZ:g})", flush=True)
    return met


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=AIM_ROWS)
    parser.add_argument("--seconds", type=float, default=20.0, help="how long the live page is watched")
    parser.add_argument("--board", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.board is not None:
        board(given.board)
    from playwright.sync_api import sync_playwright

    from gyrocal.simulate import simulate

    with tempfile.TemporaryDirectory() as scratch, contextlib.closing(Board()) as device:
        folder = Path(scratch)
        seconds = given.rows / RUNS / RATE_HZ
        simulate(folder / "s", "paper", ["table_ripple"], 1, scenarios=RUNS // 2, seconds=seconds, parquet=True)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=ARGUMENTS)
            met = in_browser(browser, folder, device.port, given.seconds, given.rows)
            browser.close()
        for told, ages in asyncio.run(newest(folder / "s", device.port, given.seconds)).items():
            middle, tail = 1e3 * np.quantile(ages, [0.5, 0.99])
            met &= bool(tail <= 1e3 * NEWEST_S)
            print(f"newest line, {told}: {middle:.1f} ms old, p99 {tail:.1f} ms (aim {1e3 * NEWEST_S:g})", flush=True)
    return 0 if met else 1


if __name__ == "__main__":
    raise SystemExit(main())
