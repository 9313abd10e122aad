"""Corrected readings of the part of a recording that no fit has seen, held against its reference in numpy.

`explain` reads the first part of a recording by others, `apply` corrects the second, and this file measures the error of the
second: as recorded, corrected, and corrected by least squares in numpy on the first part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from benchmarks.real_facts import Fact, said, saved, saved_runs
from benchmarks.real_gravity import ACC_AXES, Movements, counts, kept_x, saved_by_gravity
from benchmarks.real_truth import Map, body_rate_dps, map_fit, means, swing_fit

from gyrocal.calibration.apply import apply
from gyrocal.diagnosis.answer.explain import explain
from gyrocal.gravity.diagnose import explain as explain_by_gravity
from gyrocal.recording.session import AXES, Array

ROOM = 1.05
"""The corrected error may exceed that of the least squares by this factor."""


@dataclass(frozen=True)
class Held:
    """Errors of readings that no fit has seen: as recorded, corrected by gyrocal, and by least squares in numpy."""

    before: float
    after: float
    own: float

    def fact(self, recording: str, what: str, method: str) -> Fact:
        told, truth = f"{self.before:.3g} to {self.after:.3g}", f"{self.before:.3g} to {self.own:.3g}"
        return said(recording, what, told, truth, method, self.after <= min(self.before, ROOM * self.own))


def corrected(work: Path, found: Any, t_s: Array, gyro_dps: Array, **columns: Array) -> Array:
    """Readings [n, 3], deg/s, after `apply` with the model that `explain` made of other readings."""
    work.mkdir(parents=True, exist_ok=True)
    found.model.save(work / "model.toml")
    table = {"t_s": t_s, **{f"g{a}_dps": gyro_dps[:, i] for i, a in enumerate(AXES)}, **columns}
    pl.DataFrame(table).write_csv(work / "second.csv")
    apply(work / "second.csv", work / "model.toml", work / "corrected.csv")
    return pl.read_csv(work / "corrected.csv").select(f"g{a}_dps" for a in AXES).to_numpy()


def rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def optical(folder: Path, work: Path, number: str, name: str) -> Iterator[Fact]:
    """The first half of a recording by hand with optical orientations gives the model, frame and clock of the second."""
    raw = np.load(next(folder.glob(f"{number}_*.npz")))
    rate_hz, gyro, quaternion = float(raw["fs"]), np.rad2deg(raw["gyr_rad_s"]), raw["opt_quat"]
    t_s, half = np.arange(len(gyro)) / rate_hz, len(gyro) // 2
    columns = {f"ref_q{a}": quaternion[:half, i] for i, a in enumerate("wxyz")}
    session = saved(work / "first", t_s[:half], gyro[:half], {"clock": "own"}, **columns)
    ref = body_rate_dps(quaternion, rate_hz)
    fitted = map_fit(t_s[:half], gyro[:half], ref[:half])
    done = corrected(work, explain(session), t_s[half:], gyro[half:])
    own = (gyro[half:] - fitted.bias_dps) @ np.linalg.inv(fitted.symmetric).T
    errors = [_optical_error(fitted, t_s[half:], reading, ref[half:]) for reading in (gyro[half:], done, own)]
    yield Held(*map(rms, errors)).fact(name, "corrected: means of 0.1 s of the second half, dps", "matrix and bias in numpy")


def _optical_error(fitted: Map, t_s: Array, reading_dps: Array, ref_dps: Array) -> Array:
    known = np.isfinite(ref_dps).all(axis=1)
    truth = np.column_stack([np.interp(t_s - fitted.offset_s, t_s[known], ref_dps[known, i]) for i in range(3)])
    return means(t_s, reading_dps - truth @ fitted.rotation.T, known)


def shaft(folder: Path, work: Path, file: str, name: str) -> Iterator[Fact]:
    """150 s of the stepper's shaft give the model of the next 150 s: its angle, and the leak into x."""
    t_s, angle, gyro = shaft_data(folder / file)
    rate, half = np.gradient(angle, t_s), len(t_s) // 2
    first, second = slice(0, half), slice(half, None)
    session = saved(work / "first", t_s[first], gyro[first], {"axis": "y"}, ref_angle_deg=angle[first])
    done = corrected(work, explain(session), t_s[second], gyro[second])
    scale, bias, lag_s = swing_fit(t_s[first], angle[first], gyro[first, 1])
    own = (gyro[second] - bias) / (1 + scale)
    truth = np.interp(t_s[second] - lag_s, t_s, angle)

    def off_deg(reading: Array) -> float:
        steps = np.diff(t_s[second]) * (reading[1:, 1] + reading[:-1, 1]) / 2
        off = np.concatenate([[0.0], np.cumsum(steps)]) - truth
        return rms(off - off[:1000].mean())

    held = Held(*map(off_deg, (gyro[second], done, own)))
    yield held.fact(name, "corrected: angle of y over the next 150 s, deg", "scale and bias on the angle in numpy")
    for i in (0, 2):
        leak, zero = np.polyfit(rate[first], gyro[first, i], 1)
        known = np.ones(len(rate[second]), dtype=bool)
        plain = [gyro[second, i], done[:, i], gyro[second, i] - leak * own[:, 1] - zero]
        errors = [rms(means(t_s[second], e[:, None], known)) for e in plain]
        yield Held(*errors).fact(name, f"corrected: means of 0.1 s of {AXES[i]}, dps", "regression on the rate in numpy")


