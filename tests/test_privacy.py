"""Nothing leaves this machine, and nothing is written unasked: every verb in an empty home, under strace.

Verbs that may keep the same are called one after the other in one process, whose start costs more than most of them.
"""

import re
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from device.wifi_board import WifiBoard
from gyrocal.cli import command_modules, main
from gyrocal.core import library
from gyrocal.device.simulated import SimulatedDevice
from make_runs import make_run, make_session
from watched import CORE, FONTS, Watched

pytestmark = pytest.mark.slow
HERE = Path(__file__).resolve().parent
SWING = HERE.parent / "docs" / "examples" / "swing.csv.gz"
MODEL = str(files("gyrocal") / "data" / "table2" / "model.toml")

@dataclass(frozen=True)
class Case:
    """One or several command lines.

    Attributes:
        makes: what they write in the current folder; everything there was named on the command line or in the help.
        keeps: patterns of what may be there afterwards besides.
        serves: True if the verb's work is done by several processes that talk to each other over loopback.
        alone: True if no other verb is called in the process.
        smaller: statements that make the work smaller, which run before the command line.
    """

    lines: tuple[str, ...]
    makes: tuple[str, ...] = ()
    keeps: tuple[str, ...] = ()
    serves: bool = False
    alone: bool = False
    smaller: str = ""


CASES = {
    "add": Case(("add table_ripple s --model m.toml --json",), ("m.toml",)),
    "allan": Case(("allan s --json",)),
    "apply": Case((f"apply s --model {MODEL} --out corrected --json",), ("corrected",)),
    "benchmark": Case(("benchmark robustness --sample --json",)),
    "calibrate": Case(("calibrate s --seconds 2,4 --json",)),
    "compare": Case(("compare s --html page.html --residuals rest.csv",), ("page.html", "rest.csv"), FONTS),
    "demo": Case(
        ("demo --json",), ("demo-out",), CORE + FONTS, alone=True,
        smaller="from gyrocal import demo; demo.CAMPAIGN_SCENARIOS, demo.CAMPAIGN_SECONDS, demo.TEST_SCENARIOS = 3, 15.0, 2",
    ),
    "diagnose": Case(("diagnose s --json",)),
    "doctor": Case(("doctor --port BENCH --seconds 2 --json",)),
    "effects": Case(("effects", "effects warmup --json")),
    "explain": Case(("explain s --model e.toml --json",), ("e.toml",)),
    "export": Case((f"export --model {MODEL}",), ("export",)),
    "firmware": Case(("firmware project",), ("project",)),
    "fleet": Case(("fleet fit boards --workers 2",), ("boards.fleet",), FONTS, serves=True),
    "import": Case(("import swing.csv.gz lab --yes --preview lab.png",), ("lab", "lab.png"), FONTS),
    "info": Case(("info s --json", "info swing.csv.gz", f"info {MODEL}")),
    "keep": Case(("keep saw --model k.toml",), ("k.toml",)),
    "monitor": Case(("monitor --port PORT --json",)),
    "plan": Case(("plan s --out plan.toml --json",), ("plan.toml",)),
    "plot": Case(("plot s s.png",), ("s.png",), FONTS),
    "record": Case(("record recorded --port PORT --follow --json",), ("recorded",)),
    "simulate": Case(("simulate new --scenarios 1 --seconds 4",), ("new", "new.truth.json")),
    "train": Case(("train s --epochs 1", "export --run runs/paper-0"), ("runs", "export"), alone=True),
    "schema": Case(("schema compare",)),
    "version": Case(("version",)),
    "wifi": Case(("wifi --port BOARD --join lab --json",), serves=True),
    "verify": Case(("verify --windows 60",), (), CORE),
}
ENDS_WITH_THE_DEVICE = 3
A_CHECK_FAILED = 1
"""Of ``doctor``, on a machine that is too busy to read all samples."""
PORTS = {"PORT", "BENCH", "BOARD"}


def processes() -> dict[str, list[str]]:
    """The verbs of each process, by their names."""
    together: dict[object, list[str]] = {}
    for verb, case in CASES.items():
        alone = case.alone or case.serves or PORTS & {word for line in case.lines for word in line.split()}
        together.setdefault(verb if alone else case.keeps, []).append(verb)
    return {"-".join(verbs): verbs for verbs in together.values()}


