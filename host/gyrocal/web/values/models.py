"""The models of a session: named sequences of steps, kept in a file beside the session and restored with it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from gyrocal.errors import GyrocalError
from gyrocal.files import UNREADABLE, replace_text
from gyrocal.web.values.views import Card, ModelView, Picture

FILE = "workbench.json"
FORMAT = "gyrocal-workbench/1"
START = "default"
"""The built-in model that a session begins with."""
FIRST_NAME = "first"
BY_HAND = "it was chosen by hand; no diagnosis of this model names it"


@dataclass(frozen=True)
class Recipe:
    """How one model of a sequence came about: the first one, or an effect that was added or removed."""

    source: str
    """The model for the engine: the name of a built-in model, or TOML text."""
    effect: str = ""
    title: str = "model at first"
    removed: bool = False
    formula: str = ""
    """The formula of an effect that is not in the library."""
    doubts: tuple[str, ...] = ()
    """Why the effect was not proven when it was added, as phrases; empty if it was."""
    held: str = ""
    """The parameter that was held at a value or freed, in words; empty for any other change."""
    cards: tuple[Card, ...] = ()
    """What the diagnosis of the model before it said of the effect, best first; empty if it did not name it."""
    limits: tuple[str, ...] = ()
    """The sizes that the session excludes on the axes where the effect, which was tried by hand, was not found, in words."""
    also: tuple[str, ...] = ()
    """The ids of effects that are certain only together with this one, and were added with it."""
    proves: tuple[str, ...] = ()
    """The ids of effects that were in doubt, and are proven with this one in the model."""

    @property
    def picture(self) -> Picture | None:
        """The picture of the effect as it was before it was added."""
        return next((card.picture for card in self.cards if card.picture is not None), None)


KEPT = TypeAdapter(Recipe)


def added(recipes: Iterable[Recipe]) -> list[str]:
    """The titles of the effects that a sequence has added and not removed again."""
    titles: dict[str, str] = {}
    for recipe in recipes:
        name = recipe.title if recipe.formula else recipe.effect
        if recipe.removed:
            titles.pop(name, None)
        elif name and not recipe.held:
            titles[name] = recipe.title
    return list(titles.values())


@dataclass(frozen=True)
class Step:
    """A model of the sequence, compared with the session."""

    recipe: Recipe
    view: ModelView

    @property
    def source(self) -> str:
        return self.recipe.source

    @property
    def effect(self) -> str:
        return self.recipe.effect

    @property
    def title(self) -> str:
        return self.recipe.title

    @property
    def adds(self) -> bool:
        """True if an effect was added, and not removed, held or freed."""
        return bool(self.effect) and not self.removed and not self.recipe.held

    @property
    def id(self) -> str:
        """The id of its effect in the model."""
        return self.view.effects[-1][0] if self.formula else self.effect

    @property
    def axes(self) -> set[str]:
        """The axes on which the effect was added."""
        return {p["axis"] for p in self.view.compared["parameters"] if p["effect"] == self.id}

    @property
    def sizes(self) -> dict[str, str]:
        """The fitted size of its effect in words, by axis."""
        return self.view.sizes.get(self.id, {})

    @property
    def removed(self) -> bool:
        return self.recipe.removed

    @property
    def formula(self) -> str:
        return self.recipe.formula

    @property
    def label(self) -> str:
        """The name of its bar."""
        if self.recipe.held:
            name, _, rest = self.recipe.held.partition(" of ")
            return f"{name} {'held' if ' held at ' in rest else 'fitted again'}"
        return f"without {self.title}" if self.removed else self.title


def doubts_of(steps: Sequence[Step]) -> dict[str, tuple[str, tuple[str, ...]]]:
    """The title of each effect that the steps have added, and what speaks against it; a later step may have proven it."""
    out: dict[str, tuple[str, tuple[str, ...]]] = {}
    for step in steps:
        if step.removed:
            out.pop(step.effect, None)
        elif step.effect:
            out[step.id] = (step.title, step.recipe.doubts)
        out |= {id: (out[id][0], ()) for id in step.recipe.proves if id in out}
    return out


def doubted(steps: Sequence[Step]) -> dict[str, tuple[str, ...]]:
    """The effects of the library that are in the model and in doubt, each with those that it could not be told from."""
    groups = {step.effect: tuple(i for c in step.recipe.cards for i in c.judged["group"]) for step in steps if step.adds}
    return {id: groups.get(id, ()) for id, (_, doubts) in doubts_of(steps).items() if doubts}


def latest(steps: Sequence[Step]) -> Step | None:
    """The step that added the effect which is shown: the last one whose effect the current model has."""
    there = {id for id, _, _ in steps[-1].view.effects} if steps else set()
    return next((s for s in reversed(steps) if s.adds and s.id in there), None)


@dataclass(frozen=True)
class Models:
    """The sequences by name, the name of the one that is shown, and the files of the runs that are left out."""

    of: Mapping[str, tuple[Recipe, ...]] = field(default_factory=lambda: {FIRST_NAME: (Recipe(START),)})
    current: str = FIRST_NAME
    excluded: frozenset[str] = frozenset()

    def with_current(self, name: str, recipes: tuple[Recipe, ...]) -> Models:
        return replace(self, of={**self.of, name: recipes}, current=name)


def read_models(session: Path) -> Models:
    """The models kept with a session; the first one alone if there are none or the file cannot be read."""
    try:
        raw = json.loads((session / FILE).read_text(encoding="utf-8"))
        of = {str(name): tuple(map(KEPT.validate_python, recipes)) for name, recipes in raw["models"].items() if recipes}
        found = Models(of, str(raw["current"]), frozenset(map(str, raw["excluded"])))
    except (*UNREADABLE, KeyError, TypeError, AttributeError, ValidationError):
        return Models()
    return found if raw.get("format") == FORMAT and found.current in found.of else Models()


def write_models(session: Path, models: Models) -> str:
    """Write the file of a session. Returns what went wrong, in words, or an empty text."""
    content = {
        "format": FORMAT, "current": models.current, "excluded": sorted(models.excluded),
        "models": {name: [asdict(recipe) for recipe in recipes] for name, recipes in models.of.items()},
    }  # fmt: skip
    try:
        replace_text(session / FILE, json.dumps(content, indent=1), durable=False)
    except (OSError, GyrocalError) as error:
        return f"The models cannot be kept with the session ({error}); save the model file instead."
    return ""
