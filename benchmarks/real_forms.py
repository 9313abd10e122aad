"""Every verb on every real recording, in each form in which the recording can be a session.

The recordings are those of ``benchmarks/real.py``; an absent one is left out. No figure is graded. What is looked for is an
error that no verb may end in, and verdicts that contradict each other or what stands beside them.

    python benchmarks/real_forms.py                   # whole recordings, some hours; one line for each fault
    python benchmarks/real_forms.py --short           # parts of them, as the tests take them
    python benchmarks/real_forms.py --only optical    # the forms whose names begin so
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.real_gravity import counts
from benchmarks.real_truth import body_rate_dps

from gyrocal.cli import main
from gyrocal.present.verdict import beyond_noise
from gyrocal.recording.session import AXES, Array

REALDATA = Path(os.environ.get("GYROCAL_REALDATA") or Path(__file__).parents[2] / "shared" / "realdata")
G_M_S2 = 9.80665
BESIDE_EXCESS = "adequate beside an excess"

Run = tuple[dict[str, Any], dict[str, Array]]
"""The facts of a run in session.toml, and its columns [n]."""


@dataclass(frozen=True)
class Form:
    """A recording as a session: the head of session.toml, its runs, and its table ``reference``."""

    runs: list[Run]
    head: dict[str, Any] = field(default_factory=dict)
    reference: dict[str, Any] = field(default_factory=dict)

    def save(self, folder: Path) -> Path:
        """Write the session folder and return it."""
        folder.mkdir(parents=True)
        t_s = self.runs[0][1]["t_s"]
        head = {"format": "gyrocal-session/1", "axis": "z", "sample_rate_hz": 1 / float(np.median(np.diff(t_s))), **self.head}
        lines = [*_lines(head), *(["[reference]", *_lines(self.reference)] if self.reference else [])]
        for number, (facts, columns) in enumerate(self.runs):
            name = f"{number:03d}.csv"
            shifted = {**columns, "t_s": columns["t_s"] - columns["t_s"][0]}
            pl.DataFrame(shifted).fill_nan(None).write_csv(folder / name)
            lines += ["[[run]]", *_lines({"file": name, "face": "up", "scenario": "s000", **facts})]
        (folder / "session.toml").write_text("\n".join(lines) + "\n")
        return folder


def _lines(facts: dict[str, Any]) -> list[str]:
    return [f"{key} = {json.dumps(value)}" for key, value in facts.items()]


def columns_of(t_s: Array, gyro_dps: Array, acc_g: Array | None = None, **others: Array) -> dict[str, Array]:
    """The columns of a table: times [n], readings [n, 3], accelerations [n, 3] and others [n]."""
    out = {"t_s": t_s, **{f"g{a}_dps": gyro_dps[:, i] for i, a in enumerate(AXES)}}
    return out | ({} if acc_g is None else {f"a{a}_g": acc_g[:, i] for i, a in enumerate(AXES)}) | others


def cut(columns: dict[str, Array], edges: Sequence[float], order: Sequence[int]) -> list[Run]:
    """Runs of unequal length, each a power cycle, between ``edges`` (fractions of the rows), in another ``order`` of time."""
    rows = np.round(np.asarray(edges) * len(columns["t_s"])).astype(int)
    parts = [{name: c[rows[i] : rows[i + 1]] for name, c in columns.items()} for i in order]
    return [({"scenario": f"s{i:03d}"}, part) for i, part in enumerate(parts)]


def optical(folder: Path, short: bool) -> Iterator[tuple[str, Form]]:
    """Motion capture: the whole orientation, three rates, and one rate in runs of one axis each."""
    numbers = ("01",) if short else ("01", "06", "10")
    for number in numbers:
        raw = np.load(next(folder.glob(f"{number}_*.npz")))
        rows, rate_hz = (slice(17000, 18200) if short else slice(None)), float(raw["fs"])
        gyro, q = np.rad2deg(raw["gyr_rad_s"][rows]), raw["opt_quat"][rows]
        t_s, ref = np.arange(len(gyro)) / rate_hz, body_rate_dps(q, rate_hz)
        own = {"reference": {"clock": "own"}}
        orientation = columns_of(t_s, gyro, **{f"ref_q{a}": q[:, i] for i, a in enumerate("wxyz")})
        rates = columns_of(t_s, gyro, **{f"ref_{a}_dps": ref[:, i] for i, a in enumerate(AXES)})
        of_axis = [columns_of(t_s, gyro, rate_ref_dps=ref[:, i]) for i in range(3)]
        yield f"optical {number}, orientation", Form([({}, orientation)], **own)
        yield f"optical {number}, one run an axis", Form([({"axis": a}, of_axis[i]) for i, a in enumerate(AXES)])
        yield f"optical {number}, z in cuts", Form(cut(of_axis[2], (0.0, 0.2, 0.55, 1.0), (2, 0, 1)))
        if not short:
            yield f"optical {number}, three rates", Form([({}, rates)], **own)
            for i, a in enumerate(AXES):
                yield f"optical {number}, {a} alone", Form([({}, of_axis[i])], {"axis": a})
                yield f"optical {number}, {a} alone, own clock", Form([({}, of_axis[i])], {"axis": a}, {"clock": "own"})


def encoder(folder: Path, short: bool) -> Iterator[tuple[str, Form]]:
    """A shaft with an encoder: its angle, its rate, cuts, and the second sensor, which rests."""
    import scipy.io

    for speed in ("slow",) if short else ("slow", "medium"):
        loaded = scipy.io.loadmat(folder / f"raw_pitch_{speed}.mat")
        raw = {k: v.ravel() for k, v in loaded.items() if k.startswith("all_")}
        t_s = raw["all_time"] - raw["all_time"][0]
        keep = np.concatenate([[True], np.diff(t_s) > 0]) & (t_s > 30) & (t_s < (42 if short else 330))
        t_s, angle = t_s[keep], raw["all_encoder"][keep]
        turning, resting = (np.column_stack([raw[f"all_gyro_{n}_{a}"][keep] for a in AXES]) for n in (2, 1))
        acc = np.column_stack([raw[f"all_accel_2_{a}"][keep] for a in AXES])
        by_angle = columns_of(t_s, turning, acc, ref_angle_deg=angle)
        by_rate = columns_of(t_s, turning, rate_ref_dps=np.gradient(angle, t_s), table_angle_deg=angle)
        on_y = {"axis": "y"}
        yield f"encoder {speed}, angle", Form([({}, by_angle)], on_y)
        yield f"encoder {speed}, rate", Form([({}, by_rate)], on_y)
        if not short:
            yield f"encoder {speed}, angle, own clock", Form([({}, by_angle)], on_y, {"clock": "own"})
            yield f"encoder {speed}, rate in cuts", Form(cut(by_rate, (0.0, 0.15, 0.5, 1.0), (1, 2, 0)), on_y)
        yield f"encoder {speed}, resting", Form([({"table_rate_dps": 0.0}, columns_of(t_s, resting))], on_y)


def tedaldi(folder: Path, short: bool) -> Iterator[tuple[str, Form]]:
    """Raw counts of an MPU-6050: at rest, turned by hand between rests, and turned once by 90 degrees."""
    def read(name: str) -> tuple[Array, Array, Array]:
        text = (folder / name).read_text()
        raw = pl.read_csv(text[text.index("ax,") :].encode())
        gyro, acc = (np.column_stack([raw[f"{kind}{a}"].to_numpy() for a in AXES]) for kind in "ga")
        return np.arange(len(raw)) / 100.0, gyro / 131.0, acc / 16384.0

    lsb = {"lsb_dps": 1 / 131}
    static = columns_of(*(c[:1500] if short else c for c in read("example_data_tinit_calc.csv")))
    yield "MPU-6050, resting", Form([({"table_rate_dps": 0.0}, static)], lsb)
    yield "MPU-6050, gravity", Form([({}, columns_of(*read("example_data_calibration.csv")))], lsb, {"kind": "gravity"})
    turn = columns_of(*read("imu_90_x_rot.csv"))
    if not short:
        cuts = [({**facts, "table_rate_dps": 0.0}, part) for facts, part in cut(static, (0.0, 0.1, 0.4, 1.0), (2, 0, 1))]
        yield "MPU-6050, resting in cuts", Form(cuts, lsb)
        yield "MPU-6050, turn", Form([({"axis": "x", "turn_deg": 90.0}, turn)], {"axis": "x", **lsb})
        yield "MPU-6050, turn by gravity", Form([({}, turn)], lsb, {"kind": "gravity"})


def ferraris(folder: Path, short: bool) -> Iterator[tuple[str, Form]]:
    """Six rests and a turn of 360 degrees about each axis by hand, and the same by gravity."""
    raw = pl.read_csv(folder / "example_ferraris_session.csv")
    parts = json.loads((folder / "example_ferraris_session_list.json").read_text())
    gyro = np.column_stack([raw[f"gyr_{a}"].to_numpy() for a in AXES])
    acc = np.column_stack([raw[f"acc_{a}"].to_numpy() for a in AXES]) / G_M_S2
    whole = columns_of(np.arange(len(raw)) / 102.4, gyro, acc)
    runs = []
    for name, part in parts.items():
        facts = {"axis": name[0], "face": "down" if name.endswith("_a") else "up"}
        facts |= {"turn_deg": -360.0} if name.endswith("_rot") else {"table_rate_dps": 0.0}
        runs.append((facts, {key: c[part["start"] : part["end"]] for key, c in whole.items()}))
    yield "Ferraris, turns", Form(runs)
    if not short:
        yield "Ferraris, gravity", Form([({}, whole)], {}, {"kind": "gravity"})
        yield "Ferraris, turns of three power cycles", Form([({**f, "scenario": f"s{f['axis']}"}, c) for f, c in runs])


def by_hand(folder: Path, short: bool) -> Iterator[tuple[str, Form]]:
    """An Xsens MTi turned by hand between rests."""
    gyro, acc, t_s = counts(folder)
    rows = slice(4000, 14000) if short else slice(None)
    yield "Xsens, gravity", Form([({}, columns_of(t_s[rows], gyro[rows], acc[rows]))], {}, {"kind": "gravity"})
    if not short:
        edges = (0.0, 0.5, 1.0)
        yield "Xsens, gravity in cuts", Form(cut(columns_of(t_s, gyro, acc), edges, (0, 1)), {}, {"kind": "gravity"})


def chamber(folder: Path, short: bool) -> Iterator[tuple[str, Form]]:
    """At rest in a thermal chamber: as one run, and as runs of one power cycle and of several."""
    raw = pl.read_csv(folder / "imu_raw_data.tsv", separator="\t")
    t_s = (raw["timestamp"] - raw["timestamp"][0]).to_numpy() * 1e-6
    gyro, acc = (np.column_stack([raw[f"imu.{kind}.{a}"].to_numpy() for a in AXES]) for kind in ("gyro", "acc"))
    columns = columns_of(t_s, np.rad2deg(gyro), acc / G_M_S2, temp_c=raw["imu.temperature"].to_numpy())
    columns = {name: c[:2500] for name, c in columns.items()} if short else columns
    cycles = [({**facts, "table_rate_dps": 0.0}, part) for facts, part in cut(columns, (0.0, 0.2, 0.5, 1.0), (1, 2, 0))]
    yield "chamber, one run", Form([({"table_rate_dps": 0.0}, columns)])
    if not short:
        yield "chamber, power cycles", Form(cycles)
        yield "chamber, runs of one power cycle", Form([({**facts, "scenario": "s000"}, part) for facts, part in cycles])


RECORDINGS: dict[str, Callable[[Path, bool], Iterator[tuple[str, Form]]]] = {
    "broad_optical_ref": optical, "mpu6050_encoder_stepper": encoder, "mpu6050_multipose_tedaldi": tedaldi,
    "nilspod_ferraris_360": ferraris, "xsens_mti_multipose_imutk": by_hand, "thermal_chamber_imu": chamber,
}  # fmt: skip


def forms(short: bool) -> Iterator[tuple[str, Form]]:
    """Names and sessions of the recordings that are there."""
    for folder, make in RECORDINGS.items():
        if (REALDATA / folder).is_dir():
            yield from make(REALDATA / folder, short)


def called(*words: str | Path) -> tuple[int, str, str]:
    """Exit code, output and errors of a command."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([str(word) for word in words])
    return code, out.getvalue(), err.getvalue()


