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
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.real_corrected import CORRECTED
from benchmarks.real_facts import Fact, close, named_on, said, saved, saved_runs, value, words
from benchmarks.real_gravity import xsens
from benchmarks.real_truth import body_rate_dps, lines_hz, map_fit, swing_fit

from gyrocal.calibration.calibrate import calibrate
from gyrocal.diagnosis.answer.explain import Explanation, explain
from gyrocal.plausibility import check
from gyrocal.present.output import stdout, table
from gyrocal.recording.session import AXES, Array, Session

REALDATA = Path(os.environ.get("GYROCAL_REALDATA") or Path(__file__).parents[2] / "shared" / "realdata")
G_M_S2 = 9.80665


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
        f"readings at 40 °C differ by {loop:.2f} dps between passes", "numpy", "thermal_hysteresis" in on_x,
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
        lines = lines_hz(gyro[:, i], 100.0)
        told = told_lines_hz(found, a)
        same = len(told) == len(lines) and all(min(abs(f - t) for t in told) < 0.05 for f in lines)
        yield said(
            "MPU-6050 at rest", f"lines in the spectrum of {a}, Hz", spoken(told), spoken(lines), "periodogram in numpy", same
        )
    other = sorted({i for a in AXES for i in named_on(found, a)} - {"vibration_tone", "drift", "warmup", "colored_noise"})
    yield said("MPU-6050 at rest", "no effect of a turntable or of the reading", words(other), "nothing", "at rest", not other)


def told_lines_hz(found: Explanation, axis: str) -> list[float]:
    """Frequencies of the tones that gyrocal added on an axis, and of the lines that it finds with the final model."""
    tones = [t.values["f_hz"] for t in found.model.on(axis) if t.effect_id == "vibration_tone"]
    bands = [f.band_hz for f in found.last.comparison.where if f.axis == axis and f.band_hz is not None]
    return sorted([*tones, *(low for low, high in bands if low == high)])


def spoken(lines: list[float]) -> str:
    return ", ".join(f"{f:.2f}" for f in lines) or "none"


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
    yield from three_axes(raw, work / "three")


def three_axes(raw: Any, work: Path) -> Iterator[Fact]:
    """A minute of the same recording with the whole orientation as reference, which has a clock of its own."""
    name, rate_hz, rows = "motion capture, three axes", float(raw["fs"]), slice(17000, 34000)
    gyro, quaternion = np.rad2deg(raw["gyr_rad_s"][rows]), raw["opt_quat"][rows]
    t_s = np.arange(len(gyro)) / rate_hz
    work.mkdir(parents=True)
    columns = {"t_s": t_s, **{f"g{a}_dps": gyro[:, i] for i, a in enumerate(AXES)}}
    columns |= {f"ref_q{a}": quaternion[:, i] for i, a in enumerate("wxyz")}
    pl.DataFrame(columns).fill_nan(None).write_csv(work / "run.csv")
    head = f'format = "gyrocal-session/1"\naxis = "z"\nsample_rate_hz = {rate_hz:.6f}\n[reference]\nclock = "own"\n'
    (work / "session.toml").write_text(f'{head}[[run]]\nfile = "run.csv"\nface = "up"\nscenario = "s000"\n')
    ref, half = body_rate_dps(quaternion, rate_hz), len(t_s) // 2
    fitted = map_fit(t_s, gyro, ref)
    halves = [map_fit(t_s[:half], gyro[p], ref[p]).scales for p in (slice(0, half), slice(half, 2 * half))]
    within = float(np.abs(halves[0] - halves[1]).max())
    found = explain(Session.open(work), most_steps=4)
    for i, a in enumerate(AXES):
        ours = value(found, "scale", a, "scale")
        yield close(name, f"scale of {a}", ours, float(fitted.scales[i]), within, "least squares in numpy and its halves")
    ours = found.last.comparison.fit.session.runs[0].registration.offset_s
    yield close(name, "offset of the clocks, s", ours, fitted.offset_s, 0.0005, "least squares in numpy")


RECORDINGS: dict[str, tuple[str, Callable[[Path, Path], Iterator[Fact]]]] = {
    "chamber": ("thermal_chamber_imu", chamber),
    "Ferraris": ("nilspod_ferraris_360", ferraris),
    "MPU-6050 at rest": ("mpu6050_multipose_tedaldi", mpu_static),
    "stepper": ("mpu6050_encoder_stepper", stepper),
    "motion capture": ("broad_optical_ref", broad),
    "Xsens MTi": ("xsens_mti_multipose_imutk", xsens),
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
            if name in CORRECTED:
                facts += CORRECTED[name](REALDATA / folder, Path(work) / "corrected")
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
