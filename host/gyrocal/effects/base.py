"""The base class of physical effects. Each effect is one subclass of :class:`Effect` in its own file in this folder.

An effect adds a term to the reading of one axis. Its linear parameters multiply *columns*, and its nonlinear parameters shape
them. The fit, the simulator, the device's tables and the documentation are all derived from this description.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, final

import numpy as np

from gyrocal.effects.coding import Coding
from gyrocal.errors import InputError, did_you_mean, there_are
from gyrocal.parameter import Described, Parameter, Values
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array, Run
from gyrocal.recording.timing import SYNCHRONOUS

if TYPE_CHECKING:
    from gyrocal.effects.reading_fault import Fault

__all__ = [
    "AtSample", "Case", "Effect", "Law", "Looks", "Mask", "Objection", "OfEachRun", "OneCycle", "Parameter", "Refinement",
    "Role", "Tried", "Values", "effect", "effects", "elapsed_s", "load", "stack", "table_angle_rad", "with_role",
]

Mask = np.ndarray[Any, np.dtype[np.bool_]]
AtSample = Callable[[Any, Any, Any, Any], Any]
"""A term, deg/s, of (rate, dps; temp_c; power_on_s; the three accelerations, g), each a number or an array [n]."""

Tried = Literal["blocks", "samples"] | None
"""The data to which a candidate is fitted; None if no fit is tried."""


class Role(Enum):
    """A special role of an effect in eq. (4): it is the scale or the bias."""

    SCALE = auto()
    BIAS = auto()


@dataclass(frozen=True)
class Law:
    """The expected term at given values, as a formula in the variables of :mod:`gyrocal.error_model.formula`.

    The term is proportional to the true rate to the power ``degree``. ``even`` is True if the term keeps its sign when the
    rate changes its sign. ``reads`` is None if no formula can express the term (for example, the slope of a column).
    """

    values: Values
    reads: str | None
    degree: int = 0
    even: bool = False


class Objection(Enum):
    """What speaks against an effect whose fit may be good."""

    UNSEEN = auto()
    """The runs hold nothing of it that a simpler effect does not do as well."""
    REPEATS = auto()
    """It is what an imperfect fit of a known effect leaves over."""
    CONTRADICTED = auto()
    """Its values contradict what the effect is."""
    MINOR = auto()
    """Its values contradict what the effect is, unless it is the main cause of the excess."""


class Refinement(NamedTuple):
    """How finely a nonlinear parameter is searched."""

    step: float = 0.3
    """The first step, in the parameter's logarithm."""
    resolution: float = 0.0
    """The part of its standard error that comes from the spacing of the samples, even without noise."""


class Looks(NamedTuple):
    """What an effect has chosen from the readings before it is fitted."""

    shapes: int
    """The number of independent shapes from which ``variants`` has chosen, for the correction of the significance."""
    values: int = 0
    """The number of values that the columns have taken from the readings, which count as parameters."""


@dataclass(frozen=True)
class OneCycle:
    """What a single power cycle shows of an effect, and what to measure next so that another one shows that it repeats."""

    shows: str
    measure_next: str


@dataclass(frozen=True)
class Case:
    """Planted values, and the parameters ``recovers`` that a fit must find on ``axis`` in a simulated ``campaign``."""

    values: Values
    recovers: tuple[str, ...]
    campaign: Literal["paper", "full", "swing", "shaker", "chamber"] = "paper"
    axis: str = "z"