def faults(form: Form, work: Path, short: bool = False) -> Iterator[str]:
    """What every verb does wrong with a recording in this form, one line each."""
    session, model = form.save(work / "session"), work / "model.toml"
    told: dict[str, Any] = {}
    verbs: list[tuple[str, list[str | Path]]] = [
        ("compare", [session]), ("diagnose", [session]), ("calibrate", [session]),
        ("explain", [session, "--model", model, "--max", "1" if short else "4"]),
        ("compare --as-is", [session, "--as-is", "--model", model]),
        ("apply", [session, "--model", model, "--out", work / "corrected"]),
        ("export", ["--model", model, "--out", work / "export", "--format", "json"]),
    ]  # fmt: skip
    if not short:
        verbs += [
            ("add", ["misalignment", session, "--model", work / "added.toml"]), ("keep", [session, "--model", model]),
            ("plan", [session, "--minutes", "5"]),
        ]  # fmt: skip
    for verb, words in verbs:
        code, out, err = called(verb.split()[0], *words, "--json")
        if code not in (0, 2) or (code == 2 and len(err.strip().splitlines()) != 1):
            yield f"{verb}: exit code {code}, {err.strip() or 'nothing said'}"
        elif code == 0:
            try:
                told[verb] = json.loads(out)
            except ValueError as error:
                yield f"{verb}: no JSON object, {error}"
    yield from contradictions(told, form.head.get("axis", "z"))


