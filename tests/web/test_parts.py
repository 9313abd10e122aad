"""The checks of an effect as a picture: what only resembles it is of another size in some half of the recordings."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gyrocal.web.pictures import charts
from gyrocal.web.pictures.small_picture import checks_svg
from gyrocal.web.values.models import Recipe, doubted, doubts_of
from gyrocal.web.values.residual_plots import panels
from gyrocal.web.values.views import Card, Halves
from gyrocal.web.worker.effect_picture import picture
from gyrocal.web.worker.size_in_parts import halves


def recordings(cold: float, warm: float) -> tuple[np.ndarray, dict[str, Any]]:
    """A signal over eight runs, and residuals that hold it with one size where it is cold and another where it is warm."""
    rng = np.random.default_rng(1)
    run = np.repeat(np.arange(8), 100)
    of: dict[str, Any] = {panel.key(axis): np.full(800, np.nan) for panel in panels() for axis in "xyz"}
    warmth = 20.0 + 10.0 * (run >= 4) + rng.normal(0, 0.1, 800)
    signal = np.sin(np.arange(800) / 3.0)
    y = signal * np.where(run >= 4, warm, cold) + rng.normal(0, 0.3, 800)
    time = np.tile(np.arange(100.0), 8)
    of |= {"run": run, "z": y, "temperature": warmth, "time": time, "rate_z": np.where(run % 2 == 0, 78.0, -78.0)}
    return signal, of


@pytest.mark.parametrize(("cold", "warm"), [(1.0, 1.0), (1.5, 0.5)])
def test_sizes_are_those_of_the_halves(cold: float, warm: float) -> None:
    signal, of = recordings(cold, warm)
    found = {h.names: h for h in halves("z", signal, of)}
    assert set(found) == {("first half of each run", "last half"), ("one direction", "the other"), ("cold", "warm")}
    by_warmth = found["cold", "warm"]
    assert by_warmth.sizes == pytest.approx((cold, warm), abs=4 * max(by_warmth.se))
    assert max(by_warmth.se) < 0.1
    in_time = found["first half of each run", "last half"]
    assert abs(in_time.sizes[0] - in_time.sizes[1]) < 4 * np.hypot(*in_time.se)


def test_a_variable_that_does_not_vary_parts_nothing() -> None:
    signal, of = recordings(1.0, 1.0)
    of["temperature"] = np.full(800, 25.0)
    assert ("cold", "warm") not in {h.names for h in halves("z", signal, of)}


def test_a_table_that_turns_one_way_has_no_other_direction() -> None:
    signal, of = recordings(1.0, 1.0)
    of["rate_z"] = np.where(of["run"] % 2 == 0, 78.0, 0.0)
    assert ("one direction", "the other") not in {h.names for h in halves("z", signal, of)}


def test_the_picture_of_the_checks_has_words_for_those_who_do_not_see_it() -> None:
    told = checks_svg(0.97, [Halves(("cold", "warm"), (1.5, 0.5), (0.05, 0.06))])
    assert 'aria-label="checks: share 97 %; cold 1.50, warm 0.50"' in told
    assert told.count("<circle") == 2
    places = [float(part.split('"')[0]) for part in told.split('<circle cx="')[1:]]
    assert places[0] > places[1]
    assert checks_svg(None, []) == ""


def test_before_and_after_lie_over_each_other() -> None:
    signal, of = recordings(1.0, 1.0)
    of["z"] = 0.01 * of["z"]  # told in mdps
    shown = picture("z", 0.01 * signal, of, {k: f"{k:03d}_up.csv" for k in range(8)})
    assert shown is not None
    flat = [0.0] * len(shown.centres)
    drawn = {added: charts.hero(charts.LIGHT, shown, flat, flat, ["words"], added=added) for added in (True, False)}
    dots = {added: next(s["data"] for s in o["series"] if s["name"] == charts.BEFORE) for added, o in drawn.items()}
    assert [y for _, y in dots[True]] == pytest.approx(shown.left, rel=1e-5, abs=1e-5)
    assert dots[False] == []  # the series stays, so that undo empties it


def test_what_a_later_step_proves_is_in_doubt_no_more() -> None:
    """Asymmetry that was added before the sensitivity to gravity stayed \"not proven\" for ever."""
    def step(recipe: Recipe) -> Any:
        return SimpleNamespace(
            recipe=recipe, effect=recipe.effect, id=recipe.effect, title=recipe.title, removed=False, adds=bool(recipe.effect)
        )

    judged = {"effect": "scale_asymmetry", "group": ["scale_asymmetry", "centripetal"]}
    card = Card(judged, "Asymmetry", "", "", [], "", ["it cannot be told"], False)
    first = step(Recipe("a", "scale_asymmetry", "Asymmetry", doubts=("it cannot be told",), cards=(card,)))
    assert doubted([first]) == {"scale_asymmetry": ("scale_asymmetry", "centripetal")}
    second = step(Recipe("b", "g_sensitivity", "Gravity", proves=("scale_asymmetry",)))
    assert doubts_of([first, second])["scale_asymmetry"] == ("Asymmetry", ())
    assert doubted([first, second]) == {}
    assert doubted([first]) != {}, "undo takes the proof back"
