"""Waves: effects with an amplitude and a phase. The phase differs from run to run unless the session determines it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gyrocal.effects.base import Array, OfEachRun, Run, Values, stack, table_angle_rad
from gyrocal.effects.quantities import TURNING_AT_ALL


class Wave(OfEachRun):
    """A sum of ``amplitude·size·cos(angle + phase)``.

    ``linear`` names the amplitudes, and ``phases`` names their phases in degrees in the same order. An amplitude is in use if
    the values contain it and every nonlinear parameter is known. Each amplitude in use has two columns, ``size·cos(angle)`` and
    ``size·sin(angle)``. If the phase differs from run to run, both coefficients are random about zero and share one spread.
    """

    phases: ClassVar[tuple[str, ...]]
    same_size: ClassVar[bool] = False
    """True if the amplitude is the same in all runs although the phase differs from run to run."""

    @abstractmethod
    def wave(self, run: Run, axis: int, values: Mapping[str, float], name: str) -> NDArray[np.complex128]:
        """``size·exp(i·angle)`` for the amplitude ``name``, shape [n], deg/s per unit of the amplitude."""

    def shape(self, values: Mapping[str, float], name: str) -> tuple[float, ...]:
        """The values that distinguish the wave of the amplitude ``name`` from others: the first arguments of its C twin."""
        return tuple(values[n] for n in self.nonlinear)

    def used(self, values: Mapping[str, float]) -> tuple[str, ...]:
        return super().used(values) if all(name in values for name in self.nonlinear) else ()

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        waves = [self.wave(run, axis, values, name) for name in self.used(values)]
        return stack(*(part for wave in waves for part in (wave.real, wave.imag))) if waves else np.zeros((len(run), 0))

    def coefficients(self, values: Mapping[str, float]) -> Array:
        phase = {name: np.deg2rad(values.get(self._phase(name), 0.0)) for name in self.used(values)}
        return np.array([part for n, p in phase.items() for part in (values[n] * np.cos(p), -values[n] * np.sin(p))])

    def named(self, coefficients: Array, values: Mapping[str, float]) -> Values:
        named: Values = {}
        for name, (a, b) in zip(self.used(values), coefficients.reshape(-1, 2), strict=True):
            named[name] = float(np.hypot(a, b))
            named[self._phase(name)] = float(np.rad2deg(np.arctan2(-b, a)))
        return named

    def spread(self, values: Mapping[str, float]) -> Array:
        # At an unknown phase, cosine and sine each carry half of the wave's mean square.
        return np.repeat([values[name] / np.sqrt(2) for name in self.used(values)], 2)

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        return {name: float(sd * np.sqrt(2)) for name, sd in zip(self.used(values), spread[::2], strict=True)}

    def groups(self, values: Mapping[str, float]) -> list[int]:
        return [i for i in range(len(self.used(values))) for _ in range(2)]

    def device_arguments(self, values: Mapping[str, float]) -> list[tuple[float, ...]]:
        return [(*self.shape(values, name), part) for name in self.used(values) for part in (0.0, 1.0)]

    def _phase(self, name: str) -> str:
        return self.phases[self.linear.index(name)]


class TableWave(Wave):
    """A wave in the angle of the table. Its phase is known if the session has ``table_angle_deg``.

    ``orders`` gives the number of periods per turn for each amplitude.
    """

    uncorrected = "it belongs to the turntable and not to the sensor"
    orders: ClassVar[tuple[int, ...]]
    needs: ClassVar[str] = TURNING_AT_ALL
    """The requirement on a recording in which the wave can occur, in words."""

    @abstractmethod
    def size(self, run: Run, axis: int) -> Array | float:
        """Size of the wave, shape [n] or one value for all samples, deg/s per unit of its amplitude."""

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        shown = any(not r.rate_is_mean and np.any(self.size(r, axis)) for r in runs)
        return None if shown else self.needs

    def scope_in(self, runs: Sequence[Run]) -> str:
        known = all(r.column("table_angle_deg") is not None for r in runs)
        return "session" if known and runs else "run"

    def shape(self, values: Mapping[str, float], name: str) -> tuple[float, ...]:
        return (float(self._order(name)),)

    def wave(self, run: Run, axis: int, values: Mapping[str, float], name: str) -> NDArray[np.complex128]:
        turned = np.exp(1j * table_angle_rad(run))
        wave = self.size(run, axis) * np.ones(len(run), dtype=complex)
        for _ in range(self._order(name)):
            wave = wave * turned
        return np.asarray(wave)

    def _order(self, name: str) -> int:
        return self.orders[self.linear.index(name)]
