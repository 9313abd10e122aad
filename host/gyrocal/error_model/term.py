"""A term of a model: one effect on one axis with its parameters. A line: a term or a noise as the model file lists it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gyrocal.effects import base
from gyrocal.effects.base import Effect, Values
from gyrocal.effects.reading_fault import Fault
from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.parameter import Described
from gyrocal.recording.session import Run


@dataclass(frozen=True)
class Term:
    """One effect on one axis. ``values`` holds its parameters (empty before a fit), ``se`` their standard errors."""

    effect_id: str
    axis: str
    values: Values = field(default_factory=dict)
    se: Values = field(default_factory=dict)
    own: Effect | None = field(default=None, repr=False, compare=False)
    """An effect that is not in the library: a user's own, or a probe of the comparison."""
    of_run: Mapping[int, Values] = field(default_factory=dict, repr=False)
    """Nonlinear parameters that differ from run to run, by the run's index."""
    held: tuple[str, ...] = ()
    """The names of the parameters that a fit leaves at their values."""

    @staticmethod
    def of(kind: Effect, axis: str, values: Values | None = None) -> Term:
        """A term of an effect, which may be a user's own."""
        own = None if base.effects().get(kind.id) is kind else kind
        return Term(kind.id, axis, {} if values is None else values, own=own)

    @property
    def effect(self) -> Effect:
        """The effect of the term: its own, or that of the library."""
        return self.own or base.effect(self.effect_id)

    @property
    def fault(self) -> Fault | None:
        """The fault of the reading that the values describe; None if they describe a term of the reading."""
        return self.effect.fault_of(self.values)

    def values_in(self, run: Run) -> Values:
        """The values in one run."""
        return {**self.values, **self.of_run.get(run.index, {})}

    @property
    def holdable(self) -> tuple[str, ...]:
        """The parameters that a fit can leave at their values: nonlinear ones, and linear ones of an effect without any."""
        kind = self.effect
        if self.fault is not None or kind.role is not None or isinstance(kind, TimingEffect):
            return ()
        linear = kind.coding.used(self.values) if kind.scope == "session" and not kind.nonlinear else ()
        return (*linear, *(name for name in kind.nonlinear if name in self.values))

    def fitted(self, column: int) -> bool:
        """False for a column whose coefficient is held."""
        used = self.effect.coding.used(self.values) if self.held else ()
        return column >= len(used) or used[column] not in self.held

    @property
    def spreadable(self) -> str | None:
        """The nonlinear parameter that may differ from run to run: only an effect of each run with one column has one."""
        kind = self.effect
        if kind.scope != "run" or len(kind.coding.groups(self.values)) != 1:
            return None
        return next((name for name in kind.nonlinear if name in self.values and name not in self.held), None)


@dataclass(frozen=True)
class Line:
    """An effect or a noise on one axis, as the model file and the commands list it."""

    kind: Described
    axis: str
    values: Values
    se: Values
    held: tuple[str, ...] = ()

    @property
    def id(self) -> str:
        """Id of the effect or noise component."""
        return self.kind.id

    @property
    def formula(self) -> str:
        """The formula that the file gives the effect by; empty where its id names it, from the library or a user's folder."""
        known = base.effects().get(self.id) is self.kind
        return self.kind.equation if isinstance(self.kind, FormulaEffect) and not known else ""

    @property
    def inherent(self) -> bool:
        """True if every sensor has it. Scale, bias and noise are reported but never called missing."""
        return not isinstance(self.kind, Effect) or self.kind.role is not None
