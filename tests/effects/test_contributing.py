"""The worked example of CONTRIBUTING.md: one file makes an effect that is planted, fitted, diagnosed and printed."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.effects.base import Effect, effect, effects, load
from gyrocal.present import effect_pages
from gyrocal.simulation.simulate import simulate
from known import without_evidence

from .checks import check_case

TEXT = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def wobble(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Effect]:
    """The example's effect, in the library as long as these tests run."""
    folder = tmp_path_factory.mktemp("effects")
    (source,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    (folder / "table_wobble.py").write_text(source, encoding="utf-8")
    (effect_id,) = load(folder)
    yield effect(effect_id)
    del effects()[effect_id]


def test_what_is_planted_is_recovered(wobble: Effect) -> None:
    for case in wobble.cases:
        check_case(wobble, case)


@pytest.mark.wide
def test_it_is_diagnosed_where_it_acts(wobble: Effect) -> None:
    session, _ = simulate(None, "full", [wobble.id], seed=4, scenarios=2, seconds=10.0)
    with without_evidence():  # which weighs no wave
        found = diagnose(session)
    assert found.best is not None
    assert (found.verdict, found.best.effect.id) == ("add", wobble.id)
    assert {c.axis for c in found.candidates if c.effect.id == wobble.id and c.decision == "add"} == {"x", "y"}


def test_it_has_a_page(wobble: Effect) -> None:
    pages = effect_pages.pages()
    assert f"{wobble.id}.svg" in pages
    page = pages[f"{wobble.id}.md"]
    assert wobble.cause in page
    assert f"gyrocal simulate demo --campaign full --effect {wobble.id}:amplitude=0.002" in page
    assert f"[{wobble.id}]({wobble.id}.md)" in pages["README.md"]
