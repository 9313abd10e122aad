"""Real recordings by others, graded fact by fact.

Each fact is held against a truth that does not come from gyrocal: a least-squares fit in numpy in this file, a figure published
with the recording, or a physical fact. The recordings are not part of the repository. They are looked for in
``../shared/realdata`` beside the checkout, or in the folder that GYROCAL_REALDATA names; a recording that is absent is skipped,
and said so.

    gyrocal benchmark real                            # on the screen
    python benchmarks/real.py                         # the table of docs/real.md
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.calibration.calibrate import calibrate
from gyrocal.diagnosis.explain import Explanation, explain
from gyrocal.plausibility import check
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import AXES, Array, Session

REALDATA = Path(os.environ.get("GYROCAL_REALDATA") or Path(__file__).parents[2] / "shared" / "realdata")
G_M_S2 = 9.80665


@dataclass(frozen=True)
class Fact:
    """What gyrocal says of a recording, and what is true. ``source`` states where the truth comes from."""

    recording: str
    what: str
    ours: str
    truth: str
    source: str
    ok: bool


def close(recording: str, what: str, ours: float | None, truth: float, within: float, source: str) -> Fact:
    """A number that must agree within a tolerance."""
    ok = ours is not None and abs(ours - truth) <= within
    told = "-" if ours is None else f"{ours:.4g}"
    return Fact(recording, what, told, f"{truth:.4g} ± {within:.2g}", source, ok)


def said(recording: str, what: str, ours: str, truth: str, source: str, ok: bool) -> Fact:
    """A statement that must be true."""
    return Fact(recording, what, ours, truth, source, ok)


def named_on(found: Explanation, axis: str) -> list[str]:
    """The effects that gyrocal added or left open on an axis."""
    added = [t.effect_id for t in found.model.on(axis) if t.effect.role is None]
    return [*added, *(i for one in found.left if one.axis == axis for i in one.group)]


def value(found: Explanation, effect: str, axis: str, name: str) -> float | None:
    """A fitted parameter; None if the model does not have it."""
    line = found.model.line(effect, axis)
    return None if line is None else line.values.get(name)


def words(items: list[str]) -> str:
    return ", ".join(items) or "nothing"


def saved(work: Path, t_s: Array, gyro_dps: Array, facts: dict[str, Any], **columns: Array) -> Session:
    """One run as a session folder, as a user would write it: a CSV file and session.toml."""
    lsb_dps = facts.pop("lsb_dps", None)
    return saved_runs(work, t_s, gyro_dps, [("run", slice(None), facts)], lsb_dps=lsb_dps, **columns)


def saved_runs(
    work: Path, t_s: Array, gyro_dps: Array, runs: list[tuple[str, slice, dict[str, Any]]], *, lsb_dps: float | None = None,
    **columns: Array,
) -> Session:  # fmt: skip
    """Runs cut from one recording, each with the facts of its entry in session.toml."""
    work.mkdir(parents=True, exist_ok=True)
    axis = runs[0][2].get("axis", "z") if len(runs) == 1 else "z"
    step_s = (t_s[-1] - t_s[0]) / (t_s.size - 1)
    lines = ['format = "gyrocal-session/1"', f'axis = "{axis}"', f"sample_rate_hz = {1 / step_s:.6f}"]
    lines += [] if lsb_dps is None else [f"lsb_dps = {lsb_dps}"]
    for name, rows, facts in runs:
        table_of_run = {"t_s": t_s[rows] - t_s[rows][0], **{f"g{a}_dps": gyro_dps[rows, i] for i, a in enumerate(AXES)}}
        table_of_run |= {key: column[rows] for key, column in columns.items()}
        pl.DataFrame(table_of_run).write_csv(work / f"{name}.csv")
        facts = {"face": "up", "scenario": "s000", **facts}
        lines += ["[[run]]", f'file = "{name}.csv"']
        lines += [f"{k} = {json.dumps(v)}" for k, v in facts.items()]
    (work / "session.toml").write_text("\n".join(lines) + "\n")
    return Session.open(work)


def chamber(folder: Path, work: Path) -> Iterator[Fact]:
    """At rest in a thermal chamber, -17.6 to 74 degC: y follows a cubic in temperature, x has a hysteresis."""
    raw = pl.read_csv(folder / "imu_raw_data.tsv", separator="\t")
    t_s = (raw["timestamp"] - raw["timestamp"][0]).to_numpy() * 1e-6
    gyro = np.rad2deg(np.column_stack([raw[f"imu.gyro.{a}"].to_numpy() for a in AXES]))
    temp_c = raw["imu.temperature"].to_numpy()
    session = saved(work, t_s, gyro, {"table_rate_dps": 0.0}, temp_c=temp_c)
    warned = [(w.code, w.axis) for w in check(session)]
    off_x = abs(gyro[0, 0] - np.median(gyro[1:20, 0])) / np.std(np.diff(gyro[1:200, 0]))
    yield said(
        "chamber", "the first reading of x stands off", words([f"{c} on {a}" for c, a in warned]),
        f"{off_x:.0f} standard deviations off what follows", "numpy", ("first_sample", "x") in warned,
    )  # fmt: skip
    found = explain(session)
    u = (temp_c - temp_c.mean()) / np.ptp(temp_c)
    cubic = gyro[:, 1] - np.polyval(np.polyfit(u, gyro[:, 1], 3), u)
    yield said(
        "chamber", "y depends on temperature", words(named_on(found, "y")), "bias_temperature", "cubic in numpy",
        "bias_temperature" in named_on(found, "y"),
    )  # fmt: skip
    rms = found.last.comparison.per_axis["y"].rms_dps
    truth = float(np.std(cubic))
    yield said(
        "chamber", "rms left on y, dps", f"{rms or 0:.3f}", f"at most {1.5 * truth:.3f} (cubic in sample: {truth:.3f})",
        "cubic in numpy", rms is not None and rms <= 1.5 * truth,
    )  # fmt: skip
    loop = hysteresis_dps(gyro[:, 0], temp_c, 40.0)
    unknown = found.last.unknown or {}
    on_x = [*named_on(found, "x"), *([f"unknown against {unknown['against']}"] if unknown.get("axis") == "x" else [])]
    yield said(
        "chamber", "x depends on where the temperature comes from", words(on_x),
        f"readings at 40 degC differ by {loop:.2f} dps between passes", "numpy", "thermal_hysteresis" in on_x,
    )  # fmt: skip
    before, after = (d.comparison.per_axis["x"].excess_dps or 0.0 for d in (found.first, found.last))
    yield said(
        "chamber", "excess of x falls, dps", f"{before:.3f} to {after:.3f}", "by half", "physical effects", after < 0.5 * before
    )
    yield said("chamber", "nothing but temperature on y", words(named_on(found, "y")), "bias_temperature", "cubic in numpy",
               set(named_on(found, "y")) <= {"bias_temperature", "thermal_hysteresis"})  # fmt: skip
    physical = {"bias_temperature", "thermal_lag", "thermal_hysteresis", "drift", "warmup"}
    other = sorted({i for a in AXES for i in named_on(found, a)} - physical)
    yield said("chamber", "no effect of a turntable or of the reading", words(other), "nothing", "at rest", not other)


def hysteresis_dps(reading_dps: Array, temp_c: Array, at_c: float) -> float:
    """Spread of the mean readings within 1 degC of a temperature over the passes through it."""
    near = np.abs(temp_c - at_c) < 1.0
    edges = np.flatnonzero(np.diff(near.astype(int)))
    passes = [p for p in np.split(np.arange(temp_c.size), edges + 1) if near[p[0]]]
    means = [float(reading_dps[p].mean()) for p in passes]
    return max(means) - min(means)


def ferraris(folder: Path, work: Path) -> Iterator[Fact]:
    """Six rests and a turn of 360 degrees about each axis by hand."""
    raw = pl.read_csv(folder / "example_ferraris_session.csv")
    parts = json.loads((folder / "example_ferraris_session_list.json").read_text())
    gyro = np.column_stack([raw[f"gyr_{a}"].to_numpy() for a in AXES])
    acc = np.column_stack([raw[f"acc_{a}"].to_numpy() for a in AXES]) / G_M_S2
    rate_hz = 102.4
    runs = []
    for name, part in parts.items():
        rows = slice(part["start"], part["end"])
        fact: dict[str, Any] = {"axis": name[0], "face": "down" if name.endswith("_a") else "up"}
        fact |= {"turn_deg": -360.0} if name.endswith("_rot") else {"table_rate_dps": 0.0}
        runs.append((name, rows, fact))
    columns = {f"a{a}_g": acc[:, i] for i, a in enumerate(AXES)}
    session = saved_runs(work, np.arange(len(raw)) / rate_hz, gyro, runs, **columns)
    rest = np.concatenate([gyro[rows] for name, rows, _ in runs if not name.endswith("_rot")]).mean(axis=0)
    turned = {
        name[0]: np.trapezoid(gyro[rows] - rest, dx=1 / rate_hz, axis=0) for name, rows, _ in runs if name.endswith("_rot")
    }
    answers = {e.axis: e for e in calibrate(session, methods=["model"])}
    for i, a in enumerate(AXES):
        truth = float(-turned[a][i] / 360.0 - 1)
        yield close("Ferraris", f"scale of {a}", answers[a].scale, truth, 0.001, "integral in numpy")
        yield close("Ferraris", f"bias of {a}, dps", answers[a].bias_dps, float(rest[i]), 0.006, "mean at rest in numpy")
    found = explain(session)
    leak = float(-turned["x"][2] / 360.0)
    on_z = [c for c in found.last.candidates if c.effect.id == "misalignment" and c.axis == "z"]
    ours = value(found, "misalignment", "z", "m_x") or next((c.values.get("m_x") for c in on_z), None)
    yield close("Ferraris", "leak of a turn about x into z", ours, leak, 0.002, "integral in numpy")
    proven = "misalignment" in [t.effect_id for t in found.model.on("z")]
    told = [one.next_measurement for one in found.left if one.axis == "z" and one.group == ("misalignment",)]
    yield said(
        "Ferraris", "one turn about each axis can prove no leak", "added" if proven else words(told) or "left without a word",
        "left, with what to record", "nothing can be left out", bool(told) and not proven,
    )  # fmt: skip
    g = [a for a in AXES if "g_sensitivity" in named_on(found, a)]
    yield said("Ferraris", "no g-sensitivity", words(g), "nothing (at most 0.006 dps/g)", "published with the recording", not g)
    other = sorted({i for a in AXES for i in named_on(found, a)} - {"misalignment", "scale_nonlinearity", "scale_asymmetry"})
    yield said("Ferraris", "no transient, tone or fault of the reading", words(other), "nothing", "rests and turns", not other)


def mpu_static(folder: Path, work: Path) -> Iterator[Fact]:
    """449 s of an MPU-6050 at rest, raw counts."""
    text = (folder / "example_data_tinit_calc.csv").read_text()
    raw = pl.read_csv(text[text.index("ax,") :].encode())
    gyro = np.column_stack([raw[f"g{a}"].to_numpy() for a in AXES]) / 131.0
    session = saved(work, np.arange(len(raw)) / 100.0, gyro, {"table_rate_dps": 0.0, "lsb_dps": 1 / 131})
    found = explain(session)
    for i, a in enumerate(AXES):
        truth = float(gyro[:, i].mean())
        yield close("MPU-6050 at rest", f"bias of {a}, dps", value(found, "bias", a, "bias_dps"), truth, 0.01, "mean in numpy")
    for i, a in enumerate(AXES):
        lines = strongest_lines_hz(gyro[:, i], 100.0)
        effects = named_on(found, a)
        spoken = [value(found, "vibration_tone", a, "f_hz")] if "vibration_tone" in effects else []
        unknown = found.last.unknown or {}
        told = bool(spoken) or "order_tone" in effects or (unknown.get("axis") == a and unknown.get("against") == "frequency")
        other = [i for i in effects if i not in ("vibration_tone", "drift", "warmup")]
        yield said(
            "MPU-6050 at rest", f"lines in the spectrum of {a}", words(effects),
            f"lines at {', '.join(f'{f:.2f}' for f in lines)} Hz" if lines else "no line",
            "periodogram in numpy", not other and (told or not spoken) and (bool(lines) or not spoken),
        )  # fmt: skip


def strongest_lines_hz(reading: Array, rate_hz: float, least_ratio: float = 40.0) -> list[float]:
    """Up to three frequencies whose power exceeds the median around them by ``least_ratio``."""
    size = 1 << 13
    pieces = [reading[k : k + size] for k in range(0, reading.size - size + 1, size)]
    window = np.hanning(size)
    power = np.mean([np.abs(np.fft.rfft((p - p.mean()) * window)) ** 2 for p in pieces], axis=0)
    frequency = np.fft.rfftfreq(size, 1 / rate_hz)
    level = np.array([np.median(power[max(0, k - 100) : k + 101]) for k in range(power.size)])
    ratio = np.where((frequency > 1.0) & (frequency < 0.49 * rate_hz), power / level, 0.0)
    lines: list[float] = []
    for k in np.argsort(-ratio)[:60]:
        if ratio[k] > least_ratio and all(abs(frequency[k] - f) > 0.2 for f in lines) and len(lines) < 3:
            lines.append(float(frequency[k]))
    return lines


def stepper(folder: Path, work: Path) -> Iterator[Fact]:
    """300 s of a sensor on a stepper's shaft with an encoder, and a second sensor at rest beside it.

    The shaft shakes at 12.8 Hz, so that its rate is the plain difference of the angles: a smoothed one would lack the shaking.
    """
    import scipy.io

    raw = {k: v.ravel() for k, v in scipy.io.loadmat(folder / "raw_pitch_slow.mat").items() if k.startswith("all_")}
    t_s = raw["all_time"] - raw["all_time"][0]
    keep = np.concatenate([[True], np.diff(t_s) > 0]) & (t_s > 30) & (t_s < 330)
    t_s, angle = t_s[keep] - t_s[keep][0], raw["all_encoder"][keep]
    turning = np.column_stack([raw[f"all_gyro_2_{a}"][keep] for a in AXES])
    resting = np.column_stack([raw[f"all_gyro_1_{a}"][keep] for a in AXES])
    rate = np.gradient(angle, t_s)
    session = saved(work / "turning", t_s, turning, {"axis": "y"}, rate_ref_dps=rate, table_angle_deg=angle)
    scale, bias, lag_s = swing_fit(t_s, angle, turning[:, 1])
    found = explain(session)
    source = "integral on the encoder's angle in numpy"
    yield close("stepper, turning", "scale of y", value(found, "scale", "y", "scale"), scale, 0.002, source)
    yield close("stepper, turning", "bias of y, dps", value(found, "bias", "y", "bias_dps"), bias, 0.05, source)
    yield close("stepper, turning", "lag of y, s", value(found, "lag", "y", "tau_s"), lag_s, 0.002, source)
    for other in ("x", "z"):
        i = AXES.index(other)
        leak = float(np.polyfit(rate, turning[:, i], 1)[0])
        ours = value(found, "misalignment", other, "m")
        yield close("stepper, turning", f"leak of the rate into {other}", ours or 0.0, leak, 0.004, "regression in numpy")
    rest = saved(work / "resting", t_s, resting, {"table_rate_dps": 0.0, "axis": "y"})
    quiet = explain(rest)
    still, moving = (float(np.std(resting[np.abs(rate) < 1, 2])), float(np.std(resting[np.abs(rate) > 20, 2])))
    yield said(
        "stepper, resting", "the resting sensor feels the motor", quiet.verdict,
        f"z scatters by {moving:.2f} dps while it turns, {still:.2f} dps while it does not", "numpy",
        quiet.verdict in ("unknown", "ambiguous") or bool(quiet.steps),
    )  # fmt: skip
    physical = sorted({i for a in AXES for i in named_on(quiet, a)} & {"bias_temperature", "misalignment", "drift", "warmup"})
    yield said("stepper, resting", "no thermal effect, no misalignment", words(physical), "nothing", "at rest", not physical)


def swing_fit(t_s: Array, angle_deg: Array, reading_dps: Array) -> tuple[float, float, float]:
    """Scale error, bias (dps) and delay (s) by least squares of the integrated reading on the encoder's angle."""
    turned = np.concatenate([[0.0], np.cumsum(np.diff(t_s) * (reading_dps[1:] + reading_dps[:-1]) / 2)])
    best = (np.inf, 0.0, 0.0, 0.0)
    for lag_s in np.arange(0.0, 0.04, 0.001):
        shifted = np.interp(t_s - lag_s, t_s, angle_deg)
        columns = np.column_stack([shifted, t_s, np.ones_like(t_s)])
        solved, *_ = np.linalg.lstsq(columns, turned, rcond=None)
        rms = float(np.std(turned - columns @ solved))
        if rms < best[0]:
            best = (rms, float(solved[0] - 1), float(solved[1]), float(lag_s))
    return best[1:]


