"""Waves: effects with an amplitude and a phase. The phase differs from run to run unless the session determines it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gyrocal.effects.base import Array, Effect, OfEachRun, Run, Tried, Values, stack, table_angle_rad
from gyrocal.effects.coding import Coding
from gyrocal.effects.mistaken import same_in_each_run
from gyrocal.effects.quantities import LOST_IN_BLOCKS_HZ, TURNING_AT_ALL, unit_wave

ONE_RATE = 0.2
"""Runs whose rates differ by less than this fraction of the largest rate do not show how a size depends on the rate."""


class AmplitudePhase(Coding):
    """The cosine and the sine of waves: each linear parameter is an amplitude, with a phase in degrees at the same place.

    An amplitude is in use if the values contain it and every nonlinear parameter. If the phase differs from run to run, both
    coefficients are random about zero and share one spread.
    """

    parts = ((0.0,), (1.0,))

    def __init__(self, linear: Sequence[str], phases: Sequence[str], nonlinear: Sequence[str]) -> None:
        super().__init__(linear)
        self.phase_of = dict(zip(linear, phases, strict=True))
        self.nonlinear = nonlinear

    def used(self, values: Mapping[str, float]) -> tuple[str, ...]:
        return super().used(values) if all(name in values for name in self.nonlinear) else ()

    def coefficients(self, values: Mapping[str, float]) -> Array:
        phase = {name: np.deg2rad(values.get(self.phase_of[name], 0.0)) for name in self.used(values)}
        return np.array([part for n, p in phase.items() for part in (values[n] * np.cos(p), -values[n] * np.sin(p))])

    def named(self, coefficients: Array, values: Mapping[str, float]) -> Values:
        named: Values = {}
        for name, (a, b) in zip(self.used(values), coefficients.reshape(-1, 2), strict=True):
            named[name] = float(np.hypot(a, b))
            named[self.phase_of[name]] = float(np.rad2deg(np.arctan2(-b, a)))
        return named

    def spread(self, values: Mapping[str, float]) -> Array:
        # At an unknown phase, cosine and sine each carry half of the wave's mean square.
        return np.repeat([values[name] / np.sqrt(2) for name in self.used(values)], 2)

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        return {name: float(sd * np.sqrt(2)) for name, sd in zip(self.used(values), spread[::2], strict=True)}


class Wave(OfEachRun):
    """A sum of ``amplitude·size·cos(angle + phase)``.

    ``linear`` names the amplitudes, and ``phases`` names their phases in degrees in the same order. Each amplitude in use has
    two columns, ``size·cos(angle)`` and ``size·sin(angle)``.
    """

    phases: ClassVar[tuple[str, ...]]
    rate_power: ClassVar[float | None] = None
    """Power of the rate with which the size in deg/s grows, 0 or 1; None if it may be another one in each run."""
    wanders: ClassVar[bool] = False
    """True if the frequency of its source may wander. A wave over the table's angle has no such freedom."""

    @abstractmethod
    def wave(self, run: Run, axis: int, values: Mapping[str, float], name: str) -> NDArray[np.complex128]:
        """``size·exp(i·angle)`` for the amplitude ``name``, shape [n], deg/s per unit of the amplitude."""

    @property
    def coding(self) -> Coding:
        return AmplitudePhase(self.linear, self.phases, self.nonlinear)

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        waves = [self.wave(run, axis, values, name) for name in self.coding.used(values)]
        return stack(*(part for wave in waves for part in (wave.real, wave.imag))) if waves else np.zeros((len(run), 0))


class Tone(Wave):
    """A wave ``A_dps·sin(2π·periods + phase)`` of one size in all runs. Its frequency is the only nonlinear parameter."""

    linear = ("A_dps",)
    phases = ("phase_deg",)
    fast = True

    @abstractmethod
    def periods(self, run: Run, values: Mapping[str, float]) -> Array:
        """Number of periods since the start of the run at each sample, shape [n]."""

    @abstractmethod
    def highest_hz(self, runs: Sequence[Run], values: Mapping[str, float]) -> float:
        """The highest frequency that the tone has in these runs, Hz."""

    def tried_on(self, runs: Sequence[Run], axis: int, line_chance: float) -> Tried:
        """Samples if block means lose the strongest line. Fits to samples and to block means cannot be compared as rivals."""
        if super().tried_on(runs, axis, line_chance) is None:
            return None
        lost = any(self.highest_hz(runs, values) > LOST_IN_BLOCKS_HZ for values in self.variants(runs, axis)[:1])
        return "samples" if lost else "blocks"

    def wave(self, run: Run, axis: int, values: Mapping[str, float], name: str) -> NDArray[np.complex128]:
        """The wave, shape [n]. A sine is a cosine a quarter of a period earlier."""
        return np.asarray(-1j * unit_wave(2 * np.pi * self.periods(run, values)))


LEAST_RUNS = 4
"""Runs whose phases agree by chance in less than one of a hundred sessions."""


class TableWave(Wave):
    """A wave in the angle of the table. Its phase is known if the session has ``table_angle_deg``.

    ``orders`` gives the number of periods per turn for each amplitude.
    """

    uncorrected = "it belongs to the turntable and not to the sensor"
    fixed_by = "table_angle_deg"
    rate_power = 1.0
    orders: ClassVar[tuple[int, ...]]
    needs: ClassVar[str] = TURNING_AT_ALL
    """The requirement on a recording in which the wave can occur, in words."""

    @abstractmethod
    def size(self, run: Run, axis: int) -> Array | float:
        """Size of the wave, shape [n] or one value for all samples, deg/s per unit of its amplitude."""

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        shown = any(not r.rate_is_mean and np.any(self.size(r, axis)) for r in runs)
        return None if shown else self.needs

    def passes_for_it(self, runs: Sequence[Run], axis: int) -> Sequence[Effect]:
        """What is the same in each run: a phase that is free in each of them follows any course of a turn or two."""
        free = [run for run in runs if not run.rate_is_mean and np.any(self.size(run, axis))]
        return same_in_each_run(free) if self.scope_in(runs) == "run" and len(free) >= LEAST_RUNS else []

    def wave(self, run: Run, axis: int, values: Mapping[str, float], name: str) -> NDArray[np.complex128]:
        turned = unit_wave(table_angle_rad(run))
        wave = self.size(run, axis) * np.ones(len(run), dtype=complex)
        for _ in range(self._order(name)):
            wave = wave * turned
        return np.asarray(wave)

    def _order(self, name: str) -> int:
        return self.orders[self.linear.index(name)]
