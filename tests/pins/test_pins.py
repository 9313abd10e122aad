"""The commands answer as recorded: words and structure exactly, figures within their errors (``record.py`` records again)."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from . import kept
from .compare import agree, differences, figure, same, with_quarters
from .record import HERE, SESSIONS, check, command

KILOBYTES = 50
SLOW = ("paper", "swing", "bench", "table2", "full", "rest", "noisy")
"""Sessions whose answers take nine tenths of the time of all."""
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("known_answers")]


@pytest.fixture(scope="module")
def rest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the session at rest, of which several tests ask."""
    folder = tmp_path_factory.mktemp("pins")
    SESSIONS["rest"](folder / "rest")
    return folder


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.wide] * (name in SLOW)) for name in SESSIONS])
def test_answers_are_as_recorded(name: str, rest: Path, tmp_path: Path, require_tool) -> None:
    require_tool("cc")
    assert check(name, rest if name == "rest" else tmp_path) == []


def test_the_pins_are_small() -> None:
    assert sum(path.stat().st_size for path in HERE.glob("*.json")) < 1000 * KILOBYTES


def test_structure_and_words_are_exact() -> None:
    pinned = {"verdict": "add", "n": 3, "list": ["1", "2"], "none": None, "sure": True}
    assert list(differences(pinned, copy.deepcopy(pinned))) == []
    changes: list[dict[str, Any]] = [
        {"verdict": "reject"}, {"n": 4}, {"n": "3"}, {"list": ["1"]}, {"list": ["2", "1"]}, {"none": 0}, {"sure": 1},
        {"new": 1},
    ]  # fmt: skip
    for change in changes:
        assert len(list(differences(pinned, pinned | change))) >= 1, change
    assert sorted(differences(pinned, {})) == sorted(f"/{key}: is missing" for key in pinned)


@pytest.mark.parametrize("value", [0.0051, -6.52, 43700.0, 0.0, 1e-9])
@pytest.mark.parametrize("error", [0.0003, 0.0996, 1.04e-5, 210.0])
def test_a_figure_is_the_same_within_one_error_and_not_at_two(value: float, error: float) -> None:
    text = f"scale {figure(value, error)} bias"
    for near in (0.0, 0.8, -0.8):
        assert same(text, f"scale {figure(value + near * error, error)} bias"), near
    for far in (1.2, 2.0, -2.0):
        assert not same(text, f"scale {figure(value + far * error, error)} bias"), far
    assert same(text, f"scale {figure(value, 1.15 * error)} bias")
    for other in (0.5, 2.0):
        assert not same(text, f"scale {figure(value, other * error)} bias"), other
    assert not same(text, f"bias {figure(value, error)} scale")
    assert not same(text, f"scale {value} bias")


def test_a_figure_keeps_two_digits_of_its_error() -> None:
    assert figure(0.00508053, 0.00031279) == "0.00508±0.00031"
    assert figure(-43748.2, 1260.0) == "-43700±1300"
    assert figure(0.0, 0.0) == figure(0.0) == "0±0"
    assert figure(2.0) == "2±0.5"
    assert agree(0.0, 0.0, 0.0, 0.0)
    assert not agree(0.0, 0.0, 1e-6, 0.0)
    assert with_quarters("#define V 0.1.0 {1.5f, -2.0e-3, 7}") == "#define V 0.1.0 {1.5±0.38f, -0.002±0.0005, 7}"


Change = Callable[[Any], None]


def raw(*arguments: str) -> Any:
    code, text = command(*arguments, "--json")
    assert code == 0
    return json.loads(text)


@pytest.fixture(scope="module")
def answers(rest: Path) -> dict[Callable[[Any], Any], Any]:
    """What commands say of one session, by what is kept of it."""
    path, model = rest / "rest", rest / "another_model.toml"
    return {
        kept.of_compare: raw("compare", str(path)),
        kept.of_diagnose: raw("diagnose", str(path)),
        kept.of_explain: raw("explain", str(path), "--model", str(model)),
    }


def moved(key: str, error: str, errors: float) -> Change:
    """A figure of an answer, moved by so many of its errors."""
    return lambda of: of.update({key: of[key] + errors * of[error]})


