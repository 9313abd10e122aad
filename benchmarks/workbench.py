"""How fast the workbench is, in a real browser, and how old the newest line of the device gets while a diagnosis runs.

python benchmarks/workbench.py [--rows 240000] [--seconds 20]
python benchmarks/workbench.py --large 10000000     a session of so many rows: opened, compared, zoomed down to single samples
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import math
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

from gyrocal.device.wire import encode

RATE_HZ = 145.0
RUNS = 18
FEWEST = 1000
"""Rows that are drawn one by one."""
PATIENCE_S = 1800.0
FIRST_PAGE_S, FIRST_PLOT_S, INTERACTION_S, NEWEST_S, FRAMES_HZ = 2.0, 3.0, 0.2, 0.020, 20.0
AIM_ROWS = 240_000
ARGUMENTS = [
    "--no-sandbox", "--headless", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]  # fmt: skip
CHART = "getElement(Number(document.querySelector('.nicegui-echart').id.slice(1))).chart"


@contextlib.contextmanager
def served(folder: Path, *arguments: str) -> Iterator[tuple[str, float, int]]:
    """Start a workbench. Yields its address, its start time and its process."""
    began = time.monotonic()
    command = [sys.executable, "-m", "gyrocal", "workbench", "--no-browser", *arguments]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    found = re.match(r"workbench: (\S+)", process.stdout.readline())
    if not found:
        sys.exit("the workbench did not start")
    try:
        yield found[1], began, process.pid
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(20)


HELLO = {
    "proto": 1, "fw": "bench", "sensor": "LSM6DSO", "rate_hz": RATE_HZ, "odr_hz": 416, "full_scale_dps": 250,
    "lsb_dps": 0.00875, "lsb_g": 6.1e-5, "lsb_c": 1 / 256, "zero_c": 25, "axis": "z", "table_dps": 78, "turn_deg": 0,
    "cal": "", "net": "",
}  # fmt: skip


class Board:
    """A device on a pseudo terminal, in a separate process. It uses this machine's clock, so that ages can be measured."""

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
    """The main function of the board's process: it answers commands and sends samples on time."""
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


def looks(page: Any, zooms: int) -> dict[str, list[float]]:
    """Seconds from a click to the drawn chart for the common actions on the compare panel, which is then zoomed in."""
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
    for word in ("zoom in", "zoom out", "zoom in", "later", "earlier", "later", *("zoom in",) * (zooms - 1)):
        first, last = page.evaluate(f"() => {{ const chart = {CHART}, p = {points}; return [p[0][0], p.at(-1)[0]]; }}")
        drawn = f"{points}[0][0] !== {first} || {points}.at(-1)[0] !== {last}"
        found.setdefault("zoom and shift", []).append(page.evaluate(press, [word, drawn]))
    return found


def told(found: dict[str, list[float]], rows: int) -> bool:
    """Print the times. Returns True if all are within the aim."""
    met = True
    for name, times in found.items():
        middle, worst = 1e3 * float(np.median(times)), 1e3 * max(times)
        met &= middle <= 1e3 * INTERACTION_S
        print(f"{name:34s} {middle:5.0f} ms  (aim {1e3 * INTERACTION_S:g}; worst {worst:.0f}; {rows} rows)", flush=True)
    return met


def family(pid: int) -> list[int]:
    """A process and its children."""
    return [pid, *map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())]


def busy_s(pid: int) -> float:
    """The processor time of a process in s."""
    ticks = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


def peak_mb(pid: int) -> list[float]:
    """The peak memory of a process and of its children in MB, with memory-mapped files."""
    lines = [Path(f"/proc/{each}/status").read_text() for each in family(pid)]
    return [int(re.search(r"VmHWM:\s+(\d+)", text)[1]) / 1e3 for text in lines]  # type: ignore[index]


def large(folder: Path, rows: int) -> bool:
    """Pass a session of so many rows through the engine and the browser. Returns True if every aim was met."""
    campaign(folder / "large", rows)
    with chromium() as browser:
        took, busy = sorted(first_plot(folder, browser) for _ in range(3))[1]
        print(f"first plot after the command       {took:5.1f} s   (aim {FIRST_PLOT_S:g}; median of 3; {busy})", flush=True)
        return looked_at(folder, browser, rows) and took <= FIRST_PLOT_S


def first_plot(folder: Path, browser: Any) -> tuple[float, str]:
    """Seconds from the command to the first plot of the large session, and the processor time until then in words."""
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    with served(folder, "large") as (url, began, pid):
        page.goto(url)
        page.locator('[role=img][aria-label="Timeline"] canvas').wait_for(timeout=1e3 * PATIENCE_S)
        took, (server, *workers) = time.monotonic() - began, map(busy_s, family(pid))
        page.close()
    busy = f"page {server:.1f} s, worker {max(workers):.1f} s"
    return took, f"processor time, side by side: {busy}; load {os.getloadavg()[0]:.1f}"