def broad(folder: Path, work: Path) -> Iterator[Fact]:
    """A hand-held sensor with optical motion capture: the body's rate about z from the reference's quaternions."""
    raw = np.load(folder / "01_undisturbed_slow_rotation_A.npz")
    rate_hz = float(raw["fs"])
    gyro = np.rad2deg(raw["gyr_rad_s"])
    body = body_rate_dps(raw["opt_quat"], rate_hz)
    good = np.isfinite(body).all(axis=1)
    first, last = np.flatnonzero(good)[[0, -1]]
    rows = slice(first, last + 1)
    ref = np.column_stack([np.interp(np.arange(len(body)), np.flatnonzero(good), body[good, i]) for i in range(3)])[rows]
    t_s, gyro = np.arange(last + 1 - first) / rate_hz, gyro[rows]
    session = saved(work, t_s, gyro, {"axis": "z"}, rate_ref_dps=ref[:, 2])
    design = np.column_stack([ref, np.ones(len(ref))])
    lagged = np.column_stack([np.interp(t_s - 0.0042, t_s, ref[:, i]) for i in range(3)])
    design[:, :3] = lagged
    matrix = np.linalg.lstsq(design, gyro, rcond=None)[0]
    found = explain(session, most_steps=4)
    z = value(found, "scale", "z", "scale")
    yield close("motion capture", "scale of z", z, float(matrix[2, 2] - 1), 0.003, "least squares in numpy")
    yield close("motion capture", "delay of z, s", value(found, "lag", "z", "tau_s"), 0.0042, 0.001, "own fit, published")
    wrong = sorted({i for a in AXES for i in named_on(found, a)} & {"bias_jumps", "byte_fault", "saturation", "table_ripple"})
    yield said("motion capture", "no jump, no fault of the reading", words(wrong), "nothing", "hand motion", not wrong)


