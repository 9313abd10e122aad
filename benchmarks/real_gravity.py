"""A recording by hand with no reference but gravity, graded by ``benchmarks/real.py`` against its factory's parameters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from benchmarks.real_facts import Fact, close

from gyrocal.gravity.calibrate import calibrate
from gyrocal.recording.session import AXES, Array, Session

COUNTS_PER_RAD_S = np.array([4778.0, 4758.0, 4766.0])
NOMINAL_COUNTS = 4767.0
"""Readings are brought to deg/s by one figure for all axes, so that the factory's scales are errors to be found."""
GYRO_AXES = np.array([[1, -0.01, -0.02], [0, 1, 0.04], [-0.01, 0.01, 1]])
ACC_AXES = np.array([[1, 0, -0.01], [0.01, 1, 0.01], [0.02, 0.01, 1]])
"""The factory's alignments, to two decimals (Tedaldi et al., ICRA 2014)."""
STILL = 2.0
"""Standard deviation of a second at rest over that of the stillest ones."""


def xsens(folder: Path, work: Path) -> Iterator[Fact]:
    """512 s of an Xsens MTi in the hand, raw counts: gravity before and after each movement is the reference."""
    gyro_dps, acc_g, t_s = counts(folder)
    found = calibrate(saved_by_gravity(work, t_s, gyro_dps, acc_g))
    truth = np.diag(COUNTS_PER_RAD_S / NOMINAL_COUNTS) @ GYRO_AXES @ kept_x(ACC_AXES).T
    for i, estimate in enumerate(found.estimates):
        yield close("Xsens MTi", f"scale of {AXES[i]}", estimate.scale, float(truth[i, i] - 1), 0.003, "the factory's scales")
    rows: list[dict[str, Any]] = found.to_json()["misalignment"]
    ours = {(row["axis"], row["about"]): row["value"] for row in rows}
    for i, j in ((1, 2), (0, 2), (2, 0)):
        leak = ours[AXES[i], AXES[j]]
        source = "the factory's alignments, two decimals"
        yield close("Xsens MTi", f"a turn about {AXES[j]} in {AXES[i]}", leak, float(truth[i, j]), 0.01, source)
    for i, estimate in enumerate(found.estimates):
        at_rest = float(still_dps(gyro_dps)[:, i].mean())
        yield close("Xsens MTi", f"bias of {AXES[i]}, dps", estimate.bias_dps, at_rest, 0.03, "mean at rest in numpy")


def counts(folder: Path) -> tuple[Array, Array, Array]:
    """Readings [n, 3], dps, and accelerations [n, 3], g, with the same scale on all axes, and times [n], s."""
    raw = pl.read_csv(folder / "xsens_raw.csv.gz")
    gyro, acc = (np.column_stack([raw[f"{kind}_{a}_cnt"].to_numpy() for a in AXES]).astype(float) for kind in ("gyr", "acc"))
    gyro_dps = np.rad2deg((gyro - [32768, 32466, 32485]) / NOMINAL_COUNTS)
    return gyro_dps, (acc - [33123, 33276, 32360]) / (415 * 9.80665), raw["t_s"].to_numpy()


def saved_by_gravity(work: Path, t_s: Array, gyro_dps: Array, acc_g: Array) -> Session:
    work.mkdir(parents=True, exist_ok=True)
    columns = {f"g{a}_dps": gyro_dps[:, i] for i, a in enumerate(AXES)} | {f"a{a}_g": acc_g[:, i] for i, a in enumerate(AXES)}
    pl.DataFrame({"t_s": t_s - t_s[0], **columns}).write_csv(work / "run.csv")
    head = 'format = "gyrocal-session/1"\naxis = "z"\nsample_rate_hz = 100.0\n[reference]\nkind = "gravity"\n'
    (work / "session.toml").write_text(f'{head}[[run]]\nfile = "run.csv"\nface = "up"\nscenario = "s000"\n')
    return Session.open(work)


def still_dps(gyro_dps: Array) -> Array:
    """Means of the seconds of 100 samples at rest, shape [seconds, 3], deg/s."""
    seconds = gyro_dps[: len(gyro_dps) // 100 * 100].reshape(-1, 100, 3)
    sd = seconds.std(axis=1).max(axis=1)
    return np.asarray(seconds.mean(axis=1)[sd < STILL * np.quantile(sd, 0.05)])


def kept_x(acc_axes: Array) -> Array:
    """The rotation Q of ``acc_axes = L Q``, L lower triangular: it leads to the frame whose x axis the accelerometer keeps."""
    q, r = np.linalg.qr(acc_axes.T)
    return np.asarray((q * np.sign(np.diag(r))).T)


@dataclass(frozen=True)
class Movements:
    """Readings [n, 3], dps, between rests: ``middles`` [r] are samples at rest, ``down`` [r, 3] gravity's directions there."""

    gyro_dps: Array
    still: Array
    middles: Array
    down: Array

    @classmethod
    def of(cls, gyro_dps: Array, acc_g: Array) -> Movements:
        """Rests are two seconds and more whose scatter is that of the stillest ones."""
        seconds = gyro_dps[: len(gyro_dps) // 100 * 100].reshape(-1, 100, 3)
        sd = seconds.std(axis=1).max(axis=1)
        still = sd < STILL * np.quantile(sd, 0.05)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
        rests = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 2]
        down = np.array([acc_g[100 * a : 100 * b].mean(axis=0) for a, b in rests])
        middles = np.array([50 * (a + b) for a, b in rests])
        return cls(gyro_dps, np.repeat(still, 100), middles, down / np.linalg.norm(down, axis=1)[:, None])

    @property
    def bias_dps(self) -> Array:
        return self.rest_dps(self.gyro_dps)

    def rest_dps(self, reading_dps: Array) -> Array:
        """The mean reading [3] at rest, dps."""
        return np.asarray(reading_dps[: self.still.size][self.still].mean(axis=0))

    def errors_deg(self, rate_dps: Array) -> Array:
        """The turned direction of gravity off the measured one after each movement, as vectors [r - 1, 3], deg."""
        from scipy.spatial.transform import Rotation

        out = []
        for first, last, before, after in zip(self.middles, self.middles[1:], self.down, self.down[1:], strict=False):
            turned = before
            steps = np.deg2rad(rate_dps[first:last] + rate_dps[first + 1 : last + 1]) / 200
            for step in Rotation.from_rotvec(-steps).as_matrix():
                turned = step @ turned
            out.append(np.rad2deg(np.cross(turned, after)))
        return np.array(out)

    def matrix(self) -> Array:
        """The matrix [3, 3] that brings the readings without bias to rates, by least squares of these errors."""
        from scipy.optimize import least_squares

        rate = self.gyro_dps - self.bias_dps
        found = least_squares(lambda m: self.errors_deg(rate @ m.reshape(3, 3).T).ravel(), np.eye(3).ravel(), diff_step=1e-4)
        return np.asarray(found.x.reshape(3, 3))
