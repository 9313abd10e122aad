"""What a physical effect is: one subclass of :class:`Effect` in a file of its own in this folder.

An effect adds a term to the reading of one axis. Its linear parameters multiply *columns*, its nonlinear parameters shape
them. From that alone the fit, the simulator, the device's tables and the documentation are made.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording.session import Array, Run

Values = dict[str, float]
Mask = np.ndarray[Any, np.dtype[np.bool_]]


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect: its unit, the typical range of its magnitude, and where that range is from."""

    name: str
    unit: str
    typical: tuple[float, float]
    source: str
    default: float | None = None
    """What the simulator plants when no value is given; None = drawn anew for each run (a phase)."""


class Effect(ABC):
    """A physical effect on one axis of the gyroscope.

    ``linear`` names the parameters that multiply columns, ``nonlinear`` those that shape them. *Values* map parameter names
    to numbers; which linear names are present says which columns are in use (``k1`` alone, or ``k1`` and ``k2``).

    ``scope`` says where the coefficients are the same: in all runs (``session``), or within one power cycle (``scenario``) or
    run (``run``), spread (``NAME_sd``) about a common mean, or about zero where ``common_mean`` is False (a wave of unknown
    phase, the offset of a power cycle).
    """

    id: ClassVar[str]
    title: ClassVar[str]
    cause: ClassVar[str]
    equation: ClassVar[str]
    looks_like: ClassVar[str]
    measure_next: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    linear: tuple[str, ...] = ()
    nonlinear: ClassVar[tuple[str, ...]] = ()
    scope: ClassVar[Literal["session", "scenario", "run"]] = "session"
    common_mean: ClassVar[bool] = False
    on_device: ClassVar[bool] = False
    fast: ClassVar[bool] = False
    """Varies from sample to sample: fitted on samples, not on block means."""
    same_size: ClassVar[bool] = False
    """A wave whose phase is each run's own, but whose amplitude is that of all runs."""
    reading_fault: ClassVar[bool] = False
    """A fault of the reading itself: no columns; found by :meth:`detect`, planted by :meth:`distort`."""

    @abstractmethod
    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        """Regressors for one run and axis (0, 1, 2), shape [n, k], in deg/s per unit of their coefficient."""

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        """What the recording lacks for this effect to be measured, in words; None if nothing."""
        return None

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        """Values to start the fit from, each tried: the structure (which linear names) and a grid of the nonlinear ones."""
        return [dict.fromkeys(self.linear, 0.0)]

    def scope_in(self, runs: Sequence[Run]) -> str:
        """The scope on these runs: a wave of known phase, say, is the same in all."""
        return self.scope

    def looks(self, runs: Sequence[Run], axis: int) -> int:
        """How many independent shapes :meth:`variants` has chosen from: the price of having looked."""
        return len(self.variants(runs, axis))

    def step(self, name: str, values: Mapping[str, float], runs: Sequence[Run]) -> float:
        """The first step of a nonlinear parameter's refinement, in its logarithm."""
        return 0.3

    def at_reading(self, values: Mapping[str, float]) -> bool:
        """Do these values describe a fault of the reading itself?"""
        return self.reading_fault

    def detect(self, runs: Sequence[Run], axis: int) -> tuple[Values, Values, float] | None:
        """Where :meth:`at_reading`: (values, standard errors, chance that a sound reading looks so); None if nothing."""
        return None

    def usable(self, run: Run, axis: int, values: Mapping[str, float]) -> Mask | None:
        """Where :meth:`at_reading`: the samples [n] that still say something of the rate; None = all."""
        return None

    def respond(
        self, run: Run, axis: int, modelled_dps: Array, values: Mapping[str, float], white_sd_dps: float
    ) -> Array:
        """Where :meth:`at_reading`: what such a sensor is expected to read [n] where the model says ``modelled_dps`` [n]."""
        return modelled_dps

    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """Where :meth:`at_reading`: readings [n, 3] with the fault, deg/s, for the simulator."""
        return y_dps

    def used(self, values: Mapping[str, float]) -> tuple[str, ...]:
        """The linear parameters in use."""
        return tuple(name for name in self.linear if name in values)

    def structure(self, values: Mapping[str, float]) -> Values:
        """What of fitted values a fit begins with: the nonlinear ones, and the names of the linear ones in use."""
        return dict.fromkeys(self.used(values), 0.0) | {n: values[n] for n in self.nonlinear if n in values}

    def coefficients(self, values: Mapping[str, float]) -> Array:
        """Linear coefficients [k] from values; their mean over runs where these differ."""
        return np.array([values[name] for name in self.used(values)])

    def named(self, coefficients: Array, values: Mapping[str, float]) -> Values:
        """Named linear parameters from coefficients [k]; ``values`` tells which are in use."""
        return dict(zip(self.used(values), map(float, coefficients), strict=True))

    def spread(self, values: Mapping[str, float]) -> Array:
        """Standard deviation over the runs of each coefficient, shape [k]; zero for effects that all runs share."""
        return np.array([values.get(f"{name}_sd", 0.0) for name in self.used(values)])

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        """The inverse of :meth:`spread`."""
        return {f"{name}_sd": float(sd) for name, sd in zip(self.used(values), spread, strict=True)}

    def groups(self, values: Mapping[str, float]) -> list[int]:
        """For each column the number of the spread that it shares with others (a cosine and its sine)."""
        return list(range(len(self.used(values))))

    def device_arguments(self, values: Mapping[str, float]) -> list[tuple[float, ...]]:
        """For each column the arguments that ``effects/<id>.c`` takes (``on_device`` effects only)."""
        return [tuple(values[name] for name in self.nonlinear)] * len(self.groups(values))

    def bounds(self, name: str) -> tuple[float, float]:
        """Where a nonlinear parameter is searched."""
        low, high = self.parameter(name).typical
        return low / 3, high * 3

    def axes(self, run: Run) -> tuple[int, ...]:
        """The axes that the simulator plants the effect on when none is named."""
        return (run.axis_index,)

    def draw(self, values: Mapping[str, float], rng: np.random.Generator) -> Values:
        """All parameters for one run: those given, else the default, else drawn (a phase: uniform)."""
        drawn: Values = {}
        for parameter in self.parameters:
            if parameter.name in values:
                drawn[parameter.name] = float(values[parameter.name])
            elif parameter.default is not None:
                drawn[parameter.name] = parameter.default
            else:
                drawn[parameter.name] = float(rng.uniform(*parameter.typical))
        return drawn

    def term(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        """What the effect adds to the reading of one axis, shape [n], deg/s."""
        return self.columns(run, axis, values) @ self.coefficients(values)

    def parameter(self, name: str) -> Parameter:
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        known = ", ".join(p.name for p in self.parameters)
        raise InputError(f"effect {self.id} has no parameter {name!r}; it has {known}")


@cache
def effects() -> dict[str, Effect]:
    """Every built-in effect by id: one for each file of this folder."""
    package = importlib.import_module("gyrocal.effects")
    found: dict[str, Effect] = {}
    for info in pkgutil.iter_modules(package.__path__):
        if info.name == "base":
            continue
        module = importlib.import_module(f"gyrocal.effects.{info.name}")
        for item in vars(module).values():
            if isinstance(item, type) and issubclass(item, Effect) and item.__module__ == module.__name__:
                found[item.id] = item()
    return dict(sorted(found.items()))


def load(folder: Path) -> list[str]:
    """Take users' own effects from the Python files of a folder (code: only when asked for); the ids that came.

    They are equal to the built-in ones everywhere from then on.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder of effects")
    came = []
    for path in sorted(folder.glob("*.py")):
        spec = importlib.util.spec_from_file_location(f"gyrocal_own_{path.stem}", path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            raise InputError(f"{path}: {type(error).__name__}: {error}") from error
        for item in vars(module).values():
            if isinstance(item, type) and issubclass(item, Effect) and item.__module__ == module.__name__:
                effects()[item.id] = item()
                came.append(item.id)
    if not came:
        raise InputError(f"{folder}: no effect in it; an effect is a class that derives from gyrocal.effects.base.Effect")
    return came


def effect(effect_id: str) -> Effect:
    """One effect by id; InputError naming those there are."""
    try:
        return effects()[effect_id]
    except KeyError:
        raise InputError(f"no effect {effect_id!r}; there are {', '.join(effects())}") from None


def parse(text: str) -> tuple[str, Values]:
    """``ID[:name=value[,name=value...]]`` as on the command line."""
    effect_id, _, rest = text.partition(":")
    kind = effect(effect_id.strip())
    values: Values = {}
    for part in filter(None, (p.strip() for p in rest.split(","))):
        name, equals, value = part.partition("=")
        name = kind.parameter(name.strip()).name
        try:
            values[name] = float(value)
        except ValueError:
            raise InputError(f"--effect {text}: {part!r} is not name=value with a number") from None
        if not equals or not np.isfinite(values[name]):
            raise InputError(f"--effect {text}: {part!r} is not name=value with a finite number")
    return kind.id, values


def elapsed_s(run: Run) -> Array:
    """Time since the run's first sample, shape [n], s."""
    return run.t_s - run.t_s[0]


def table_angle_rad(run: Run) -> Array:
    """Angle of the table, shape [n], rad: from the file, else integrated from the table's rate, starting at zero."""
    angle = run.column("table_angle_deg")
    if angle is not None:
        return np.deg2rad(angle)
    if run.table_rate_dps is not None and run.column("rate_ref_dps") is None:
        return np.deg2rad(run.table_rate_dps * elapsed_s(run))
    rate = run.rate_dps * run.face_sign
    steps = np.diff(run.t_s) * (rate[1:] + rate[:-1]) / 2
    return np.deg2rad(np.concatenate([[0.0], np.cumsum(steps)]))


def stack(*columns: Array) -> Array:
    """Columns [n] side by side, shape [n, k]."""
    return np.column_stack(columns)
