"""The story of a model for the report: what was added or removed, on which evidence, and what it made of the error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from gyrocal.web.values.models import BY_HAND, Step
from gyrocal.web.values.views import Card


@dataclass(frozen=True)
class Change:
    """One step of the model. ``cards`` are the evidence at that time, one for each axis that it was added on.

    They are empty if it was removed, or if no diagnosis named it.
    """

    effect: str
    title: str
    removed: bool
    formula: str
    doubts: tuple[str, ...]
    cards: tuple[Card, ...]
    held: str = ""
    """The parameter that was held at a value or freed, in words."""
    axes: tuple[str, ...] = ()
    """The axes on which it was added."""
    sizes: tuple[tuple[str, str], ...] = ()
    """The axes on which it was added, each with its fitted size in words."""
    limits: tuple[str, ...] = ()
    """What the session excludes of it, in words."""
    also: tuple[str, ...] = ()
    """The ids of effects that are certain only together with it, and were added with it."""
    proves: tuple[str, ...] = ()
    """The ids of effects that were in doubt before, and are proven with it in the model."""

    @property
    def by_hand(self) -> bool:
        """True if it was added without a diagnosis that named it."""
        return BY_HAND in self.doubts

    def command(self, session: str) -> str:
        """The command line that repeats the step on the file ``model.toml``."""
        if self.held:
            return f"# in model.toml: {self.held} (the list `held` names the parameters of a line that are not fitted)"
        if self.removed:
            return f"# take the lines of {self.effect} out of model.toml"
        if self.formula:
            return f"gyrocal keep {session} --model model.toml --name {self.effect}"
        if self.also:
            return f"gyrocal explain {session} --model model.toml --max 1"
        return f"gyrocal add {self.effect} {session} --model model.toml"


def as_added(card: Card, before: Step, after: Step) -> Card:
    """The card of an effect that was added, with the part of the excess that it did remove in place of the expected one."""
    from gyrocal.web.values.excess_by_step import realised  # the engine, which is loaded by now

    part = realised(before.view.levels, after.view.levels, card.judged["axis"])
    return replace(card, judged={**card.judged, "explained": part}, means=False)


def story(steps: Sequence[Step]) -> list[Change]:
    """The changes of a sequence, each with what the diagnosis of the model before it said."""
    changes = []
    for before, step in pairwise(steps):
        recipe = step.recipe
        its = tuple(as_added(c, before, step) for c in recipe.cards if c.judged["axis"] in step.axes)
        on = tuple(sorted(step.axes)) if step.adds else ()
        sizes = tuple(sorted(step.sizes.items())) if step.adds else ()
        made = (step.effect, step.title, step.removed, step.formula, recipe.doubts, its, recipe.held, on, sizes, recipe.limits)
        changes.append(Change(*made, also=recipe.also, proves=recipe.proves))
    return changes


def in_doubt(changes: Sequence[Change]) -> str:
    """The sentence that names the effects of the last model that are not proven; empty if there are none."""
    doubted: dict[str, str] = {}
    for change in changes:
        if change.removed:
            doubted.pop(change.effect, None)
        elif change.doubts and not change.held:
            doubted[change.effect] = change.title
        for effect in change.proves:
            doubted.pop(effect, None)
    return f"Not proven: {', '.join(doubted.values())}." if doubted else ""