def moved_level(key: str, errors: float) -> Change:
    """Rms or floor, moved by what so many errors of the excess are of it."""
    return lambda of: of.update({key: of[key] + errors * of["excess_dps"] * of["excess_se_dps"] / of[key]})


def of_first(change: Change) -> Change:
    """A change of the first candidate."""
    return lambda said: change(said["candidates"][0])


WARNING = {"code": "clipped", "axis": "z", "file": None, "blocking": False}
FINDING = {"axis": "x", "against": "time", "strength": 4.0}
CHANGES: dict[Callable[[Any], Any], list[Change]] = {
    kept.of_compare: [
        lambda said: said.update(verdict="adequate"),
        lambda said: said["model"].append("lag"),
        lambda said: said["warnings"].append(WARNING),
        lambda said: said["where"].append(FINDING),
        lambda said: said["where"][0].update(against="time"),
        lambda said: said["where"][0].update(strength=said["where"][0]["strength"] + 2.0),
        lambda said: said["parameters"].pop(),
        lambda said: said["parameters"][0].update(name="scale"),
        lambda said: said["parameters"][0].update(se=2 * said["parameters"][0]["se"]),
        lambda said: moved("value", "se", 2.0)(said["parameters"][0]),
        moved_level("rms_dps", 2.0),
        moved_level("floor_dps", -2.0),
        moved("excess_dps", "excess_se_dps", 2.0),
        moved("excess_within_dps", "excess_within_se_dps", -2.0),
    ],
    kept.of_diagnose: [
        lambda said: said.update(verdict="ambiguous"),
        lambda said: said.update(unknown={"axis": "z", "against": "time", "shape": [], "amplitude_dps": 0.1}),
        lambda said: said["candidates"].pop(),
        lambda said: said["candidates"][-1].update(decision="reject"),
        of_first(lambda c: c.update(effect="drift")),
        of_first(lambda c: c.update(axis="x")),
        of_first(lambda c: c.update(decision="suggest")),
        of_first(lambda c: c.update(group=["drift"])),
        of_first(moved("heldout_gain", "heldout_gain_se", -2.0)),
        of_first(moved("excess_drop_dps", "excess_drop_se_dps", 2.0)),
        of_first(lambda c: moved("value", "se", 2.0)(next(iter(c["parameters"].values())))),
    ],
    kept.of_explain: [
        lambda said: said.update(verdict="unknown"),
        lambda said: said["steps"].append(said["steps"][0]),
        lambda said: said["steps"][0].update(effects=["drift"]),
        lambda said: said["steps"][0].update(matters=False),
        lambda said: said["left"].append({"group": ["drift"], "axis": "z"}),
        lambda said: moved("value", "se", 2.0)(said["parameters"][0]),
    ],
}  # fmt: skip
SMALL: dict[Callable[[Any], Any], list[Change]] = {
    kept.of_compare: [
        lambda said: moved("value", "se", 0.5)(said["parameters"][0]),
        lambda said: said["where"][0].update(strength=said["where"][0]["strength"] - 0.5),
        moved("excess_dps", "excess_se_dps", 0.5),
        lambda said: said.update(added_key=1),
    ],
    kept.of_diagnose: [
        of_first(moved("heldout_gain", "heldout_gain_se", 0.5)),
        of_first(lambda c: c.update(next_measurement="another sentence")),
        lambda said: said["candidates"].append(said["candidates"].pop(-2)),
    ],
    kept.of_explain: [lambda said: moved("value", "se", 0.5)(said["parameters"][0])],
}


@pytest.mark.parametrize("keep", CHANGES)
def test_what_changes_in_an_answer_is_seen_and_what_moves_within_an_error_is_not(
    keep: Callable[[Any], Any], answers: dict[Callable[[Any], Any], Any]
) -> None:
    said = answers[keep]
    pinned = json.loads(json.dumps(keep(said)))
    for changes, seen in ((CHANGES[keep], True), (SMALL[keep], False)):
        for i, change in enumerate(changes):
            other = copy.deepcopy(said)
            change(other)
            found = list(differences(pinned, keep(other)))
            assert bool(found) == seen, (i, found)