PROCESSES = processes()
LONG = ("demo", "train", "fleet")


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the commands read: a session of a table, one with a sawtooth that no effect explains, three boards, a log."""
    root = tmp_path_factory.mktemp("privacy")
    words = ["--scenarios", "3", "--seconds", "6", "--effect", "table_ripple:amplitude_1=0.003"]
    assert main(["simulate", str(root / "s"), *words]) == 0
    rng, t_s, runs = np.random.default_rng(1), np.arange(1000) / 50, []
    for i, rate_dps in enumerate((40.0, -60.0, 90.0) * 3):
        angle_deg = rng.uniform(0, 360) + rate_dps * t_s
        gyro = rng.normal(0, 0.02, (t_s.size, 3))
        gyro[:, 2] += rate_dps + 0.03 * ((angle_deg / 360) % 1 - 0.5)
        runs.append(make_run(t_s, gyro, table_rate_dps=rate_dps, scenario=f"s{i}", day=1 + i // 3, table_angle_deg=angle_deg))
    make_session(*runs).save(root / "saw")
    for board in range(3):
        shutil.copytree(root / "s", root / "boards" / f"b{board}")
    shutil.copy(SWING, root)
    return root


@pytest.fixture
def watched(watched: Watched, sessions: Path) -> Watched:
    watched.bring(sessions)
    return watched


@pytest.fixture
def port(request: pytest.FixtureRequest, sessions: Path) -> Iterator[str]:
    """The port of a simulated device, where the command line asks for one."""
    lines = CASES[PROCESSES[request.getfixturevalue("process")][0]].lines
    if any("BOARD" in line for line in lines):
        with WifiBoard() as board:
            yield board.port
        return
    bench = any("BENCH" in line for line in lines)
    if not bench and not any("PORT" in line for line in lines):
        yield ""
        return
    with SimulatedDevice(sessions / "s", speed=1 if bench else "max", bench=bench) as device:
        yield device.port


LEAK = """
import os, pathlib, socket
for folder in (pathlib.Path.home(), pathlib.Path(os.environ["TMPDIR"]), pathlib.Path({elsewhere!r})):
    (folder / "left").write_text("")
    (folder / "moved").write_text("")
    (folder / "moved").rename(folder / "kept")
    (folder / "empty").mkdir()
    (folder / "gone").write_text("")
    (folder / "gone").unlink()
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking, socket.socket(socket.AF_INET6) as listening:
    asking.connect(("192.0.2.1", 9))
    asking.connect(("127.0.0.1", 9))
    listening.bind(("::", 0))
    listening.connect_ex(("::1", 9))
"""


def test_a_leak_is_seen(watched: Watched, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    told, _ = watched.start(sys.executable, "-c", LEAK.format(elsewhere=str(elsewhere))).communicate()
    assert told == ""
    folders = ("HOME", "TMPDIR", str(elsewhere))
    assert watched.left() == {f"{folder}/{name}" for folder in folders for name in ("left", "kept", "empty")}
    assert watched.sockets() == {"AF_INET IPPROTO_IP", "AF_INET6 IPPROTO_IP"}
    assert sorted(re.findall(r'"([\d.:]+)"', " ".join(sorted(watched.elsewhere())))) == ["192.0.2.1", "::"]


def test_every_verb_is_watched() -> None:
    assert {*CASES, "device", "workbench"} == set(command_modules())


def bring_core(watched: Watched) -> None:
    """The compiled core and device that an earlier command left, which ``verify`` and a changed header compile again."""
    kept = watched.home / ".cache" / "gyrocal"
    kept.mkdir(parents=True, mode=0o700)
    for built in (library.build_core(), library.build_sim()):
        shutil.copy(built, kept)


PROGRAM = """
{smaller}
import contextlib, sys
from gyrocal.cli import main
known = contextlib.nullcontext
if len({lines}) > 1:
    sys.path.append({tests!r})
    from known import known_answers as known
with known():
    for words in {lines}:
        code = main(words)
        if code:
            print(*words)
            raise SystemExit(code)
"""
"""Verbs that ask the same of one session compute it once, by the first of them."""


@pytest.mark.parametrize(
    "process", [pytest.param(first, marks=[pytest.mark.wide] * (first in LONG)) for first in PROCESSES]
)
def test_verbs(
    process: str, watched: Watched, port: str, require_tool: Callable[[str], str], require_module: Callable[[str], None]
) -> None:
    verbs = PROCESSES[process]
    first, cases = verbs[0], [CASES[verb] for verb in verbs]
    if CORE[0] in cases[0].keeps:
        require_tool("cc")
    if first == "demo":
        bring_core(watched)
    for module in {"fleet": ["distributed"], "train": ["torch", "onnx"]}.get(first, []):
        require_module(module)
    lines = [[port if word in PORTS else word for word in line.split()] for case in cases for line in case.lines]
    started = watched.start(sys.executable, "-c", PROGRAM.format(smaller=cases[0].smaller, lines=lines, tests=str(HERE)))
    told, _ = started.communicate(timeout=300)
    expected = {"doctor": (0, A_CHECK_FAILED), "wifi": (0,)}.get(first, (0, ENDS_WITH_THE_DEVICE) if port else (0,))
    assert started.returncode in expected, told
    watched.check([name for case in cases for name in case.makes], cases[0].keeps, serves=cases[0].serves)


def test_the_simulated_device(watched: Watched, require_tool: Callable[[str], str]) -> None:
    require_tool("cc")
    bring_core(watched)
    for options in ([], ["--tcp", "127.0.0.1:0"]):
        process = watched.gyrocal("device", "--session", "s", "--speed", "max", *options)
        assert process.stdout is not None
        assert main(["monitor", "--port", process.stdout.readline().strip(), "--json"]) == 0
        assert process.wait(60) == 0
        watched.check((), CORE, serves=bool(options))
