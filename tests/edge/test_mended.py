"""Wrong names of earlier states of the code, on the sessions of their frozen parts, which are drawn again by their trees."""

from pathlib import Path

import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.error_model.model import Model
from gyrocal.recording.session import Session

from . import drawn, frozen, recording

pytestmark = pytest.mark.slow


FURTHER = [
    ("faef2cfe865fed675a15567614ebdc332d65a97d", "misspecified", 79, ("bias_temperature", "y")),  # a hysteresis
    ("07d9a76fcadf1b7f2644d47fb648ff0454b586b7", "edge", 6, ("table_ripple", "z")),  # a tone of one size at three rates
    ("07d9a76fcadf1b7f2644d47fb648ff0454b586b7", "misspecified", 58, ("table_ripple", "y")),  # friction, of another size
]


@pytest.mark.wide
@pytest.mark.parametrize(
    ("tree", "kind", "number", "wrong"),
    [
        ("a7d2e8c034282d08d3463b721ed145ef23865264", "null", 11, ("vibration_tone", "z")),  # a line of the encoder's angle
        ("a7d2e8c034282d08d3463b721ed145ef23865264", "misspecified", 30, ("table_ripple", "z")),  # a magnet beside the table
        *(pytest.param(tree, kind, number, wrong, marks=pytest.mark.wide) for tree, kind, number, wrong in FURTHER),
    ],
)
def test_it_is_not_named_again(
    tree: str, kind: str, number: int, wrong: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(frozen.TREE, tree)
    case = drawn.Draw("frozen", kind, number).case()
    recording.write(case.made, case.readings, tmp_path / "session", case.random)
    effect_id, axis = wrong
    found = diagnose(Session.open(tmp_path / "session"), Model.builtin("default").about(axis))
    assert effect_id not in {c.effect.id for c in found.candidates if c.named}
