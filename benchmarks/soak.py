"""`gyrocal benchmark soak`: hours of device time with random faults, and where each sample and each trusted answer went.

Each seed is a sensor of its own: a simulated device with the firmware's C core, two power cycles of a pair of runs, and the
faults of ``gyrocal device --faults random:SEED``. Its port is read by a recorder. Three seeds in four start the board's clock
or the sequence numbers, or both, so that these pass 2^32 during a run. The same device without the faults of its output
(``garbled``, ``buffer_full``) says what was sent and answered: these faults change nothing else.
"""

from __future__ import annotations

import contextlib
import re
import resource
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from scipy.stats import beta

from gyrocal.device.faults import random_faults
from gyrocal.device.port import REPLAY_NOTE, Link, PortGone
from gyrocal.device.record import Recorder, Report
from gyrocal.device.rows import LSB_DPS, rows_file
from gyrocal.device.simulator import Simulator, check_exit, sim_command
from gyrocal.device.wire import Reader, Sentence
from gyrocal.errors import DeviceError
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import AXES, Run, Session

HOURS, SAMPLE_HOURS = 24.0, 0.1
CYCLES, RUN_S = 2, 6.5
STAYS_ON_S = 4.0
"""The board is switched off so long after the last run of a power cycle."""
BOARDS = ((145.0, 0), (104.0, 12), (104.0, 0))
"""Rate in Hz and samples taken from the FIFO at once; 0 without it."""
WHITE_DPS = 0.044
OF_OUTPUT = ("garbled", "buffer_full")
MOST_SE = 5.0
WARM_SEEDS = 50
"""After so many seeds the host's memory is measured first."""
WRAP = 1 << 32


@dataclass(frozen=True)
class Case:
    """One seed: the session that is replayed, its planted truth, and the simulator's options."""

    session: Session
    scale: float
    bias_dps: float
    device_s: float
    fifo: int
    faults: list[str]
    counters: list[str]
    """The simulator's options of clock and sequence."""

    def command(self, rows: Path, faults: Sequence[str]) -> list[str]:
        return [*sim_command(rows, faults=faults, fifo=self.fifo), "--idle", f"{STAYS_ON_S:g}", *self.counters]

    def is_wrong(self, answer: Sentence) -> bool:
        """True if an answer is more than ``MOST_SE`` of its standard errors off, or without a standard error."""
        for name, se, truth in (("scale", "scale_se", self.scale), ("bias_dps", "bias_se_dps", self.bias_dps)):
            value, error = answer.real(name), answer.real(se)
            if value is None or error is None or not abs(value - truth) <= MOST_SE * error:
                return True
        return False


def case(seed: int) -> Case:
    """Draw one seed."""
    rng = np.random.default_rng([seed, 2026])
    rate_hz, fifo = BOARDS[seed % len(BOARDS)]
    scale, bias_dps = rng.normal(0.0, 0.01), rng.normal(0.0, 0.5)
    runs, device_s = [], 0.0
    for cycle in range(CYCLES):
        table_dps, on_s = rng.uniform(30.0, 120.0), rng.uniform(1.0, 3.0)
        for face in ("up", "down"):
            runs.append(_run(rng, len(runs), cycle, face, on_s, rate_hz, table_dps, scale, bias_dps))
            end_s = on_s + RUN_S
            on_s = end_s + rng.uniform(2.0, 5.0)
        device_s += end_s + STAYS_ON_S
    counters = []
    if rng.random() < 0.5:
        counters += ["--clock", str(WRAP - int(1e6 * rng.uniform(2.0, 16.0)))]
    if rng.random() < 0.5:
        counters += ["--seq", str(WRAP - int(rate_hz * rng.uniform(2.0, 16.0)))]
    session = Session(rate_hz, tuple(runs), axis="z", full_scale_dps=250.0, lsb_dps=LSB_DPS[250.0])
    return Case(session, scale, bias_dps, device_s, fifo, random_faults(f"random:{seed}", fifo), counters)