def contradictions(told: dict[str, Any], axis: str) -> Iterator[str]:
    """Verdicts that contradict each other, a warning or the figures beside them. ``axis`` is the session's own."""
    pairs = (("adequate", "adequate"), ("implausible", "implausible"))
    if "compare" in told and "diagnose" in told:
        compared, found = told["compare"]["verdict"], told["diagnose"]["verdict"]
        if any((compared == a) != (found == b) for a, b in pairs):
            yield f"compare says {compared}, diagnose {found}"
    for verb, one in told.items():
        blocked = [w["code"] for w in one.get("warnings", []) if w["blocking"] and w["axis"] in (None, axis)]
        if one.get("verdict") == "adequate" and blocked:
            yield f"{verb}: adequate beside the blocking warning {', '.join(blocked)}"
        if one.get("verdict") == "adequate" and "per_axis" in one and (excess := beyond_noise(one)):
            yield f"{verb}: {BESIDE_EXCESS} of {excess}"


def run(only: str, short: bool) -> int:
    """Print the faults of every form as they are found, and return their number."""
    count = 0
    for name, form in forms(short):
        if not name.startswith(only):
            continue
        start_s = time.process_time()
        with tempfile.TemporaryDirectory() as work:
            found = list(faults(form, Path(work), short))
        took_s = time.process_time() - start_s
        print(f"{name}: {took_s:.0f} s of processor, {len(found)} faults", *found, sep="\n    ", flush=True)
        count += len(found)
    return count


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Every verb on every real recording, in each form.")
    parser.add_argument("--short", action="store_true", help="parts of the recordings")
    parser.add_argument("--only", default="", help="forms whose names begin so")
    options = parser.parse_args()
    sys.exit(1 if run(options.only, options.short) else 0)
