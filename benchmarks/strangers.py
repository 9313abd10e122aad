"""Public recordings as a stranger has them: whether `import` reads each rightly, or refuses it in one line, fact by fact.

`strangers.toml` lists them. The truth of each fact is taken from the file in `strangers_truth.py`, without gyrocal. The
recordings are not part of the repository: the reader clones the repositories, each into FOLDER/OWNER/NAME at the commit in the
list, and names FOLDER by GYROCAL_STRANGERS. What is absent is skipped, and said so.

    GYROCAL_STRANGERS=FOLDER gyrocal benchmark strangers      # on the screen
    GYROCAL_STRANGERS=FOLDER python benchmarks/strangers.py   # the table of docs/real.md
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.real import markdown
from benchmarks.real_facts import Fact, close, said
from benchmarks.strangers_truth import Recording, Truth, recordings, reference_of, truth_of

from gyrocal.calibration.calibrate import calibrate
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import AXES, Session

SECONDS = 20.0
"""Processor time that one import may take, s."""
ASKED = 2
"""Answers that a reader gives before he gives up."""
SHOWN = 100
"""Characters of an error that the table shows."""
KINDS_WITHOUT = ("rate tables", "encoders", "thermal logs", "hours at rest")
"""Kinds of which no recording with a licence was found that is not in ``benchmark real`` already."""


def imported(one: Recording, lab: Path, options: tuple[str, ...]) -> tuple[subprocess.CompletedProcess[str], float]:
    """What `import` answers, and its processor time, s. Without a reference the part is said to be at rest."""
    facts = ("--reference", str(one.folder / one.reference), "--ref-clock", "own") if one.reference else ("--rate", "0")
    command = [sys.executable, "-m", "gyrocal", "import", str(one.file), str(lab), *one.always, *options, *facts, "--json"]
    before = os.times()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done, os.times().children_user - before.children_user


def graded(one: Recording, work: Path) -> Iterator[Fact]:
    """What `import` says of a recording without options, and with those that its documentation gives where it asks for them."""
    lab = work / "lab"
    done, spent_s = imported(one, lab, ())
    error = _error(one, done)
    told = f"refused: {error[:SHOWN]}" if done.returncode else "read"
    single = "\n" not in error and "Traceback" not in error
    if one.refused is not None:
        yield said(one.name, "it is refused in one line", told, one.refused, "the repository", bool(done.returncode) and single)
        return
    yield said(one.name, "it is read, or one line says what to add", told, "read, or an option named", "the command",
               not done.returncode or (single and "--" in error))  # fmt: skip
    answers: tuple[str, ...] = ()
    for _ in range(ASKED):
        if done.returncode and (answer := _answer(one, error)):
            answers = (*answers, *answer)
            done, spent_s = imported(one, lab, answers)
            error = _error(one, done)
    yield said(one.name, "imported", f"exit {done.returncode} {error[:SHOWN]}", "exit 0", "the command", not done.returncode)
    if not done.returncode:
        yield from _facts(one, truth_of(one), json.loads(done.stdout), lab)
        yield said(one.name, "processor time", f"{spent_s:.1f} s", f"at most {SECONDS:g} s", "measured", spent_s <= SECONDS)


def _error(one: Recording, done: subprocess.CompletedProcess[str]) -> str:
    """The error without the program's name and the file's."""
    return done.stderr.strip().removeprefix("gyrocal: ").replace(f"{one.file}: ", "")


def _answer(one: Recording, error: str) -> tuple[str, ...]:
    """The options that a reader of the documentation adds: the unit by the lines that the error proposes, or the list's."""
    if "Say which it is" not in error:
        return one.options
    lines = shlex.split(error[error.index("--map") : error.rindex(", or :")])
    unit = "dps" if one.units[1] == 1 else "rad/s"
    return tuple(re.sub("(g[xyz]_dps=.*):(?:dps|rad/s)", rf"\1:{unit}", line) for line in lines)


