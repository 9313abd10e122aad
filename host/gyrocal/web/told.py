"""The story of a model for the report: what was added or removed, on which evidence, and what it made of the error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from gyrocal.web.models import Step
from gyrocal.web.views import Card, DiagnosisView


@dataclass(frozen=True)
class Change:
    """One step of the model. ``cards`` are the evidence at that time, one for each axis that it was added on.

    They are empty if it was removed, or found in an earlier session.
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

    def command(self, session: str) -> str:
        """The command line that repeats the step on the file ``model.toml``."""
        if self.held:
            return f"# in model.toml: {self.held} (the list `held` names the parameters of a line that are not fitted)"
        if self.removed:
            return f"# take the lines of {self.effect} out of model.toml"
        if self.formula:
            return f"gyrocal keep {session} --model model.toml --name {self.effect}"
        return f"gyrocal add {self.effect} {session} --model model.toml"


def story(steps: Sequence[Step], diagnoses: Mapping[str, DiagnosisView]) -> list[Change]:
    """The changes of a sequence, each with what the diagnosis of the model before it said."""
    changes = []
    for before, step in pairwise(steps):
        found = diagnoses.get(before.source)
        cards = [] if found is None or step.removed or step.recipe.held else found.cards
        named = [c for c in cards if c.judged["decision"] in ("add", "suggest")]
        its = tuple(c for c in named if c.judged["effect"] == step.effect and c.judged["axis"] in step.axes)
        on = tuple(sorted(step.axes)) if step.adds else ()
        made = (step.effect, step.title, step.removed, step.formula, tuple(step.recipe.doubts), its, step.recipe.held, on)
        changes.append(Change(*made))
    return changes


def in_doubt(changes: Sequence[Change]) -> str:
    """The sentence that names the effects of the last model that are not proven; empty if there are none."""
    doubted: dict[str, str] = {}
    for change in changes:
        if change.removed:
            doubted.pop(change.effect, None)
        elif change.doubts and not change.held:
            doubted[change.effect] = change.title
    return f"Not proven: {', '.join(doubted.values())}." if doubted else ""
