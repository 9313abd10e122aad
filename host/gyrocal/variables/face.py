"""The face: which way the sensed axis points."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gyrocal.recording.session import Array, Run
from gyrocal.variables.base import Variable
from gyrocal.variables.shapes import Shape


class Face(Variable):
    """+1 in runs face up and -1 in runs face down."""

    name, title, quantity, unit, order = "face", "Face", "face", "up 1, down -1", 10
    letters = ("face",)
    marks: ClassVar = {-1.0: "down", 1.0: "up"}
    no_formula = "it has two values only; a formula in the acceleration describes a difference between faces"

    def values(self, run: Run, axis: int) -> Array:
        return np.full(len(run), run.face_sign)

    def shapes(self, axis: int) -> list[Shape]:
        if len({r.face for r in self.runs}) < 2 or len({r.axis for r in self.runs}) > 1:
            return []
        return self.steps(axis, np.array([0.0]), ("face down", "face up"))
