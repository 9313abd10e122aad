"""Effects of installed packages and of a user's own classes: known by their ids, and named where they are missing."""

import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from gyrocal.api import Effect, InputError, Model, effects, load_effects
from gyrocal.effects import base, packages
from gyrocal.effects.base import Parameter

SOURCE = '''
import numpy as np
from gyrocal.effects.base import Effect, Parameter

class HumOfLamp(Effect):
    id = "hum_of_lamp"
    title = "A lamp's hum"
    cause = "The lamp above the table hums."
    equation = "k"
    looks_like = "bias"
    measure_next = "the same without the lamp"
    parameters = (Parameter("k", "dps", (0.01, 0.1), "a lamp"),)
    linear = ("k",)

    def columns(self, run, axis, values):
        return np.ones((len(run), 1))
'''


@pytest.fixture
def fresh() -> Iterator[None]:
    """The list of effects read anew, before and after."""
    base.effects.cache_clear()
    packages.packages.cache_clear()
    yield
    base.effects.cache_clear()
    packages.packages.cache_clear()


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh: None) -> Iterator[Path]:
    """A package `lamps` whose entry point names the module lamp_effects."""
    (tmp_path / "lamp_effects.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(tmp_path)

    class Dist:
        name = "lamps"

    def points(group: str) -> list[Any]:
        point = EntryPoint("lamps", "lamp_effects", group)
        vars(point).update(dist=Dist())
        return [point] if group == "gyrocal.effects" else []

    monkeypatch.setattr(packages, "entry_points", points)
    yield tmp_path
    sys.modules.pop("lamp_effects", None)


@pytest.mark.usefixtures("installed")
def test_a_package_brings_effects_and_its_models_name_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert repr(effects()["hum_of_lamp"]) == "<HumOfLamp: k>"
    Model.open("default").add("hum_of_lamp", "z").save(tmp_path / "m.toml")
    assert 'id = "hum_of_lamp", axis = "z", package = "lamps"' in (tmp_path / "m.toml").read_text()
    assert Model.open(tmp_path / "m.toml").ids[-1] == "hum_of_lamp"
    monkeypatch.setattr(packages, "entry_points", lambda group: [])
    base.effects.cache_clear()
    packages.packages.cache_clear()
    with pytest.raises(InputError, match="is of the package lamps, which is not installed: pip install lamps"):
        Model.open(tmp_path / "m.toml")


def test_a_package_that_fails_is_named(installed: Path) -> None:
    (installed / "lamp_effects.py").write_text("import nothing_of_this_name")
    with pytest.raises(InputError, match=r"the package lamps with effects fails \(ModuleNotFoundError: No module named"):
        effects()


class Hum(Effect):
    id = "hum"
    title, cause, equation, looks_like, measure_next = "Hum", "A hum.", "k", "bias", "silence"
    parameters = (Parameter("k", "dps", (0.01, 0.1), "a hum"),)
    linear = ("k",)

    def columns(self, run: Any, axis: int, values: Any) -> Any:
        raise NotImplementedError


@pytest.mark.usefixtures("library")
def test_a_class_is_added_and_known_from_then_on(tmp_path: Path) -> None:
    model = Model.open("default").add(Hum, "x")
    model.save(tmp_path / "m.toml")
    assert Model.open(tmp_path / "m.toml").term("hum", "x") is not None
    assert isinstance(effects()["hum"], Hum)
    assert model.add(Hum(), "y").ids == model.ids

    class Again(Hum):
        """The class defined anew, as in a notebook."""

    assert Model.open("default").add(Again).terms[-1].effect is effects()["hum"]
    assert isinstance(effects()["hum"], Again)


@pytest.mark.usefixtures("library")
def test_a_class_does_not_take_the_place_of_an_effect_of_the_library() -> None:
    class Bias(Hum):
        id = "bias"

    with pytest.raises(InputError, match="its id 'bias' is that of an effect of the library; give it another id"):
        Model.open("default").add(Bias)
    with pytest.raises(InputError, match="axis is 'w', not x, y or z"):
        Model.open("default").add(Hum, "w")


@pytest.mark.usefixtures("library")
def test_effects_are_loaded_from_a_folder(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(SOURCE.replace("hum_of_lamp", "my_hum"))
    assert load_effects(tmp_path) == ["my_hum"]
    assert "my_hum" in effects()
    with pytest.raises(InputError, match="no such folder of effects"):
        load_effects(tmp_path / "nowhere")
