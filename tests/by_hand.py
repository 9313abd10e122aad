"""Sessions by hand from tables, and the matrix that their calibration finds."""

from typing import Any

import numpy as np
import polars as pl

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