def looked_at(folder: Path, browser: Any, rows: int) -> bool:
    """Time the views and the zooming of the large session. Returns True if every aim was met."""
    with served(folder, "large") as (url, began, pid):
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.goto(url)
        ready(page, PATIENCE_S)
        print(f"model held against it              {time.monotonic() - began:5.1f} s", flush=True)
        zooms = math.ceil(math.log2(rows / FEWEST))
        met = told(looks(page, zooms), rows)
        steps = np.diff(page.evaluate(f"() => {CHART}.getOption().series[0].data.filter(p => p[1] !== null).map(p => p[0])"))
        print(f"zoomed in {zooms} times: {len(steps) + 1} points, {np.median(steps) * RATE_HZ:.2f} sample apart", flush=True)
        server, *others = peak_mb(pid)
        print(f"memory at most: page {server:.0f} MB, worker {max(others):.0f} MB", flush=True)
    return met and bool(abs(np.median(steps) * RATE_HZ - 1) < 0.05)


def first_page(folder: Path, browser: Any) -> tuple[float, float]:
    """Seconds from the command to the complete page, and the server's processor time until then."""
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    with served(folder) as (url, began, pid):
        page.goto(url)
        page.get_by_role("button", name="Simulate and look").wait_for()
        took = time.monotonic() - began
        busy = busy_s(pid)
        page.close()
    return took, busy


def frames_per_second(url: str, browser: Any, seconds: float, *, diagnosing: bool) -> float:
    """Frames per second that the browser draws of the live page during the diagnosis."""
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
    stop, began = page.get_by_role("button", name="Stop"), time.monotonic()
    going = True
    while going:
        page.wait_for_timeout(250)
        drawn, lasted_s = int(page.evaluate("() => window.frames_drawn")), time.monotonic() - began
        going = lasted_s < seconds and (stop.is_visible() or not diagnosing)
    if stop.is_visible():
        stop.click()
    page.close()
    return drawn / lasted_s


async def newest(session: Path, port: str, seconds: float) -> dict[str, np.ndarray[Any, Any]]:
    """Ages of the newest sample in the page's state, sampled as often as the page draws, idle and during a diagnosis."""
    from gyrocal.web.state.workbench import Workbench

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


def usual(folder: Path, rows: int, seconds: float) -> bool:
    """Measure the start, a session of the usual size and a device. Returns True if every aim was met."""
    campaign(folder / "s", rows)
    with contextlib.closing(Board()) as device:
        with chromium() as browser:
            met = in_browser(browser, folder, device.port, seconds, rows)
        for when, ages in asyncio.run(newest(folder / "s", device.port, seconds)).items():
            middle, tail = 1e3 * np.quantile(ages, [0.5, 0.99])
            met &= bool(tail <= 1e3 * NEWEST_S)
            print(f"newest line, {when}: {middle:.1f} ms old, p99 {tail:.1f} ms (aim {1e3 * NEWEST_S:g})", flush=True)
    return met


def in_browser(browser: Any, folder: Path, port: str, seconds: float, rows: int) -> bool:
    """Run the measurements in the browser. Returns True if every aim was met."""
    took, busy = sorted(first_page(folder, browser) for _ in range(3))[1]
    met = took <= FIRST_PAGE_S
    told_busy = f"{busy:.2f} s of it the server's processor time"
    print(f"first page after the command       {took:5.2f} s   (aim {FIRST_PAGE_S:g}; median of 3; {told_busy})", flush=True)
    with served(folder, "s", "--port", port) as (url, _, _):
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.goto(url)
        met &= told(looks(page, 6), rows)
        page.close()
        for diagnosing in (False, True):
            rate_hz = frames_per_second(url, browser, seconds, diagnosing=diagnosing)
            met &= rate_hz >= FRAMES_HZ
            when = "while a diagnosis runs" if diagnosing else "with nothing else to do"
            print(f"live frames drawn, {when}: {rate_hz:.1f} a second (aim {FRAMES_HZ:g})", flush=True)
    return met


def campaign(folder: Path, rows: int) -> None:
    """Simulate a session of so many rows on a table with ripple."""
    from gyrocal.simulation.simulate import simulate

    seconds = rows / RUNS / RATE_HZ
    simulate(folder, "paper", ["table_ripple"], 1, scenarios=RUNS // 2, seconds=seconds, parquet=True)


@contextlib.contextmanager
def chromium() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=ARGUMENTS)
        yield browser
        browser.close()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=AIM_ROWS)
    parser.add_argument("--seconds", type=float, default=20.0, help="how long the live page is watched")
    parser.add_argument("--large", type=int, metavar="ROWS", help="measure a session of so many rows instead")
    parser.add_argument("--board", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.board is not None:
        board(given.board)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        met = large(folder, given.large) if given.large else usual(folder, given.rows, given.seconds)
    return 0 if met else 1


if __name__ == "__main__":
    raise SystemExit(main())
