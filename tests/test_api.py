"""The Python interface's five lines."""

from gyrocal.api import Model, compare, diagnose, simulate


def test_the_steps_of_the_readme() -> None:
    session, _ = simulate(None, "paper", ["table_ripple"], 3, scenarios=3, seconds=12.0)
    model = Model.open("default")
    best = diagnose(session, model).best
    assert best is not None
    model = model.add(best.effect.id, best.axis)
    assert model.ids[-1] == "table_ripple"
    assert compare(session, model).verdict == "adequate"