def _facts(one: Recording, truth: Truth, told: dict[str, Any], lab: Path) -> Iterator[Fact]:
    mapped = [g.partition("=")[2] for g in told["guessed"]]
    if mapped and truth.names and "--columns" not in one.options:
        right = all(any(m == name or m.startswith((f"{name}:", f"{name} (")) for m in mapped) for name in truth.names)
        yield said(one.name, "rates are of their columns", "yes" if right else ", ".join(mapped), ", ".join(truth.names),
                   "the repository", right)  # fmt: skip
    duration_s, rates = float(truth.t_s.max()), np.abs(truth.rates_dps)
    largest = float(rates.max())
    run = pl.concat([pl.read_csv(file) for file in sorted(lab.glob("*.csv"))], how="diagonal_relaxed")
    read = run.select(f"g{a}_dps" for a in AXES).to_numpy().astype(float)
    yield close(one.name, "samples", told["rows"], len(truth.t_s), 0, "rows with numbers")
    rate_hz = 1 / truth.step_s
    yield close(one.name, "samples a second", told["sample_rate_hz"], rate_hz, one.rate_within * rate_hz,
                "median of ten steps together")  # fmt: skip
    yield close(one.name, "duration, s", float(run["t_s"].max()), duration_s, 2 * truth.step_s + 0.001 * duration_s,  # type: ignore[arg-type]
                "numpy")  # fmt: skip
    yield close(one.name, "largest rate, dps", float(np.nanmax(np.abs(read))), largest, 1e-3 * largest,
                "numpy, with the repository's unit")  # fmt: skip
    for i, a in enumerate(AXES):
        mean = float(truth.rates_dps[:, i].mean())
        yield close(one.name, f"mean rate of {a}, dps", float(np.nanmean(read[:, i])), mean, 0.002 + 0.005 * abs(mean),
                    "numpy, with the repository's unit")  # fmt: skip
    if truth.acc_g is not None and "ax_g" in run.columns:
        sizes = np.linalg.norm(run.select(f"a{a}_g" for a in AXES).to_numpy().astype(float), axis=1)
        size = float(np.median(np.linalg.norm(truth.acc_g, axis=1)))
        yield close(one.name, "median acceleration, g", float(np.nanmedian(sizes)), size, 0.005 * size,
                    "numpy, with the repository's unit")  # fmt: skip
    codes = {w["code"] for w in told["warnings"]}
    expected = [("an autopilot corrected the rates", "corrected_already", one.corrected, "its topic")]
    if one.reference is None:
        expected.insert(0, ("it is not at rest", "not_at_rest", one.moves or truth.moves, "means and scatter in numpy"))
    for what, code, is_so, source in expected:
        yield said(one.name, what, "told" if code in codes else "not told", "told" if is_so else "not told", source,
                   (code in codes) == is_so)  # fmt: skip
    if one.reference is not None:
        yield from _referred(one, truth, lab)


def _referred(one: Recording, truth: Truth, lab: Path) -> Iterator[Fact]:
    scale, bias_dps = reference_of(one, truth)
    answers = {e.axis: e for e in calibrate(Session.open(lab), methods=["model"])}
    for i, a in enumerate(AXES):
        yield close(one.name, f"scale of {a}", answers[a].scale, float(scale[i]), 0.01, "least squares in numpy")
        yield close(one.name, f"bias of {a}, dps", answers[a].bias_dps, float(bias_dps[i]), 0.1, "least squares in numpy")


def run(sample: bool, progress: Callable[[int, int], None], half: str | None = None) -> dict[str, Any]:
    """Grade every recording that is present; ``sample`` grades the first two, ``half`` those of a half."""
    facts: list[Fact] = []
    absent = []
    chosen = [one for one in recordings() if half is None or one.half == half][: 2 if sample else None]
    for number, one in enumerate(chosen):
        progress(number, len(chosen))
        if not one.file.is_file():
            absent.append(f"{one.repository['name']}/{one.path}")
            continue
        with tempfile.TemporaryDirectory() as work:
            facts += graded(one, Path(work))
    return {
        "facts": [asdict(f) for f in facts], "true": sum(f.ok for f in facts), "of": len(facts), "absent": absent,
        "kinds_without": list(KINDS_WITHOUT),
    }  # fmt: skip


def show(found: dict[str, Any]) -> None:
    rows = [[f["recording"], f["what"], f["ours"], f["truth"], "yes" if f["ok"] else "NO"] for f in found["facts"]]
    table("Recordings of strangers, fact by fact", ["recording:", "fact:", "gyrocal:", "truth:", "true:"], rows)
    stdout.print(f"{found['true']} of {found['of']} facts true")
    if found["absent"]:
        stdout.print(f"absent: {', '.join(found['absent'])}; GYROCAL_STRANGERS names the folder of clones")


if __name__ == "__main__":
    print(markdown(run(False, lambda done, total: None, sys.argv[1] if len(sys.argv) > 1 else None)))
