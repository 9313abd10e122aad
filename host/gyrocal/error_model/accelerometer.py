"""The accelerometer of a model: its scale, bias and misalignment, as a session by hand determines them.

A reading is ``matrix · true + bias``. The matrix is lower triangular: the accelerometer's x axis is an axis of the frame of the
true acceleration, and its y axis lies in the x-y plane of that. Corrected rates are in the same frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import ArrayLike

from gyrocal.errors import InputError, did_you_mean
from gyrocal.recording.session import AXES, Array

ACCELERATIONS = tuple(f"a{axis}_g" for axis in AXES)
Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]
DIGITS = 9


@dataclass(frozen=True)
class AccelerometerModel:
    """The matrix [3, 3] and the bias [3], g, with standard errors, and the white noise of one sample on each axis, g."""

    matrix: Matrix
    matrix_se: Matrix
    bias_g: Vector
    bias_se_g: Vector
    white_sd_g: Vector

    @staticmethod
    def of(matrix: Array, matrix_se: Array, bias_g: Array, bias_se_g: Array, white_sd_g: Array) -> AccelerometerModel:
        """From matrices [3, 3], biases [3] and noise [3], g, rounded to the digits that a file keeps."""
        bias, bias_se, white = (tuple(map(_rounded, v)) for v in (bias_g, bias_se_g, white_sd_g))
        rows, rows_se = (tuple(tuple(map(_rounded, row)) for row in m) for m in (matrix, matrix_se))
        return AccelerometerModel(rows, rows_se, bias, bias_se, white)

    @property
    def correction(self) -> Array:
        """The matrix [3, 3] by which a reading less the bias is multiplied."""
        return np.asarray(np.linalg.inv(np.array(self.matrix)))

    def correct(self, readings_g: ArrayLike) -> Array:
        """True accelerations from readings, shape [3] or [n, 3], g; NaN where a reading that enters one is NaN."""
        off, matrix = np.asarray(readings_g, float) - self.bias_g, self.correction
        return np.stack([sum(matrix[i, j] * off[..., j] for j in np.flatnonzero(matrix[i])) for i in range(3)], axis=-1)

    def corrected(self, table: pl.DataFrame) -> list[pl.Series]:
        """The corrected columns of a table; none if it lacks one of the three."""
        if not set(ACCELERATIONS) <= set(table.columns):
            return []
        readings = np.column_stack([table[name].cast(pl.Float64).fill_null(math.nan).to_numpy() for name in ACCELERATIONS])
        columns = zip(ACCELERATIONS, self.correct(readings).T, strict=True)
        return [pl.Series(name, values).fill_nan(None) for name, values in columns]

    def to_json(self) -> dict[str, Any]:
        """Scale (fraction), bias (g) and the whole matrix, with standard errors."""
        diagonal, diagonal_se = (np.diag(np.array(m)).tolist() for m in (self.matrix, self.matrix_se))
        return {
            "scale": dict(zip(AXES, [d - 1 for d in diagonal], strict=True)),
            "scale_se": dict(zip(AXES, diagonal_se, strict=True)),
            "bias_g": dict(zip(AXES, self.bias_g, strict=True)), "bias_se_g": dict(zip(AXES, self.bias_se_g, strict=True)),
            "matrix": [list(row) for row in self.matrix], "matrix_se": [list(row) for row in self.matrix_se],
        }  # fmt: skip

    def toml(self) -> list[str]:
        """The lines of a model file."""
        parts = {
            "bias_g": _list(self.bias_g), "bias_se_g": _list(self.bias_se_g), "white_sd_g": _list(self.white_sd_g),
            "matrix": f"[{', '.join(map(_list, self.matrix))}]", "matrix_se": f"[{', '.join(map(_list, self.matrix_se))}]",
        }  # fmt: skip
        about = "# The accelerometer: a reading is matrix · true + bias"
        return [about, f"accelerometer = {{ {', '.join(f'{name} = {text}' for name, text in parts.items())} }}"]


def parsed(raw: Any, where: str) -> AccelerometerModel | None:
    """The key ``accelerometer`` of a model file, None without it. Raises InputError for other content than it may have."""
    if raw is None:
        return None
    names = ("matrix", "matrix_se", "bias_g", "bias_se_g", "white_sd_g")
    if not isinstance(raw, Mapping):
        raise InputError(f"{where}: accelerometer must be a table of {', '.join(names)}")
    strange = next((key for key in raw if key not in names), None)
    if strange is not None:
        raise InputError(f"{where}: accelerometer has no {strange!r}{did_you_mean(strange, names)}; it has {', '.join(names)}")
    found = {
        name: _numbers(raw.get(name, 0.0 if name.endswith(("_se", "_se_g", "sd_g")) else None), name.startswith("matrix"))
        for name in names
    }
    wrong = next((name for name, value in found.items() if value is None), None)
    if wrong is not None:
        shape = "three rows of three numbers" if wrong.startswith("matrix") else "three numbers"
        raise InputError(f"{where}: accelerometer: {wrong} must be {shape}")
    matrix = np.array(found["matrix"])
    if abs(np.linalg.det(matrix)) < 1e-3:
        raise InputError(f"{where}: accelerometer: its matrix cannot be inverted")
    return AccelerometerModel.of(*(np.array(found[name]) for name in names))


def _numbers(value: Any, square: bool) -> Array | None:
    """An array [3] or [3, 3] of finite numbers; a single 0.0 stands for zeros, and None is anything else."""
    shape = (3, 3) if square else (3,)
    try:
        array = np.zeros(shape) if value == 0.0 else np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    return array if array.shape == shape and np.all(np.isfinite(array)) else None


def _rounded(value: float) -> float:
    return float(f"{float(value):.{DIGITS}g}")


def _list(values: Sequence[float]) -> str:
    return f"[{', '.join(repr(v) for v in values)}]"
