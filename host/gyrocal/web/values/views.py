"""The values that the worker sends to the page. They contain no objects of the engine."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gyrocal.present.spectra import Curve
    from gyrocal.units import RateUnit
    from gyrocal.web.values.budget import Budget
    from gyrocal.web.values.excess_by_step import Levels

AXES = ("x", "y", "z")
NOT_JUDGED = "not judged"
"""In the name of an axis that has a blocking warning, in the rows of a comparison."""
NOT_NAMED = "sensor not named"
"""The sensor of a session whose session.toml names none."""


@dataclass(frozen=True)
class RunView:
    """One run: rows ``first:first + rows`` of the session's traces."""

    file: str
    scenario: str
    face: str
    axis: str
    rate_dps: float | None
    day: int | None
    first: int
    rows: int
    seconds: float


@dataclass(frozen=True)
class SessionView:
    """A session that was read and checked. ``traces`` holds ``t_s.npy`` and the pyramid ``measured`` (less the true rate)."""

    path: Path
    sensor: str
    axis: str
    sample_rate_hz: float
    runs: list[RunView]
    traces: Path

    @property
    def rows(self) -> int:
        return sum(run.rows for run in self.runs)


@dataclass(frozen=True)
class Recording:
    """A session's folder, and the files of the runs that are left out of every fit."""

    path: Path
    excluded: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Place:
    """Where a picture proves a finding: its view, and the part of the horizontal axis that the finding names.

    ``view`` is empty if no picture shows it. ``about_means`` is True for a finding of another size in each run: each run is
    then drawn about its own mean. ``part`` is the unit of a finding in proportion to the rate: the residual is then drawn as
    a part of the rate.
    """

    view: str
    low: float | None = None
    high: float | None = None
    about_means: bool = False
    part: RateUnit | None = None


@dataclass(frozen=True)
class Holdable:
    """A parameter of an effect that a fit can leave at its value; ``se`` is None if it does."""

    effect: str
    title: str
    axis: str
    name: str
    value: float
    se: float | None
    unit: str
    held: bool


@dataclass(frozen=True)
class ModelView:
    """A model compared with the session. ``traces`` holds the pyramids ``modelled``, ``residual`` and ``points.npz``."""

    toml: str
    compared: dict[str, Any]
    """The exact output of `gyrocal compare --json`."""
    headline: str
    rows: list[list[str]]
    """Axis, rms, floor, excess, its error, excess within power cycles, as the command line prints them; last all axes."""
    unit: str
    """That of the figures in ``rows``."""
    effects: list[tuple[str, str, bool]]
    """(id, title, may be removed)."""
    holdable: list[Holdable]
    sizes: dict[str, dict[str, str]]
    """The fitted size of each effect in words, by its id and the axis."""
    traces: Path
    against: list[str]
    levels: Levels | None
    """The figures from which excess and explained part are computed; None for a session judged by angle."""
    places: list[Place]
    """The picture of each finding of ``compared["where"]``."""
    left: dict[str, float]
    """The excess error of each run that was fitted, by file, mdps."""
    spectra: dict[str, Curve] = field(repr=False)
    orders: dict[str, Curve] = field(repr=False)
    allan: dict[str, Curve] = field(repr=False)


@dataclass(frozen=True)
class Picture:
    """The residual against the variable that an effect is accused of, and the effect's curve through it.

    ``left`` are the means [k] of the residual in the bins that ``edges`` [k + 1] bound, ``se`` their standard errors and
    ``curve`` the means of the fitted effect, mdps. ``run`` is the index of the only run that is shown, None for all runs.
    ``reach`` are the lowest and the highest mean of a single run, mdps, if each is drawn beside those of all. ``few`` is True
    if the variable takes a few values, between which nothing was measured; ``marks`` are the words of values that have them.
    """

    view: str
    axis: str
    x_label: str
    run: int | None
    file: str
    edges: list[float]
    centres: list[float]
    left: list[float]
    se: list[float]
    curve: list[float]
    reach: tuple[float, float] = (0.0, 0.0)
    few: bool = False
    marks: dict[float, str] = field(default_factory=dict)
    beside: str = ""
    """The titles of the named effects without which the residual is drawn, as that of a hint beside them is."""


@dataclass(frozen=True)
class Signature:
    """A picture in small: the residual's means (dots) and the fitted effect (line), with the words below it."""

    title: str
    dots: list[tuple[float, float]]
    line: list[tuple[float, float]]
    few: bool