def body_rate_dps(quaternion: Array, rate_hz: float) -> Array:
    """Body rate [n, 3] in deg/s from unit quaternions [n, 4] (w, x, y, z; body to fixed), by symmetric differences."""
    q = quaternion.copy()
    flips = np.cumprod(np.where(np.nansum(q[1:] * q[:-1], axis=1) < 0, -1.0, 1.0))
    q[1:] *= flips[:, None]
    rate = np.full((len(q), 3), np.nan)
    a, b = q[:-2], q[2:]
    w = a[:, 0] * b[:, 0] + np.sum(a[:, 1:] * b[:, 1:], axis=1)
    v = a[:, :1] * b[:, 1:] - b[:, :1] * a[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    size = np.linalg.norm(v, axis=1)
    angle = 2 * np.arctan2(size, w)
    rate[1:-1] = np.rad2deg(v / np.maximum(size, 1e-12)[:, None] * angle[:, None]) * rate_hz / 2
    return rate


RECORDINGS: dict[str, tuple[str, Callable[[Path, Path], Iterator[Fact]]]] = {
    "chamber": ("thermal_chamber_imu", chamber),
    "Ferraris": ("nilspod_ferraris_360", ferraris),
    "MPU-6050 at rest": ("mpu6050_multipose_tedaldi", mpu_static),
    "stepper": ("mpu6050_encoder_stepper", stepper),
    "motion capture": ("broad_optical_ref", broad),
}


def run(sample: bool, progress: Callable[[int, int], None]) -> dict[str, Any]:
    """Grade every recording that is present; ``sample`` grades the first two."""
    import tempfile

    facts: list[Fact] = []
    absent = []
    chosen = list(RECORDINGS.items())[: 2 if sample else None]
    for number, (name, (folder, grade)) in enumerate(chosen):
        progress(number, len(chosen))
        if not (REALDATA / folder).is_dir():
            absent.append(name)
            continue
        with tempfile.TemporaryDirectory() as work:
            facts += grade(REALDATA / folder, Path(work))
    return {"facts": [asdict(f) for f in facts], "true": sum(f.ok for f in facts), "of": len(facts), "absent": absent}


def show(found: dict[str, Any]) -> None:
    rows = [[f["recording"], f["what"], f["ours"], f["truth"], "yes" if f["ok"] else "NO"] for f in found["facts"]]
    table("Recordings by others, fact by fact", ["recording:", "fact:", "gyrocal:", "truth:", "true:"], rows)
    stdout.print(f"{found['true']} of {found['of']} facts true")
    if found["absent"]:
        stdout.print(f"absent: {', '.join(found['absent'])}; GYROCAL_REALDATA names the folder of real recordings")


def markdown(found: dict[str, Any]) -> str:
    """The table of facts for the documentation."""
    lines = ["| recording | fact | gyrocal says | truth | from | true |", "| --- | --- | --- | --- | --- | --- |"]
    keys = ("recording", "what", "ours", "truth", "source")
    lines += ["| " + " | ".join([*(str(f[k]) for k in keys), "yes" if f["ok"] else "**no**"]) + " |" for f in found["facts"]]
    return "\n".join([*lines, "", f"{found['true']} of {found['of']} facts are true."])


if __name__ == "__main__":
    print(markdown(run(False, lambda done, total: None)))
