"""The commands answer as recorded: every decision, integer and key, floats to 1e-9 (``record.py`` makes the files again)."""

from pathlib import Path

import pytest

from .record import SAME_MACHINE_REL, SESSIONS, check, differences, without_sentences


@pytest.mark.parametrize("name", SESSIONS)
def test_answers_are_as_recorded(name: str, tmp_path: Path, require_tool) -> None:
    require_tool("cc")
    assert check(name, tmp_path) == []


def test_a_difference_is_seen() -> None:
    pinned = {"verdict": "add", "n": 3, "value": 1.0, "list": [1, 2], "none": None}
    assert list(differences(pinned, pinned | {"added": 1}, SAME_MACHINE_REL)) == []
    assert list(differences(pinned, pinned | {"value": 1.0 + 1e-10}, SAME_MACHINE_REL)) == []
    for change in ({"verdict": "reject"}, {"n": 4}, {"value": 1.0 + 1e-8}, {"list": [1]}, {"none": 0.0}, {"n": "3"}):
        assert len(list(differences(pinned, pinned | change, SAME_MACHINE_REL))) == 1
    assert list(differences(pinned, {}, SAME_MACHINE_REL)) == [f"/{key}: is missing" for key in pinned]


def test_sentences_are_not_recorded() -> None:
    assert without_sentences({"where": [{"axis": "z", "note": "a sentence"}]}) == {"where": [{"axis": "z"}]}
