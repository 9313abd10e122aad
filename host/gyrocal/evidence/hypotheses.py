"""The hypotheses: what each effect may do on one axis, as columns with the sizes that are expected of their coefficients."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gyrocal.effects.base import Effect, Role, Values, effects, with_role
from gyrocal.effects.quantities import rate_slope_dps_s, true_rate_dps
from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.term import Term
from gyrocal.recording.session import AXES, Array, Run

GRID = 1.5
"""Ratio of neighbouring values of a nonlinear parameter. Between them the column's slope stands for its course."""
SLOPE = 0.05
"""Half the step of the logarithm with which that slope is computed."""
LARGEST = 10.0
"""Sizes of up to this many times the largest typical one are in physical range."""
SMALLEST = 0.1
"""Sizes down to this part of the smallest typical one are expected: a long recording shows what a data sheet does not list."""


def _slope(of: Callable[[Values], Array], values: Values, name: str) -> Array:
    """The slope of a function of parameters by the logarithm of one of them."""
    high, low = (of({**values, name: values[name] * np.exp(step)}) for step in (SLOPE, -SLOPE))
    return np.asarray((high - low) / (2 * SLOPE))


class Form(Protocol):
    """Columns with the sizes that are expected of their coefficients."""

    @property
    def effect(self) -> Effect:
        """The effect whose data the columns need."""

    @property
    def sizes(self) -> Array:
        """The smallest and the largest size of each coefficient, shape [k, 2]."""

    @property
    def unit(self) -> Array:
        """The unit of each coefficient, shape [k]."""

    def columns(self, run: Run, axis: int) -> Array:
        """The columns of a run, shape [n, k], deg/s per unit of their parameters."""

    def noise(self, run: Run, axis: int, samples: float) -> tuple[Array, float] | None:
        """The noise of the columns' means, as :meth:`gyrocal.effects.base.Effect.noise`."""


