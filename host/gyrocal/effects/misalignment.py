"""Cross-axis sensitivity: an axis reads part of the rotation about another axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Case, Effect, Parameter, Values, stack
from gyrocal.effects.quantities import true_rate_dps
from gyrocal.recording.session import AXES, Array, Run

ABOUT = {"m": AXES, **{f"m_{axis}": (axis,) for axis in AXES}}


class Misalignment(Effect):
    id = "misalignment"
    title = "Misalignment of the axes"
    cause = (
        "The sensing axes are not exactly at right angles, or the chip is not mounted square on its board or "
        "on the table. Each axis then reads a fixed fraction of a rotation about another axis. The error shows on the "
        "axes that should read zero. The terms of all axes form the off-diagonal elements of the calibration matrix."
    )
    equation = "m·w, where w is the rate about another axis (m_x, m_y, m_z if the session turns about several)"
    # Against a reference with three axes, a rotation belongs to the alignment, and m_y on x is m_x on y.
    looks_like = "g_sensitivity of that axis, if face and direction of rotation are always changed together"
    measure_next = "both directions of the table with the same face up, or a second rate"
    parameters = tuple(
        Parameter(
            name,
            "fraction",
            (0.001, 0.02),
            "consumer MEMS gyroscopes: cross-axis sensitivity of 1-2 %",
            0.005 if name == "m" else 0.0,
        )
        for name in ABOUT
    )
    linear = tuple(ABOUT)
    acts_on = "others"
    is_gain = True
    cases = (Case({"m": 0.005}, ("m",), "full", "x"),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        needed = "a run in which the table turns about another axis at a known rate or by a known angle"
        return None if self._others(runs, axis) else needed

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        others = self._others(runs, axis) if runs else [name for name in AXES if name != AXES[axis]]
        each = {f"m_{name}": 0.0 for name in others}
        if any(run.three_axes for run in runs):
            return [each]
        return [{"m": 0.0}, each] if len(others) > 1 else [{"m": 0.0}]

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        if run.three_axes:
            return stack(*(_others_dps(run, axis, ABOUT[name]) for name in self.coding.used(values)))
        rate_dps = np.zeros(len(run)) if axis == run.axis_index else true_rate_dps(run)
        return stack(*(rate_dps * (run.axis in ABOUT[name]) for name in self.coding.used(values)))

    def _others(self, runs: Sequence[Run], axis: int) -> list[str]:
        """The other axes about which the table turns. A turn of known angle shows the leak by its mean rate."""
        if any(r.three_axes for r in runs):
            return [name for name in AXES if name != AXES[axis]]
        turning = {r.axis for r in runs if r.axis_index != axis and np.any(r.rate_dps)}
        return sorted(turning)


def _others_dps(run: Run, axis: int, about: Sequence[str]) -> Array:
    """The true rate about the other axes among ``about``, shape [n], deg/s, against a reference with three axes."""
    others = [true_rate_dps(run.about(name)) for name in about if name != AXES[axis]]
    return np.asarray(sum(others, np.zeros(len(run))))
