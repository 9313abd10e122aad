"""What the device says of each fault at random times, and whether anything wrong is reported as right.

Each case is a sensor of ``soak.py``: two power cycles of a pair of runs. The first table has one fault in each case, at a
random time and of a random length as ``gyrocal device --faults random:SEED`` draws them; a lasting one does not end. A fault
touches a case if the samples of its runs, or the lines that arrive, differ from those without the fault. The second table has
the faults of ``--faults random:SEED`` together. ``--small`` makes two other tables: faults of the reading by their length, and
tables that are off their stated rate by up to the fault ``table_off``, in both runs of each pair or in the first one alone.

    python benchmarks/faults.py [--each 20] [--seeds 200]
    python benchmarks/faults.py --small [--each 20]
"""

from __future__ import annotations

import argparse
import random
import subprocess
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import polars as pl
from soak import Case, case

from gyrocal.device.faults import LASTING, LATEST_S, LONGEST_S, OF_FIFO, SHORTEST_S, fault_names
from gyrocal.device.rows import rows_file
from gyrocal.device.wire import Reader, Sentence
from gyrocal.recording.session import Run

OF_READING = {"repeated": "repeated", "stuck_bit": "stuck_bit"}
LENGTHS_S = (0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0)
FRACTIONS = (0.01, 0.02, 0.04, 0.08, 0.12, 0.16, 0.2)


@dataclass(frozen=True)
class Heard:
    """What came of one case: its sentences by power cycle, and what the reader of the lines counted."""

    cycles: list[list[Sentence]]
    bad: int
    lost: int

    @staticmethod
    def of(case: Case, rows: Path, faults: Sequence[str]) -> Heard:
        done = subprocess.run(case.command(rows, faults), stdin=subprocess.DEVNULL, capture_output=True, check=True)
        reader = Reader()
        cycles: list[list[Sentence]] = []
        for sentence in reader.feed(done.stdout):
            if not cycles or (sentence.tag == "HEL" and sentence.seq == 0):
                cycles.append([])
            cycles[-1].append(sentence)
        return Heard(cycles, reader.bad, reader.lost)

    def samples(self, cycle: int) -> list[tuple[int, str]]:
        """The samples of the runs of a power cycle: time since the first one, us, and counts."""
        raw = [s for s in self.cycles[cycle] if s.tag == "RAW" and not s.text.startswith("-")]
        return [(s.t_us - raw[0].t_us, s.text) for s in raw]

    def answers(self, cycle: int) -> list[Sentence]:
        return [s for s in self.cycles[cycle] if s.tag == "CAL"]

    @property
    def trusted(self) -> list[Sentence]:
        return [s for k in range(len(self.cycles)) for s in self.answers(k) if s.fields["trusted"] == "1"]

    @property
    def said(self) -> Counter[str]:
        """How often each error and each flag was said, and what the reader of the lines tells."""
        every = [s for cycle in self.cycles for s in cycle]
        said = Counter(s.fields["name"] for s in every if s.tag == "ERR")
        said.update(flag for s in every if s.tag == "CAL" for flag in s.fields["flags"].split("+") if flag)
        return said + Counter(line_damaged=self.bad, samples_lost=self.lost)

    def says_beyond(self, sound: Heard) -> set[str]:
        """What is said more often than without the fault."""
        restarted = {"device restarted"} if len(self.cycles) > len(sound.cycles) else set()
        return {*(self.said - sound.said), *restarted}

    def differs(self, other: Heard) -> bool:
        same = len(self.cycles) == len(other.cycles) and (self.bad, self.lost) == (other.bad, other.lost)
        return not same or any(self.samples(k) != other.samples(k) for k in range(len(self.cycles)))


def content(answer: Sentence) -> dict[str, str]:
    """The answer without the sample numbers since power-on, which also count samples between the runs."""
    return {name: value for name, value in answer.fields.items() if name not in ("first", "last")}


def one_fault(name: str, draw: random.Random) -> str:
    """A lasting fault from a random time on; a passing one for a random time."""
    at_s = draw.uniform(0.0, LATEST_S)
    return f"{name}@{at_s:.2f}" if name in LASTING else f"{name}@{at_s:.2f}:{draw.uniform(SHORTEST_S, LONGEST_S):.2f}"


def each(times: int) -> None:
    """Print a row for each fault: what was said, how often nothing was, and wrong trusted answers."""
    print("| Fault | Cases | Touched | Said nothing | Trusted | Of them wrong | Said (cases) |")
    print("|---|---:|---:|---:|---:|---:|---|")
    for name in fault_names():
        said: Counter[str] = Counter()
        touched = silent = trusted = wrong = 0
        for k in range(times):
            drawn = case(3 * k + 1 if name == OF_FIFO else k)
            draw = random.Random(f"{name} {k}")
            with rows_file(drawn.session) as rows:
                sound, heard = Heard.of(drawn, rows, []), Heard.of(drawn, rows, [one_fault(name, draw)])
            if heard.differs(sound):
                new = heard.says_beyond(sound)
                said.update(new)
                touched, silent = touched + 1, silent + (not new)
            trusted += len(heard.trusted)
            wrong += sum(map(drawn.is_wrong, heard.trusted))
        words = ", ".join(f"{word} {count}" for word, count in said.most_common())
        print(f"| `{name}` | {times} | {touched} | {silent} | {trusted} | {wrong} | {words} |", flush=True)