@dataclass(frozen=True, eq=False)
class Option:
    """One form of an effect: which of its linear parameters act, at one value of its nonlinear parameter.

    ``sizes`` [k, 2] are the smallest typical size and the largest physical one of each coefficient, in units of the parameters.
    The last columns are the slopes by the nonlinear parameter, if there is one.
    """

    effect: Effect
    values: Values
    sizes: Array
    slope_of: str = ""

    @property
    def id(self) -> str:
        """The effect's id."""
        return self.effect.id

    @property
    def unit(self) -> Array:
        """The largest physical size of each coefficient, shape [k]."""
        return self.sizes[:, 1]

    def columns(self, run: Run, axis: int) -> Array:
        """The columns of a run, shape [n, k], deg/s per unit of their coefficients."""
        found = self.effect.columns(run, axis, self.values)
        if not self.slope_of:
            return found
        return np.column_stack([found, _slope(lambda v: self.effect.columns(run, axis, v), self.values, self.slope_of)])

    def noise(self, run: Run, axis: int, samples: float) -> tuple[Array, float] | None:
        """The noise of the columns' means over ``samples`` samples, as :meth:`gyrocal.effects.base.Effect.noise`."""
        return self.effect.noise(run, axis, self.values, samples)

    def at(self, value: float, step: float) -> Option:
        """The same form at another value of the nonlinear parameter, which is known to ``step`` of its logarithm."""
        linear = self.sizes[: len(self.sizes) // 2]
        values = {**self.values, self.slope_of: value}
        return Option(self.effect, values, np.concatenate([linear, linear * step]), self.slope_of)


@dataclass(frozen=True, eq=False)
class OfReference:
    """What frame and clock of the reference leave in the readings, with free coefficients: no hypothesis.

    A small error of the clock's offset leaves the slope of the rate, one of the frame the rates about the other axes.
    """

    run_axes: tuple[str, ...]
    clock: bool
    effect: Effect

    @property
    def sizes(self) -> Array:
        """No size is expected: ones [k, 2]."""
        return np.ones((len(self.run_axes) + self.clock, 2))

    @property
    def unit(self) -> Array:
        """Ones [k]."""
        return np.ones(len(self.sizes))

    def columns(self, run: Run, axis: int) -> Array:
        """The columns of a run, shape [n, k]."""
        about = run.about(AXES[axis])
        slopes = [rate_slope_dps_s(about, axis)] if self.clock else []
        others = [true_rate_dps(run.about(name)) * run.three_axes for name in self.run_axes]
        return np.column_stack([*slopes, *others])

    def noise(self, run: Run, axis: int, samples: float) -> None:
        """It is neglected."""


class Free:
    """A form of one column whose coefficient has no expected size."""

    @property
    def sizes(self) -> Array:
        """Ones [1, 2]."""
        return np.ones((1, 2))

    @property
    def unit(self) -> Array:
        """Ones [1]."""
        return np.ones(1)

    def noise(self, run: Run, axis: int, samples: float) -> None:
        """The noise of measured columns is neglected."""


@dataclass(frozen=True, eq=False)
class OfTerm(Free):
    """How a term of the model changes with the logarithm of its nonlinear parameter, with a free coefficient: no hypothesis.

    The parameter was fitted without the effects that are weighed, and has taken up a part of them.
    """

    effect: Effect
    values: Values
    name: str

    def columns(self, run: Run, axis: int) -> Array:
        """The change [n, 1] of the term in a run, deg/s for a change of the parameter by its own size."""
        return _slope(lambda v: self.effect.term(run, axis, v), self.values, self.name)[:, None]


def of_terms(terms: Sequence[Term], runs: Sequence[Run]) -> list[OfTerm]:
    """The slopes of the slow terms whose size all runs share, as far as their nonlinear parameters are positive sizes."""

    def shared(effect: Effect) -> bool:
        return not effect.fast and not isinstance(effect, TimingEffect) and _of_all_runs(effect, runs)

    return [
        OfTerm(t.effect, t.values, name)
        for t in terms if shared(t.effect) for name in t.effect.nonlinear if t.values.get(name, 0.0) > 0
    ]  # fmt: skip


def of_reference(runs: Sequence[Run], axis: int) -> list[OfReference]:
    """The columns of the reference's frame and clock, if it has its own."""
    own = any(run.reference.clock == "own" and run.measured_rates is not None for run in runs)
    others = tuple(name for name in AXES if name != AXES[axis]) if any(run.three_axes for run in runs) else ()
    return [OfReference(others, own, with_role(Role.BIAS))] if own or others else []


def judged(effect: Effect, runs: Sequence[Run], axis: int) -> bool:
    """True if the evidence can be computed for an effect: one that is slow, and whose size all runs share."""
    if effect.role is not None or effect.fast or effect.fault is not None or effect.missing(runs, axis) is not None:
        return False
    return _of_all_runs(effect, runs)


def _of_all_runs(effect: Effect, runs: Sequence[Run]) -> bool:
    """True if all runs share the size of an effect, or its mean."""
    return effect.scope_in(runs) == "session" or effect.common_mean


def options(runs: Sequence[Run], axis: int, present: Sequence[str]) -> list[Option]:
    """Every form of every effect that can be judged and that the model does not have (``present`` ids)."""
    found = (e for e in effects().values() if e.id not in present and judged(e, runs, axis))
    return [option for effect in found for option in _forms(effect, runs, axis)]


def _forms(effect: Effect, runs: Sequence[Run], axis: int) -> Iterator[Option]:
    def structure(values: Values) -> frozenset[tuple[str, float]]:
        return frozenset((n, v) for n, v in effect.structure(values).items() if n not in effect.nonlinear)

    structures = {structure(values): values for values in effect.variants(runs, axis)}
    for values in structures.values():
        sizes = np.array([_size(effect, effect.coding.used(values)[group]) for group in effect.coding.groups(values)])
        nonlinear = [] if isinstance(effect, TimingEffect) else list(effect.nonlinear)
        if len(nonlinear) != 1:
            yield Option(effect, values, sizes)
            continue
        low, high = effect.parameter(nonlinear[0]).search_range
        count = max(2, round(np.log(high / low) / np.log(GRID)))
        for at in np.geomspace(low, high, count):
            form = {**values, nonlinear[0]: float(at)}
            half = np.log(high / low) / (count - 1) / 2
            yield Option(effect, form, np.concatenate([sizes, sizes * half / np.sqrt(3)]), nonlinear[0])


def _size(effect: Effect, name: str) -> tuple[float, float]:
    low, high = effect.parameter(name).typical
    return SMALLEST * low, LARGEST * high