def _run(
    rng: np.random.Generator, number: int, cycle: int, face: Any, on_s: float, rate_hz: float, table_dps: float,
    scale: float, bias_dps: float,
) -> Run:  # fmt: skip
    sign = 1.0 if face == "up" else -1.0
    n = round(RUN_S * rate_hz)
    gyro = rng.normal(0.0, WHITE_DPS, (n, 3))
    gyro[:, 2] += (1.0 + scale) * sign * table_dps + bias_dps
    columns = {"t_s": np.rint(np.arange(n) * 1e6 / rate_hz) * 1e-6} | {f"g{a}_dps": gyro[:, i] for i, a in enumerate(AXES)}
    columns |= {f"a{a}_g": rng.normal(sign * (a == "z"), 0.002, n) for a in AXES} | {"temp_c": rng.normal(25.0, 0.1, n)}
    return Run(
        number, f"{number:03d}_{face}.csv", f"s{cycle:03d}", face, "z", table_dps, None, None, on_s, rate_hz,
        frame=pl.DataFrame(columns), lsb_dps=LSB_DPS[250.0],
    )  # fmt: skip


class SimulatorPort:
    """A simulator's standard input and output as a port."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._first = f"# {REPLAY_NOTE}\n".encode()
        simulator.write(b"hello\n")

    def read(self) -> bytes:
        if self._simulator.ended:
            raise PortGone("soak: the simulated device has ended")
        first, self._first = self._first, b""
        return first + self._simulator.read()

    def write(self, data: bytes) -> None:
        self._simulator.write(data)

    def close(self) -> None:
        """The simulator is ended by its own context."""


@dataclass
class Totals:
    """What became of all samples and trusted answers; ``unaccounted`` and ``wrong`` name their seeds."""

    seeds: int = 0
    device_s: float = 0.0
    sent: int = 0
    kept: int = 0
    left_out: int = 0
    lost: int = 0
    power_cycles: int = 0
    pairs: int = 0
    clock_wraps: int = 0
    sequence_wraps: int = 0
    trusted: int = 0
    unheard: list[dict[str, Any]] = field(default_factory=list)
    """Samples behind the last one of a run whose end did not arrive: the recorder says so and cannot know their number."""
    unaccounted: list[dict[str, Any]] = field(default_factory=list)
    wrong: list[dict[str, Any]] = field(default_factory=list)

    def add(self, seed: int, case: Case, sent: list[Sentence], report: Report) -> None:
        """Add one seed: what its device sent, and what its recorder reports."""
        samples = [s for s in sent if s.tag == "RAW" and not s.text.startswith("-")]
        kept = sum(run.samples for run in report.runs)
        left_out, lost = _warned(report, r"a run of (\d+) samples is left out"), _warned(report, r"^(\d+) of \d+ samples that")
        self.seeds += 1
        self.device_s += case.device_s
        self.sent, self.kept = self.sent + len(samples), self.kept + kept
        self.left_out, self.lost = self.left_out + left_out, self.lost + lost
        self.power_cycles += sum(s.tag == "HEL" and s.seq == 0 for s in sent)
        self.clock_wraps += sum(a.t_us < WRAP <= b.t_us for a, b in pairwise(samples))
        self.sequence_wraps += sum(a.seq == WRAP - 1 and b.seq == 0 for a, b in pairwise(sent))
        unknown = len(samples) - kept - left_out - lost
        if unknown:
            found = self.unheard if _is_behind_unheard_ends(samples, report) else self.unaccounted
            found.append({"seed": seed, "samples": unknown, "faults": case.faults})
        answers = [s for s in sent if s.tag == "CAL" and s.fields["trusted"] == "1"]
        self.trusted += len(answers)
        self.pairs += sum(s.fields["method"] == "baseline" and s.fields["seconds"] == "6" for s in sent if s.tag == "CAL")
        self.wrong += [{"seed": seed, "answer": s.text, "faults": case.faults} for s in answers if case.is_wrong(s)]

    def to_json(self) -> dict[str, Any]:
        bound = float(beta.ppf(0.95, len(self.wrong) + 1, self.trusted - len(self.wrong))) if self.trusted else 1.0
        return vars(self) | {"device_hours": self.device_s / 3600, "wrong_bound": bound}


def _is_behind_unheard_ends(samples: list[Sentence], report: Report) -> bool:
    """True if only runs lack samples of which the recorder says that their end did not arrive."""
    numbers = np.array([int(s.text.partition(",")[0]) for s in samples])
    sent = np.diff(np.flatnonzero(np.diff(numbers, prepend=numbers[0]) <= 0), append=len(numbers))
    if len(sent) != len(report.runs):
        return False
    unheard = {w.file for w in report.warnings if w.code == "run_unannounced" and "end of a run" in w.text}
    lacks = {run.file: n - run.samples - run.lost for run, n in zip(report.runs, sent, strict=True)}
    return all(lack == 0 or (lack > 0 and file in unheard) for file, lack in lacks.items())


def _warned(report: Report, pattern: str) -> int:
    """The sum of the numbers in the warnings that hold ``pattern``."""
    return sum(int(found[1]) for w in report.warnings if (found := re.search(pattern, w.text)))


def _play(case: Case, rows: Path, out: Path) -> tuple[list[Sentence], Report]:
    """What the device of a seed sends, and what a recorder reports of it."""
    inner = [fault for fault in case.faults if not fault.startswith(OF_OUTPUT)]
    done = subprocess.run(case.command(rows, inner), stdin=subprocess.DEVNULL, capture_output=True, check=False)
    check_exit(done.returncode, done.stderr)
    with Simulator(case.command(rows, case.faults), short=True) as simulator:
        port = SimulatorPort(simulator)
        recorder = Recorder(Link("soak", opener=lambda name, baud: port), out, wanted=None)
        with contextlib.suppress(DeviceError):  # the last run was not heard to end; the report says so
            recorder.record()
    return Reader().feed(done.stdout), recorder.report


def peak_mb() -> float:
    """The largest resident size of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def run(sample: bool, progress: Callable[[int, int], None], *, hours: float | None = None, seed: int = 0) -> dict[str, Any]:
    """Return what ``gyrocal benchmark soak --json`` prints. Seeds from ``seed`` on are run until ``hours`` of device time."""
    wanted_s = 3600 * (hours or (SAMPLE_HOURS if sample else HOURS))
    totals, early_mb = Totals(), 0.0
    while totals.device_s < wanted_s:
        number = seed + totals.seeds
        drawn = case(number)
        with tempfile.TemporaryDirectory() as folder, rows_file(drawn.session) as rows:
            sent, report = _play(drawn, rows, Path(folder) / "session")
        totals.add(number, drawn, sent, report)
        if totals.seeds <= WARM_SEEDS:
            early_mb = peak_mb()
        progress(int(totals.device_s), int(wanted_s))
    return totals.to_json() | {"first_seed": seed, "early_peak_mb": early_mb, "peak_mb": peak_mb()}


