"""Plots of the residual against each variable: their list, and the names under which their points are stored."""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.effects.quantities import rate_slope_dps_s, rate_varies
from gyrocal.recording.session import Array, Run
from gyrocal.variables.base import Variable, variables
from gyrocal.variables.rate import Rate


@dataclass(frozen=True)
class Panel:
    """The residual against a variable, or against one component of it."""

    variable: type[Variable]
    component: str = ""

    @property
    def name(self) -> str:
        return "_".join(filter(None, (self.variable.name, self.component)))

    @property
    def title(self) -> str:
        return " ".join(filter(None, (self.variable.title, self.component)))

    @property
    def label(self) -> str:
        return self.variable.label(self.component)

    def in_equation(self, equation: str) -> bool:
        """True if an effect's equation contains the variable, or its component."""
        return self.variable.in_equation(equation, self.component)

    def key(self, axis: str) -> str:
        """The name of the stored points for the residual of an axis."""
        return f"{self.name}_{axis}" if self.variable.of_axis else self.name

    def values(self, variable: Variable, run: Run, axis: int) -> Array | None:
        """Values [n] in a run for the residual of an axis (0, 1, 2); None if the run has none."""
        values = variable.values(run, axis)
        if values is None or not self.component:
            return values
        return values[:, self.variable.components.index(self.component)]


@dataclass(frozen=True)
class ChangeOfRate(Panel):
    """The residual against the slope of the true rate, to which that of a delay is proportional."""

    variable: type[Variable] = Rate
    component: str = "change"

    @property
    def title(self) -> str:
        return "Change of rate"

    @property
    def label(self) -> str:
        return "change of the true rate, dps/s"

    def values(self, variable: Variable, run: Run, axis: int) -> Array | None:
        turning = run.axis_index
        return rate_slope_dps_s(run, turning) if rate_varies([run], turning) else None


def panels() -> list[Panel]:
    """All panels, in their order on a screen."""
    folded = [v for v in variables().values() if v.picture == "folded"]
    out = [Panel(v, component) for v in folded for component in v.components or ("",)]
    after = next(k for k, panel in enumerate(out) if panel.variable is Rate) + 1
    return [*out[:after], ChangeOfRate(), *out[after:]]


def opened_by(against: str) -> str:
    """The name of the panel that shows a finding: the variable's own, or that of its first component."""
    return Panel(variables()[against], next(iter(variables()[against].components), "")).name