def shaft_data(path: Path) -> tuple[Array, Array, Array]:
    """Times, s, angle, deg, and readings [n, 3], dps, of 300 s of the sensor on the shaft."""
    import scipy.io

    raw = {k: v.ravel() for k, v in scipy.io.loadmat(path).items() if k.startswith("all_")}
    t_s = raw["all_time"] - raw["all_time"][0]
    keep = np.concatenate([[True], np.diff(t_s) > 0]) & (t_s > 30) & (t_s < 330)
    return t_s[keep] - t_s[keep][0], raw["all_encoder"][keep], np.column_stack([raw[f"all_gyro_2_{a}"][keep] for a in AXES])


def chamber(folder: Path, work: Path) -> Iterator[Fact]:
    """35 minutes from 52 to -18 to 20 degC give the model of the next 35, which reach 74 degC."""
    raw = pl.read_csv(folder / "imu_raw_data.tsv", separator="\t")
    t_s = (raw["timestamp"] - raw["timestamp"][0]).to_numpy() * 1e-6
    gyro = np.rad2deg(np.column_stack([raw[f"imu.gyro.{a}"].to_numpy() for a in AXES]))
    temp_c, first = raw["imu.temperature"].to_numpy(), t_s < t_s[-1] / 2
    session = saved_runs(work / "first", t_s, gyro, [("run", first, {"table_rate_dps": 0.0})], temp_c=temp_c)
    done = corrected(work, explain(session), t_s[~first], gyro[~first], temp_c=temp_c[~first])
    u = (temp_c - temp_c.mean()) / np.ptp(temp_c)
    for i, a in enumerate(AXES):
        own = gyro[~first, i] - np.polyval(np.polyfit(u[first], gyro[first, i], 3), u[~first])
        held = Held(rms(gyro[~first, i]), rms(done[:, i]), rms(own))
        yield held.fact("chamber", f"corrected: {a} in the second half, dps", "cubic in temperature in numpy")


def by_hand(folder: Path, work: Path) -> Iterator[Fact]:
    """The first half of a recording in the hand gives the model of the second: gravity's direction after each movement."""
    gyro_dps, acc_g, t_s = counts(folder)
    half = len(t_s) // 2
    session = saved_by_gravity(work / "first", t_s[:half], gyro_dps[:half], acc_g[:half])
    done = corrected(work, explain_by_gravity(session), t_s[half:], gyro_dps[half:])
    down = acc_g @ np.linalg.inv(ACC_AXES @ kept_x(ACC_AXES).T).T
    first, second = Movements.of(gyro_dps[:half], down[:half]), Movements.of(gyro_dps[half:], down[half:])
    matrix = first.matrix()
    own = (gyro_dps[half:] - first.bias_dps) @ matrix.T
    errors = [rms(second.errors_deg(reading - second.rest_dps(reading))) for reading in (gyro_dps[half:], done, own)]
    yield Held(*errors).fact("Xsens MTi", "corrected: movements of the second half, deg", "matrix by least squares in numpy")


def _shafts(folder: Path, work: Path) -> Iterator[Fact]:
    yield from shaft(folder, work / "slow", "raw_pitch_slow.mat", "stepper, slow")
    yield from shaft(folder, work / "faster", "raw_pitch_medium.mat", "stepper, faster")


def _optical_ones(folder: Path, work: Path) -> Iterator[Fact]:
    for number, name in (("01", "slow"), ("06", "fast"), ("10", "carried")):
        yield from optical(folder, work / name, number, f"motion capture, {name}")


CORRECTED: dict[str, Callable[[Path, Path], Iterator[Fact]]] = {
    "chamber": chamber, "stepper": _shafts, "motion capture": _optical_ones, "Xsens MTi": by_hand,
}  # fmt: skip