def show(found: dict[str, Any]) -> None:
    """Print the table, and each sample that is unaccounted for and each wrong answer."""
    rows = [
        ["device time, hours", f"{found['device_hours']:.2f}"],
        ["sensors (seeds)", f"{found['seeds']} from {found['first_seed']} on"],
        ["power cycles", f"{found['power_cycles']}"],
        ["pairs answered at 6 s", f"{found['pairs']}"],
        ["runs that passed 2^32 us", f"{found['clock_wraps']}"],
        ["sequence numbers that wrapped", f"{found['sequence_wraps']}"],
        ["samples sent", f"{found['sent']}"],
        ["kept in sessions", f"{found['kept']}"],
        ["kept in files left out of sessions", f"{found['left_out']}"],
        ["announced as lost", f"{found['lost']}"],
        ["behind an end that did not arrive (announced, not counted)", _of_seeds(found["unheard"])],
        ["unaccounted", _of_seeds(found["unaccounted"])],
        ["trusted answers", f"{found['trusted']}"],
        ["of them wrong by more than 5 se", f"{len(found['wrong'])}, below {100 * found['wrong_bound']:.3g} % (95 %)"],
        [f"peak memory after {WARM_SEEDS} seeds, at the end", f"{found['early_peak_mb']:.1f} MB, {found['peak_mb']:.1f} MB"],
    ]
    table("Soak with random faults", ["figure:", "value"], rows)
    for one in found["unheard"] + found["unaccounted"]:
        stdout.print(f"seed {one['seed']}: {one['samples']} samples; {' '.join(one['faults'])}", markup=False)
    for one in found["wrong"]:
        stdout.print(f"seed {one['seed']}: {one['answer']}; {' '.join(one['faults'])}", markup=False)


def _of_seeds(rows: list[dict[str, Any]]) -> str:
    seeds = f" of {len(rows)} seed{'s' * (len(rows) != 1)}" if rows else ""
    return f"{sum(abs(row['samples']) for row in rows)}{seeds}"
