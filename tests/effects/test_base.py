"""The base class asks few questions, and several effects answer each of them in a way of their own. All else is data."""

from types import FunctionType

import pytest

from gyrocal.effects.base import Effect, effects

MOST = 13
LEAST = 4
FEW = {
    "lacks": "the shapes that residuals are held against lack a variable; of the effects, a drift alone can be removed without "
    "what shows it",
    "noise": "only the rate, alone or times the temperature, and the temperature are measured with a noise that matters",
    "refinement": "only the frequency of a tone and the edge of a dead band are told far more finely than by a factor",
}
"""Questions that fewer effects answer in a way of their own, each with the reason why it is no data."""


def questions() -> dict[str, FunctionType | property]:
    """What an effect may answer in another way than the base class."""
    own = {name: value for name, value in vars(Effect).items() if isinstance(value, FunctionType | property)}
    return {name: value for name, value in own.items() if name[0] != "_" and not getattr(value, "__final__", False)}


def test_an_effect_may_answer_few_questions() -> None:
    assert len(questions()) <= MOST, sorted(questions())


@pytest.mark.parametrize("name", sorted(questions()))
def test_several_effects_answer_each_question_in_a_way_of_their_own(name: str) -> None:
    built_in = [type(kind) for kind in effects().values() if type(kind).__module__.startswith("gyrocal.effects.")]
    own = [kind.__name__ for kind in built_in if getattr(kind, name) is not getattr(Effect, name)]
    assert (len(own) < LEAST) == (name in FEW), own


@pytest.mark.parametrize("kind", effects().values(), ids=lambda kind: kind.id)
def test_what_follows_from_data_is_the_same_for_every_effect(kind: Effect) -> None:
    fixed = [name for name, value in vars(Effect).items() if getattr(value, "__final__", False)]
    assert len(fixed) > 5
    assert [name for name in fixed if getattr(type(kind), name) is not getattr(Effect, name)] == []
