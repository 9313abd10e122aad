"""What a physical effect is: one subclass of :class:`Effect` in a file of its own in this folder.

An effect adds a term to the reading of one axis. Its linear parameters multiply *columns*, its nonlinear parameters shape
them. From that alone the fit, the simulator, the device's tables and the documentation are made.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from gyrocal.errors import InputError
from gyrocal.parameter import Described, Parameter, Values
from gyrocal.recording.session import Array, Run

if TYPE_CHECKING:
    from gyrocal.effects.reading_fault import ReadingFault

__all__ = [
    "Case", "Effect", "Law", "Mask", "OfEachRun", "Parameter", "Role", "Values", "effect", "effects", "elapsed_s", "load",
    "parse", "stack", "table_angle_rad", "with_role",
]

Mask = np.ndarray[Any, np.dtype[np.bool_]]


class Role(Enum):
    """The part that an effect plays in eq. (4), where that part is more than one term among others."""

    SCALE = auto()
    BIAS = auto()


@dataclass(frozen=True)
class Law:
    """What the term must be at given values, as a formula in the variables of :mod:`gyrocal.error_model.formula`.

    ``degree``: by which power the term grows with the true rate; ``even``: whether it keeps its sign when the rate turns round.
    ``reads`` is None where no such formula can say it (a slope of a column, say).
    """

    values: Values
    reads: str | None
    degree: int = 0
    even: bool = False


@dataclass(frozen=True)
class Case:
    """A planted size, and what a fit must find of it: ``recovers`` on ``axis`` in a simulated ``campaign``."""

    values: Values
    recovers: tuple[str, ...]
    campaign: Literal["paper", "full"] = "paper"
    axis: str = "z"


class Effect(Described):
    """A physical effect on one axis of the gyroscope.

    ``linear`` names the parameters that multiply columns, ``nonlinear`` those that shape them. *Values* map parameter names
    to numbers; which linear names are present says which columns are in use (``k1`` alone, or ``k1`` and ``k2``).

    This class is a deterministic effect, the same in all runs (``scope`` is ``session``). Other kinds are its subclasses:
    :class:`OfEachRun`, :class:`gyrocal.effects.wave.Wave` and :class:`gyrocal.effects.reading_fault.ReadingFault`.
    """

    linear: tuple[str, ...] = ()
    nonlinear: ClassVar[tuple[str, ...]] = ()
    scope: ClassVar[Literal["session", "run"]] = "session"
    common_mean: ClassVar[bool] = False
    """Where coefficients differ from run to run: whether they do so about a common mean, or about zero."""
    role: ClassVar[Role | None] = None
    on_device: ClassVar[bool] = False
    fast: ClassVar[bool] = False
    """Varies from sample to sample: fitted on samples, not on block means."""
    offered_as: ClassVar[str] = ""
    """How a demonstration that hides this effect names it in its menu; empty where none offers it."""
    law: ClassVar[Law | None] = None
    cases: ClassVar[tuple[Case, ...]] = ()

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

    @property
    def fault(self) -> ReadingFault | None:
        """The fault of the reading that goes by the same id."""
        return None

    def fault_of(self, values: Mapping[str, float]) -> ReadingFault | None:
        """The fault of the reading that these values describe; None where they describe a term of the reading."""
        return None

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

    def axes(self, run: Run) -> tuple[int, ...]:
        """The axes that the simulator plants the effect on when none is named."""
        return (run.axis_index,)

    def term(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        """What the effect adds to the reading of one axis, shape [n], deg/s."""
        return self.columns(run, axis, values) @ self.coefficients(values)


class OfEachRun(Effect):
    """An effect whose coefficients are of another size in each run.

    They are spread (``NAME_sd``) about a common mean, or about zero where ``common_mean`` is False.
    """

    scope = "run"


@cache
def effects() -> dict[str, Effect]:
    """Every built-in effect by id: one for each file of this folder."""
    package = importlib.import_module("gyrocal.effects")
    found: dict[str, Effect] = {}
    for info in pkgutil.iter_modules(package.__path__):
        for kind in _defined_in(importlib.import_module(f"gyrocal.effects.{info.name}")):
            found[kind.id] = kind
    return dict(sorted(found.items()))


def _defined_in(module: ModuleType) -> list[Effect]:
    """One of each effect that a module defines; a class that is abstract or private is a part of others."""
    return [
        item()
        for item in vars(module).values()
        if isinstance(item, type) and issubclass(item, Effect) and item.__module__ == module.__name__
        and not inspect.isabstract(item) and not item.__name__.startswith("_")
    ]  # fmt: skip


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
        for kind in _defined_in(module):
            effects()[kind.id] = kind
            came.append(kind.id)
    if not came:
        raise InputError(f"{folder}: no effect in it; an effect is a class that derives from gyrocal.effects.base.Effect")
    return came


def effect(effect_id: str) -> Effect:
    """One effect by id; InputError naming those there are."""
    try:
        return effects()[effect_id]
    except KeyError:
        raise InputError(f"no effect {effect_id!r}; there are {', '.join(effects())}") from None


def with_role(role: Role) -> Effect:
    """The effect that plays this part in eq. (4)."""
    return next(kind for kind in effects().values() if kind.role is role)


def parse(text: str, find: Callable[[str], Described] = effect) -> tuple[str, Values]:
    """``ID[:name=value[,name=value...]]`` as on the command line; ``find`` gives what goes by an id."""
    effect_id, _, rest = text.partition(":")
    kind = find(effect_id.strip())
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
