"""Sessions by hand from tables, and the matrix that their calibration finds."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from gyrocal.gravity.calibrate import Calibration
from gyrocal.recording.header import Reference
from gyrocal.recording.session import AXES, Run, Session


def session_of(table: pl.DataFrame, rate_hz: float = 100.0, **more: Any) -> Session:
    """One run by hand."""
    run = Run(0, "r.csv", "s000", "up", "z", None, None, None, None, rate_hz, frame=table, reference=Reference(kind="gravity"))
    return Session(rate_hz, (run,), reference=Reference(kind="gravity"), **more)


def matrix_of(found: Calibration) -> tuple[np.ndarray, np.ndarray]:
    """The gyroscope's 3x3 matrix of readings, and the standard errors of its elements; NaN where none is given."""
    matrix, se = np.eye(3), np.zeros((3, 3))
    for e in found.estimates:
        i = AXES.index(e.axis)
        matrix[i, i], se[i, i] = (np.nan, np.nan) if e.scale is None or e.scale_se is None else (1 + e.scale, e.scale_se)
    for row in found.to_json()["misalignment"]:
        i, j = AXES.index(row["axis"]), AXES.index(row["about"])
        matrix[i, j], se[i, j] = (np.nan, np.nan) if row["value"] is None else (row["value"], row["se"])
    return matrix, se


def truth_of(truth: dict[str, Any]) -> np.ndarray:
    return np.eye(3) + np.diag(truth["runs"][0]["scale"]) + np.array(truth["misalignment"])


def lower_triangular(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """L and Q with ``matrix = L Q``, Q a rotation: Q takes imu_tk's frame to the one whose x axis the accelerometer keeps."""
    q, r = np.linalg.qr(matrix.T)
    signs = np.sign(np.diag(r))
    return (signs[:, None] * r).T, (q * signs).T


def turned_by(turns: Sequence[tuple[str, float]], up: Sequence[float] = (1.0, 0.0, 0.0), seed: int = 0) -> Session:
    """A perfect sensor with little noise that turns about its axes by (axis, angle in deg), 1 s each, and rests in between."""
    rng = np.random.default_rng(seed)
    phase = np.arange(1, 101) / 100
    rest, smooth = np.zeros((120, 3)), phase - np.sin(2 * np.pi * phase) / (2 * np.pi)
    now = np.array(up, dtype=float)
    rates, ups = [rest], [np.tile(now, (120, 1))]
    for axis, angle_deg in turns:
        about = np.eye(3)[AXES.index(axis)]
        rates += [np.outer(angle_deg * (1 - np.cos(2 * np.pi * phase)), about), rest]
        way = Rotation.from_rotvec(np.outer(-np.deg2rad(angle_deg) * smooth, about)).apply(now)
        now = way[-1]
        ups += [way, np.tile(now, (120, 1))]
    gyro = np.concatenate(rates)
    gyro = gyro + rng.normal(0, 0.01, gyro.shape)
    acc = np.concatenate(ups)
    acc = acc + rng.normal(0, 2e-4, acc.shape)
    columns = {f"g{a}_dps": gyro[:, i] for i, a in enumerate(AXES)} | {f"a{a}_g": acc[:, i] for i, a in enumerate(AXES)}
    return session_of(pl.DataFrame({"t_s": np.arange(len(gyro)) / 100.0, **columns}))
