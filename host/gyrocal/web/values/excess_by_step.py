"""The excess error step by step, in the figures of ``gyrocal add`` and ``gyrocal explain``.

All steps are held against one noise floor, that of the richest model. With fewer than ``Policy.few_cycles`` power cycles the
explained part counts within them, so the bars do as well, and the picture and the figure beside it agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from gyrocal.diagnosis.residual.levels import Floor, Level, MeanSquares, explained, pooled
from gyrocal.digits import percentage
from gyrocal.policy import POLICY
from gyrocal.units import RateUnit, unit_of

MUCH = 0.9
"""Part of the excess over the floor of the richest model below which that over the first model's own floor is explained."""
NOTHING = 5e-4
"""A part of the squared excess that is zero in the digits that are shown."""


@dataclass(frozen=True)
class Bar:
    """One step of the waterfall: the excess in mdps before and after it."""

    label: str
    before: float
    after: float


@dataclass(frozen=True)
class Levels:
    """Mean squares of the held-out residuals and the squared floor by axis, and the number of power cycles."""

    squares: dict[str, MeanSquares]
    floors: dict[str, Floor]
    cycles: int
    parameters: int
    """The number of parameters of the model, to find the richest of several."""

    def over(self, richest: Levels) -> Level:
        """The level of all axes together over the floor of another model."""
        return pooled(self.squares, richest.floors)

    def within(self) -> Levels:
        """The levels with the offset and scale of each power cycle removed from residuals and floors."""
        squares = {axis: replace(s, all=s.within, error=s.error_within) for axis, s in self.squares.items()}
        floors = {axis: replace(f, all=f.within, error=f.error_within) for axis, f in self.floors.items()}
        return replace(self, squares=squares, floors=floors)


@dataclass(frozen=True)
class Counted:
    """A model's error as all figures of the page count it: of all axes together, and of each."""

    level: Level
    of_axes: dict[str, Level]

    @staticmethod
    def of(model: Levels, richest: Levels, *, within: bool) -> Counted:
        """The error over the floor of the richest model, within power cycles or with what differs between them."""
        own, floors = (model.within(), richest.within()) if within else (model, richest)
        return Counted(own.over(floors), {axis: Level.of(s, floors.floors[axis]) for axis, s in own.squares.items()})


def realised(before: Levels | None, after: Levels | None, axis: str) -> float | None:
    """The part of an axis's squared excess that a step has removed, over the later floor; None if it is not known."""
    if before is None or after is None or axis not in before.squares or axis not in after.squares:
        return None
    old, new = (Level.of(levels.squares[axis], after.floors[axis]) for levels in (before, after))
    return explained(old, new, after.cycles)


@dataclass(frozen=True)
class Fall:
    """The bars, the levels of the first and the last model, and the part of the squared excess that lies between them."""

    bars: list[Bar]
    first: Level
    last: Level
    part: float | None
    within: bool
    """True if the bars and the part count within power cycles."""
    alone: Counted
    """The error of the first model over its own floor, which was told as long as it stood alone."""
    now: Counted
    """The error of the last model: its excess is the last bar's."""

    @property
    def unit(self) -> RateUnit:
        """The unit in which the steps are told."""
        return unit_of([self.last.floor_dps, *(1e-3 * b.after for b in self.bars)])

    def told(self, value_mdps: float) -> str:
        """A figure of a bar, mdps, in :attr:`unit`."""
        return self.unit.text(1e-3 * value_mdps, 2)

    @property
    def over_axes(self) -> str:
        """What a figure of all axes together is: a mean, which an error on one axis alone exceeds."""
        *first, last = self.now.of_axes
        return f"rms over {', '.join(first)} and {last}" if first else f"rms on {last}"

    @property
    def _floor(self) -> str:
        return f"{self.unit.text(self.now.level.floor_dps, 2)} {self.unit.name}"

    @property
    def counted(self) -> str:
        """The way of counting, as a phrase."""
        whose = f" of the richest model, {self._floor}" if len(self.bars) > 1 else ""
        how = f"{self.unit.name} {self.over_axes}, on unseen recordings, beyond the noise floor{whose}"
        few = f"counted within each power cycle, because there are fewer than {POLICY.few_cycles} of them"
        return f"{how}, {few}" if self.within else how

    @property
    def part_told(self) -> str:
        """The explained part in words; empty if it is not known."""
        if self.part is None:
            return ""
        if abs(self.part) < NOTHING:
            return "nothing of its square explained"
        if self.part < 0:
            return f"its square grew by {percentage(-self.part, 1)}"
        return f"{percentage(self.part, 1)} of its square explained"

    @property
    def sentence(self) -> str:
        """What the steps made of the excess; empty before the first step."""
        if len(self.bars) < 2:
            return ""
        where = " within power cycles" if self.within else ""
        first, last = self.told(self.bars[0].after), self.told(self.bars[-1].after)
        told = f"The excess error{where}, {self.over_axes}, went from {first} to {last} {self.unit.name}."
        return f"{told} Both are over the noise floor of the richest model.{self._before}"

    @property
    def _before(self) -> str:
        """Why the first model's excess was another one as long as it stood alone, as a sentence; empty if it was the same."""
        before, now = self.alone.level.excess_dps, 1e-3 * self.bars[0].after
        if before is None or before > MUCH * now:
            return ""
        floor, own = (self.unit.text(v, 2) for v in (self.alone.level.floor_dps, before))
        return f" The first model alone took part of this error for noise: its floor was {floor} and its excess {own}."

    @property
    def in_all(self) -> str:
        """The excess with the offset and scale of each power cycle, where the bars leave these out."""
        if not self.within or self.first.excess_dps is None or self.last.excess_dps is None:
            return ""
        unit = self.unit
        figures = [unit.text(level.excess_dps, 2) for level in (self.first, self.last) if level.excess_dps is not None]
        shown = figures[0] if len(self.bars) < 2 else " → ".join(figures)
        floor = f"{unit.text(self.last.floor_dps, 2)} {unit.name}"
        return f"With what differs between power cycles, offset and scale: {shown} {unit.name} over a floor of {floor}."


def fall(steps: Sequence[tuple[str, Levels | None]]) -> Fall | None:
    """The fall over models, each with the label of the step that made it; None if nothing is held out or rates are unknown."""
    known = [(label, levels) for label, levels in steps if levels is not None]
    if not known or len(known) < len(steps):
        return None
    richest = max((levels for _, levels in known), key=lambda levels: levels.parameters)
    over = [levels.over(richest) for _, levels in known]
    within = richest.cycles < POLICY.few_cycles
    excess = [v.excess_within_dps if within else v.excess_dps for v in over]
    if any(e is None for e in excess):
        return None
    mdps = [1e3 * e for e in excess if e is not None]
    befores = [0.0, *mdps]
    bars = [Bar(label, old, new) for (label, _), old, new in zip(known, befores, mdps, strict=False)]
    part = explained(over[0], over[-1], richest.cycles) if len(over) > 1 else None
    (_, start), (_, end) = known[0], known[-1]
    alone, now = Counted.of(start, start, within=within), Counted.of(end, richest, within=within)
    return Fall(bars, over[0], over[-1], part, within, alone, now)