@dataclass(frozen=True)
class Halves:
    """An effect's size in two halves of the recordings, as parts of its size in all of them, with standard errors."""

    names: tuple[str, str]
    sizes: tuple[float, float]
    se: tuple[float, float]


@dataclass(frozen=True)
class Card:
    """One effect on one axis, judged; ``judged`` is its entry of `gyrocal diagnose --json`."""

    judged: dict[str, Any]
    title: str
    cause: str
    equation: str
    looks_like: list[str]
    """Titles of the effects that this session cannot tell from it."""
    size: str
    doubts: list[str]
    """Why the effect is not proven, as phrases; empty if it is."""
    within: bool
    """True if the explained part counts within power cycles, because there are few."""
    picture: Picture | None = None
    means: bool = False
    """True if the explained part is that of means, because the effect is slow and the axis has a faster error too."""
    limit: str = ""
    """The size that is excluded, in words, of an effect that was looked for and not found; empty if it is not known."""
    halves: list[Halves] = field(default_factory=list)
    """The effect's size in the halves of the recordings that show it."""

    @property
    def signature(self) -> Signature | None:
        """The picture in small."""
        shown = self.picture
        if shown is None:
            return None
        where = "all recordings" if shown.run is None else shown.file
        where += f", without {shown.beside}" * bool(shown.beside)
        dots, line = (list(zip(shown.centres, y, strict=True)) for y in (shown.left, shown.curve))
        return Signature(f"against {shown.x_label.partition(',')[0]}, {where}", dots, line, shown.few)


@dataclass(frozen=True)
class DiagnosisView:
    verdict: str
    sentence: str
    cards: list[Card]
    unknown: dict[str, Any] | None
    sets: list[list[str]] = field(default_factory=list)
    """Axis, effects and probability in words of the likeliest sets of effects, on axes that more than noise explains."""
    left_over: str = ""
    """The sentence about what no effect describes; empty if nothing is left over."""

    @property
    def named(self) -> list[Card]:
        """The cards of what is named or suggested, best first."""
        return [card for card in self.cards if card.judged["decision"] in ("add", "suggest")]

    def of(self, effect: str) -> tuple[Card, ...]:
        """Those of an effect."""
        return tuple(card for card in self.named if card.judged["effect"] == effect)


@dataclass(frozen=True)
class Attempt:
    """An effect that was tried. ``view`` is the model with it, None if it was ``refused``, which says why.

    ``before`` is the comparison before it, over the richer model's floor, as ``gyrocal add --json`` gives it. ``limits`` are
    the sizes that the session excludes on the axes where the effect is not proven, in words. ``proves`` are the ids of effects
    that were in doubt and are proven beside it.
    """

    before: dict[str, Any]
    view: ModelView | None
    refused: str
    limits: list[str]
    proves: tuple[str, ...] = ()


@dataclass(frozen=True)
class Made:
    """One step of an explanation: effects that were added together, with their cards and the model that has them."""

    effects: tuple[str, ...]
    title: str
    cards: tuple[Card, ...]
    view: ModelView


@dataclass(frozen=True)
class ExplainedView:
    """Everything that was certain, step by step, the diagnosis of the last model, and what is proven beside it by now."""

    made: list[Made]
    found: DiagnosisView
    proves: tuple[str, ...] = ()


@dataclass(frozen=True)
class CalibrationView:
    """Estimates of the latest model, and differences of the first seconds from the whole recording by method and seconds."""

    estimates: list[dict[str, Any]]
    errors: dict[str, dict[float, tuple[float, float]]]
    """{method: {seconds: (scale, bias_dps)}}: mean absolute difference over the power cycles."""
    note: str = ""
    budget: Budget | None = None


@dataclass(frozen=True)
class TrainedView:
    """A network trained for a model, in its run folder. ``parity`` is the output of `gyrocal verify --json`, if it was run."""

    folder: Path
    errors: list[dict[str, Any]]
    """Mean absolute errors on scenarios drawn from the model, by method and seconds: `errors` of `gyrocal train --json`."""
    parity: dict[str, Any] | None


@dataclass(frozen=True)
class ExportView:
    """The project written for the device. ``parity`` is the output of `gyrocal verify --json`, if it was run."""

    folder: Path
    effects: list[str]
    parity: dict[str, Any] | None