def together(seeds: int) -> None:
    """Print the figures of random faults together."""
    drawn_faults = touched = silent = trusted = wrong = untouched = again = 0
    for seed in range(seeds):
        drawn = case(seed)
        with rows_file(drawn.session) as rows:
            sound, heard = Heard.of(drawn, rows, []), Heard.of(drawn, rows, drawn.faults)
        drawn_faults += len(drawn.faults)
        touched += heard.differs(sound)
        silent += heard.differs(sound) and not heard.says_beyond(sound)
        trusted += len(heard.trusted)
        wrong += sum(map(drawn.is_wrong, heard.trusted))
        if len(heard.cycles) == len(sound.cycles) and heard.samples(-1) == sound.samples(-1):
            untouched += 1
            again += [content(a) for a in heard.answers(-1)] == [content(a) for a in sound.answers(-1)]
    print("| Figure | |\n|---|---:|")
    for what, value in (
        ("seeds", seeds), ("faults drawn", drawn_faults), ("seeds in which a fault touches a run", touched),
        ("of them said nothing", silent), ("trusted answers", trusted), ("of them wrong", wrong),
        ("seeds whose last power cycle no fault touches", untouched),
        ("of them with the answers of a sound device there", again),
    ):  # fmt: skip
        print(f"| {what} | {value} |")


def by_length(times: int) -> None:
    """Print a row for each fault of the reading and each length: the fault lies within the first run of the first pair."""
    print("| Fault | Length, s | Cases | Named | Said nothing | Trusted | Of them wrong |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    for name, error in OF_READING.items():
        for length_s in LENGTHS_S:
            named = silent = trusted = wrong = 0
            for k in range(times):
                drawn = case(k)
                with rows_file(drawn.session) as rows:
                    sound, heard = Heard.of(drawn, rows, []), Heard.of(drawn, rows, [f"{name}@0.3:{length_s:g}"])
                said = heard.says_beyond(sound)
                named, silent = named + (error in said), silent + (not said)
                trusted += len(heard.trusted)
                wrong += sum(map(drawn.is_wrong, heard.trusted))
            print(f"| `{name}` | {length_s:g} | {times} | {named} | {silent} | {trusted} | {wrong} |", flush=True)


def faster(run: Run, fraction: float) -> Run:
    """The run of a table that turns faster by this fraction of its stated rate."""
    sign = 1.0 if run.face == "up" else -1.0
    return replace(run, frame=run.frame.with_columns(pl.col("gz_dps") + fraction * sign * run.table_rate_dps))


def off_the_table(times: int) -> None:
    """Print a row for each fraction by which the table is off: what was said, and the trusted answers' errors."""
    print("| Off by | In | Cases | `table_rate` | `implausible` | Answers | Trusted | Largest error of scale, of bias (dps) |")
    print("|---:|---|---:|---:|---:|---:|---:|---|")
    for fraction in FRACTIONS:
        for faces in (("up", "down"), ("up",)):
            rate = implausible = answers = 0
            trusted: list[tuple[float, float]] = []
            for k in range(times):
                drawn = case(k)
                runs = [faster(run, fraction * (1 + drawn.scale)) if run.face in faces else run for run in drawn.session.runs]
                with rows_file(replace(drawn.session, runs=tuple(runs))) as rows:
                    heard = Heard.of(drawn, rows, [])
                rate, implausible = rate + ("table_rate" in heard.said), implausible + ("implausible" in heard.said)
                answers += sum(len(heard.answers(c)) for c in range(len(heard.cycles)))
                trusted += [(s.real("scale") - drawn.scale, s.real("bias_dps") - drawn.bias_dps) for s in heard.trusted]
            largest = [max((abs(off[i]) for off in trusted), default=0.0) for i in (0, 1)]
            print(f"| {100 * fraction:g} % | {' and '.join(faces)} | {times} | {rate} | {implausible} | {answers} | "
                  f"{len(trusted)} | {largest[0]:.3f}, {largest[1]:.2f} |", flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, default=20, help="cases of each fault")
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--small", action="store_true", help="short faults, and tables that are off by little")
    chosen = parser.parse_args()
    if chosen.small:
        by_length(chosen.each)
        print()
        off_the_table(chosen.each)
        return
    each(chosen.each)
    print()
    together(chosen.seeds)


if __name__ == "__main__":
    main()
