"""The true rate and, if it changes within runs, its slope."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from gyrocal.effects.base import elapsed_s
from gyrocal.effects.quantities import noise_of_slope_dps, rate_about, rate_slope_dps_s, rate_varies, true_rate_dps
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.variables.base import MOST_STEPS, Symbol, Variable, quantile_edges
from gyrocal.variables.shapes import Columns, Shape, Steps

RESOLUTION = 0.02
"""Finest step of a varying rate, as a fraction of the largest rate."""
NOISES = 4.0
"""The finest step over the noise of one sample of a measured rate: it sorts samples into the steps beside theirs."""
ONE_RATE = 0.1
"""Runs whose rates differ by less than this fraction of the largest rate count as having the same rate."""
TURNS = "in turns about "
"""How a finding in the net angles of turns about other axes begins, which no residual within a run shows."""


class Rate(Variable):
    """The table's rate if it turns about the same axis in all runs, because this may affect any axis.

    Otherwise it is the rate about the axis of the residual.
    """

    name, title, quantity, unit, order = "rate", "Rate", "true rate", "dps", 4
    of_axis = True
    letters = ("w",)
    symbols: ClassVar = {"rate": Symbol("true rate about the axis, dps", rate_about)}
    searched = ("rate",)
    times_rate = False

    @property
    def one_axis(self) -> bool:
        """True if the table turns about the same axis in all runs."""
        return len({r.axis_index for r in self.runs}) == 1

    def values(self, run: Run, axis: int) -> Array:
        return true_rate_dps(run) if self.one_axis else rate_about(run, axis)

    def shapes(self, axis: int) -> list[Shape]:
        edges = self._edges_dps(axis)
        shapes: list[Shape] = (
            [Steps(lambda run: self.values(run, axis), edges, unit=self.unit)] if edges.size else []
        )
        speeds = self._speeds_dps(axis)
        if not edges.size and speeds.size > 1:  # too many rates for steps
            even = "the same in both directions"
            shapes.append(Columns(lambda run: _even(self.values(run, axis), speeds), min(2, speeds.size - 1), even))
        if rate_varies(self.runs, axis):
            words = "in proportion to the change of the rate"
            shapes.append(Columns(lambda run: _slope_dps_s(run, axis), 2, words, "change of the rate, dps/s"))
        if any(r.three_axes for r in self.runs):
            others = [name for name in AXES if name != AXES[axis]]
            words = f"like the rates about {' and '.join(others)}"
            shapes.append(Columns(lambda run: _across_dps(run, others), len(others), words))
        across = sorted({r.axis for r in self.turns if r.axis_index != axis and np.any(r.rate_dps)})
        if across:
            words = f"{TURNS}{' and '.join(across)}"
            shapes.append(Columns(lambda run: _turned_about(run, across), len(across), words))
        return shapes

    def _speeds_dps(self, axis: int) -> Array:
        """The speeds of the runs, as far as they differ, regardless of the direction, deg/s."""
        speeds = np.unique([abs(float(np.mean(self.values(r, axis)))) for r in self.runs])
        return speeds[np.concatenate([[True], np.diff(speeds) > ONE_RATE * speeds[-1]])]

    def _edges_dps(self, axis: int) -> Array:
        """Edges between the rates of the runs, or steps of a varying rate; empty if there are too few or too many, deg/s.

        Scale and bias describe two rates about the axis itself completely. On another axis two rates show what depends on them.
        """
        rates = [self.values(r, axis) for r in self.runs]
        largest = max(float(np.abs(rate).max(initial=0.0)) for rate in rates)
        if self.one_axis and rate_varies(self.runs, self.runs[0].axis_index):
            finest = max(RESOLUTION * largest, NOISES * max(map(noise_of_slope_dps, self.runs)))
            return quantile_edges(np.concatenate(rates), finest, MOST_STEPS)
        means = np.unique([float(np.mean(rate)) for rate in rates])
        apart = np.diff(means) > ONE_RATE * largest
        edges = ((means[1:] + means[:-1]) / 2)[apart]
        least = 2 if any(r.axis_index == axis for r in self.runs) else 1
        return edges if least <= edges.size <= self.steps_between_runs else np.zeros(0)


def _even(rate_dps: Array, speeds_dps: Array) -> Array:
    """What is the same in both directions: speed and, if there are three speeds, its square; shape [n, 1 or 2]."""
    speed = np.abs(rate_dps) / speeds_dps[-1]
    return np.column_stack([speed, speed**2][: speeds_dps.size - 1])


def _slope_dps_s(run: Run, axis: int) -> Array:
    """The slope of the rate, to which a delay is proportional, and slope times time, to which a clock error is proportional."""
    slope = rate_slope_dps_s(run, axis)
    return np.column_stack([slope, slope * elapsed_s(run)])


def _across_dps(run: Run, axes: Sequence[str]) -> Array:
    """The true rates about other axes, shape [n, axes], deg/s; zero unless the reference has three axes."""
    return np.column_stack([true_rate_dps(run.about(axis)) * run.three_axes for axis in axes])


def _turned_about(run: Run, axes: Sequence[str]) -> Array:
    """The mean rate of a turn of known angle in the column of its axis, shape [n, axes], deg/s; zero for other runs."""
    return np.column_stack([run.rate_dps * (run.rate_is_mean and run.axis == axis) for axis in axes])