class Effect(Described):
    """A physical effect on one axis of the gyroscope.

    ``linear`` names the parameters that multiply columns, ``nonlinear`` those that shape them. *Values* map parameter names
    to numbers. The linear names that are present determine the columns in use (``k1`` alone, or ``k1`` and ``k2``).

    This class is a deterministic effect that is the same in all runs (``scope`` is ``session``). Other kinds are subclasses:
    :class:`OfEachRun`, :class:`gyrocal.effects.wave.Wave` and :class:`gyrocal.effects.reading_fault.ReadingFault`.

    An effect states data, and answers questions: its columns, and each further question that it answers in another way than
    most. What is ``final`` follows from these. :mod:`gyrocal.effects.optional` has what only few effects can answer.
    """

    linear: tuple[str, ...] = ()
    nonlinear: ClassVar[tuple[str, ...]] = ()
    scope: ClassVar[Literal["session", "run"]] = "session"
    common_mean: ClassVar[bool] = False
    """True if coefficients that differ from run to run do so about a common mean, False if about zero."""
    shown_against: ClassVar[str] = ""
    """The variable against which a picture shows it, if it is a function of none over all runs."""
    role: ClassVar[Role | None] = None
    chosen: ClassVar[tuple[str, ...]] = ()
    """Parameters of which :meth:`variants` chooses the values and a fit leaves them as they are."""
    on_device: ClassVar[bool] = False
    device_columns: ClassVar[Mapping[str, int]] = {}
    """The first argument of ``effects/<id>.c`` for the column of each linear parameter, if the file has several columns. A
    parameter that is not among them has none on the device."""
    fast: ClassVar[bool] = False
    """True if the effect varies from sample to sample. It is then fitted to samples instead of block means."""
    origin_free: ClassVar[bool] = False
    """True if the zero of the quantity is a convention (25 degC, power-on) or a constant (gravity beside vibration). What a
    session says of the effect is then judged by its columns' variation about bias and scale, not by their size."""
    stands_for: ClassVar[Role] = Role.BIAS
    """The term of eq. (4) that takes the effect's place, with a value of its own, in a run that lacks the effect's data."""
    acts_on: ClassVar[Literal["own", "others", "all"]] = "own"
    """The axes on which the simulator plants it: the one about which the table turns ("own"), the other two, which then read a
    part of the rate about another axis ("others"), or all three ("all")."""
    fixed_by: ClassVar[str] = ""
    """The column of a recording that makes the coefficients the same in all runs, which otherwise differ from run to run."""
    is_line: ClassVar[bool] = False
    """True if the effect is a line of constant frequency, which is judged against its neighbours in the spectrum too."""
    offered_as: ClassVar[str] = ""
    """The name of this effect in the menu of demonstrations; empty if no demonstration offers it."""
    fault: Fault | None = None
    """The fault of the reading that is this effect, or a part of it."""
    uncorrected: ClassVar[str] = ""
    """The reason why ``apply`` leaves this effect in the readings; empty if it belongs to the sensor and can be undone."""
    is_gain: ClassVar[bool] = False
    """True if the term is a fixed part of the true rates: an element of the matrix from these to the readings."""
    requires: ClassVar[tuple[str, ...]] = ()
    """The columns of a recording and keys of its run without which the effect can be neither shown nor removed."""
    one_cycle: ClassVar[OneCycle | None] = None
    """What is said of an effect that should repeat in each power cycle where one alone was recorded."""
    law: ClassVar[Law | None] = None
    cases: ClassVar[tuple[Case, ...]] = ()

    @abstractmethod
    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        """Regressors for one run and axis (0, 1, 2), shape [n, k], in deg/s per unit of their coefficients."""

    def term(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        """The term that the effect adds to the reading of one axis, shape [n], deg/s."""
        return self.columns(run, axis, values) @ self.coding.coefficients(values)

    @property
    def coding(self) -> Coding:
        """How named values become the coefficients of the columns, and back."""
        return Coding(self.linear)

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        """Start values of the fit, all of which are tried: the linear names in use and a grid of the nonlinear parameters."""
        return [dict.fromkeys(self.linear, 0.0)]

    def refinement(self, name: str, values: Mapping[str, float], runs: Sequence[Run], axis: int) -> Refinement:
        """How finely a nonlinear parameter is searched from these values on."""
        return Refinement()

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        """The data that the recording lacks for measuring this effect, in words; None if it lacks nothing."""
        return None

    def lacks(self, run: Run) -> bool:
        """True if a run lacks the data of which the columns are made. Such a run neither shows nor hides the effect."""
        return not all(map(run.has, self.requires))

    def noise(self, run: Run, axis: int, values: Mapping[str, float], samples: float) -> tuple[Array, float] | None:
        """The noise of measured data in the columns of a run: what it leaves of the columns' meaning.

        Returns the variance [n, k] of means of the columns over ``samples`` samples, and the standard error of that variance as
        a fraction of it; None if the columns have no noise.
        """
        return None

    def tried_on(self, runs: Sequence[Run], axis: int, line_chance: float) -> Tried:
        """The data to which a candidate is fitted: samples if means over blocks of a tenth of a second lose the effect.

        None if the readings rule the effect out at first sight, so that no fit is tried. ``line_chance`` is the probability
        that noise produces the strongest line in the spectrum of the model's residual.
        """
        if not self.fast:
            return "blocks"
        return "samples" if line_chance <= POLICY.false_discovery_rate else None

    def looks(self, runs: Sequence[Run], axis: int) -> Looks:
        """How much of the effect has been chosen from the readings of these runs before a fit."""
        return Looks(len(self.variants(runs, axis)))

    def objections(
        self, values: Values, runs: Sequence[Run], axis: int, known: Sequence[tuple[Effect, Values]]
    ) -> Iterable[Objection]:
        """What speaks against the fitted ``values``, although the fit may be good; ``known`` are other effects with theirs."""
        return ()

    def passes_for_it(self, runs: Sequence[Run], axis: int) -> Sequence[Effect]:
        """What can be mistaken for this effect in these runs and contradicts it if it explains them better, as terms to fit."""
        return ()

    def at_sample(self, values: Mapping[str, float]) -> AtSample | None:
        """The term of single samples, as ``effects/<id>.c`` has it; None if it needs more than one sample."""
        return None

    @final
    def fault_of(self, values: Mapping[str, float]) -> Fault | None:
        """The fault of the reading that these values describe; None if they describe a term of the reading."""
        return self.fault if self.fault is not None and self.fault.describes(values) else None

    @final
    def structure(self, values: Mapping[str, float]) -> Values:
        """The start of another fit from fitted values: nonlinear and chosen values, and the linear names in use set to zero.

        It is empty where the values describe a fault of the reading, which is detected again.
        """
        if self.fault_of(values) is not None:
            return {}
        nonlinear = {name: values[name] for name in self.nonlinear if name in values}
        return dict.fromkeys(self.coding.used(values), 0.0) | nonlinear | {name: values.get(name, 0.0) for name in self.chosen}

    @final
    def runs_on_device(self, values: Mapping[str, float]) -> bool:
        """True if ``effects/<id>.c`` has every column of these values."""
        return self.on_device and (not self.device_columns or self.device_columns.keys() >= set(self.coding.used(values)))

    @final
    def device_arguments(self, values: Mapping[str, float]) -> list[tuple[float, ...]]:
        """The arguments of ``effects/<id>.c`` for each column: its number, nonlinear values, cosine or sine of a wave."""
        first = {name: (float(number),) for name, number in self.device_columns.items()}
        shared, coding = tuple(values[name] for name in self.nonlinear), self.coding
        return [(*first.get(name, ()), *shared, *part) for name in coding.used(values) for part in coding.parts]

    @final
    def cause_in(self, runs: Sequence[Run]) -> str:
        """The cause, or what these runs show of it if they cannot show that the effect repeats."""
        return self.one_cycle.shows if self.one_cycle and in_one_power_cycle(runs) else self.cause

    @final
    def measure_next_in(self, runs: Sequence[Run]) -> str:
        """The next measurement beside these runs."""
        if self.one_cycle and in_one_power_cycle(runs):
            return f"{self.one_cycle.measure_next}; {self.measure_next}"
        return self.measure_next

    @final
    def scope_in(self, runs: Sequence[Run]) -> str:
        """The scope for these runs. For example, a wave of known phase is the same in all runs."""
        fixed = bool(self.fixed_by and runs) and all(r.column(self.fixed_by) is not None for r in runs)
        return "session" if fixed else self.scope

    @final
    def axes(self, run: Run) -> tuple[int, ...]:
        """The axes on which the simulator plants the effect by default."""
        return tuple(i for i in range(3) if self.acts_on == "all" or (i == run.axis_index) == (self.acts_on == "own"))

    @final
    def error_dps(self, turning: Mapping[int, Run], axis: int, values: Mapping[str, float]) -> Array:
        """The error that ``apply`` removes from the reading of an axis, shape [n], deg/s.

        ``turning`` holds the same run once for each axis about which the model knows the scale, turning about that axis at its
        own rate. An effect acts on the rate about its own axis, or on the sum of those about the others.
        """
        if self.acts_on != "others":
            return self.term(turning.get(axis, next(iter(turning.values()))), axis, values)
        others = [self.term(run, axis, values) for i, run in turning.items() if i != axis]
        return np.sum(others, axis=0) if others else np.zeros(len(next(iter(turning.values()))))


class OfEachRun(Effect):
    """An effect whose coefficients differ from run to run.

    They vary with the standard deviation ``NAME_sd`` about a common mean, or about zero if ``common_mean`` is False.
    """

    scope = "run"
    uncorrected = "it differs from run to run, so a model cannot predict it"


@cache
def effects() -> dict[str, Effect]:
    """Every known effect by id: one for each file of this folder, those of installed packages, and those of :func:`load`."""
    from gyrocal.effects import packages

    own = (f"gyrocal.effects.{info.name}" for info in pkgutil.iter_modules(importlib.import_module("gyrocal.effects").__path__))
    built_in = {kind.id: kind for name in own for kind in _defined_in(importlib.import_module(name))}
    brought = {kind.id: kind for module in packages.modules() for kind in _defined_in(module)}
    return dict(sorted({**brought, **built_in}.items()))


def title_of(effect_id: str) -> str:
    """The title of an effect by its id; that of a formula of the user's own is its id."""
    known = effects().get(effect_id)
    return effect_id if known is None else known.title


def _defined_in(module: ModuleType) -> list[Effect]:
    """One instance of each effect that a module defines. Abstract and private classes are only bases of others."""
    return [
        item()
        for item in vars(module).values()
        if isinstance(item, type) and issubclass(item, Effect) and item.__module__ == module.__name__
        and not inspect.isabstract(item) and not item.__name__.startswith("_")
    ]  # fmt: skip


def _own_files(place: Path) -> list[Path]:
    """The Python files that :func:`load` executes: those of a folder, or the file itself. Raises InputError without either."""
    if place.is_file() and place.suffix == ".py":
        return [place]
    if not place.is_dir():
        raise InputError(f"{place}: no such folder of effects")
    return sorted(place.glob("*.py"))


def load(place: Path) -> list[str]:
    """Load the user's own effects from the Python files of a folder, or from one file, and return their ids.

    This executes the files, so call it only if the user asked for it. The loaded effects are then treated like built-in ones.
    Raises InputError if there is no such place, a file fails, or no file defines an effect.
    """
    came = []
    for path in _own_files(place):
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
        raise InputError(f"{place}: no effect in it; an effect is a class that derives from gyrocal.effects.base.Effect")
    return came


def effect(effect_id: str) -> Effect:
    """One effect by id. Raises InputError, which says what lists them, if there is none."""
    try:
        return effects()[effect_id]
    except KeyError:
        near = did_you_mean(effect_id, effects())
        raise InputError(f"no effect {effect_id!r}{near}; {there_are(effects(), '`gyrocal effects`')}") from None


def with_role(role: Role) -> Effect:
    """The effect with this role in eq. (4)."""
    return next(kind for kind in effects().values() if kind.role is role)


def in_one_power_cycle(runs: Sequence[Run]) -> bool:
    """True if the runs that know their time since power-on, or all if none does, are of one power cycle.

    One power cycle cannot show that anything repeats.
    """
    known = [run for run in runs if run.power_on_s is not None] or runs
    return len({run.scenario for run in known}) == 1


def elapsed_s(run: Run) -> Array:
    """Time since the run's first sample, shape [n], s."""
    return run.sample_s - run.sample_s[0]


def table_angle_rad(run: Run) -> Array:
    """Angle of the table, shape [n], rad, from the file, or else integrated from the table's rate, starting at zero.

    It is the angle at the moment that each sample shows.
    """
    angle = run.column("table_angle_deg")
    if angle is not None:
        return np.deg2rad(angle if run.timing == SYNCHRONOUS else np.interp(run.shown_s, run.sample_s, angle))
    if run.table_rate_dps is not None and run.reference_dps is None:
        return np.deg2rad(run.table_rate_dps * elapsed_s(run))
    rate = run.rate_dps * run.face_sign
    steps = np.diff(run.sample_s) * (rate[1:] + rate[:-1]) / 2
    return np.deg2rad(np.concatenate([[0.0], np.cumsum(steps)]))


def stack(*columns: Array) -> Array:
    """Columns [n] side by side, shape [n, k]."""
    return np.column_stack(columns)
