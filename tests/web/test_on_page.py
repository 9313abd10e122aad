"""The page names its fields and buttons where the command line names its options."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from gyrocal import calibration, gravity, plausibility, recording
from gyrocal.present.report import BLOCKED
from gyrocal.web.state.on_page import on_page

FOLDERS = (plausibility, recording, calibration, gravity)
BARE = re.compile(r"(?<!gyrocal import )(?<!gyrocal calibrate )--[a-z]")


def texts(path: Path) -> Iterator[str]:
    """Every text in a file of which a part may be an option, with "1" for what is put in."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    prose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    parts = {id(v) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for v in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(v.value) if isinstance(v, ast.Constant) else "1" for v in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and not {id(node)} & (prose | parts):
            yield node.value


def told() -> list[str]:
    files = [path for folder in FOLDERS for path in Path(str(folder.__file__)).parent.rglob("*.py")]
    return [text for path in files for text in texts(path) if re.search(r"\s--[a-z]|\(--[a-z]", text)]


def test_no_text_names_an_option_alone() -> None:
    """Warnings said "--map gz_dps=COLUMN:rad/s" beside a field for it."""
    assert len(told()) > 20
    assert [text for text in map(on_page, told()) if BARE.search(text)] == []


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("Give the unit when importing (--map gz_dps=COLUMN:rad/s), or", "importing (the line gz_dps=COLUMN:rad/s), or"),
        ("Check the unit of --map, and record a known turn", "Check the unit of its columns, and record a known turn"),
        ("the size of one count (--lsb-dps when importing)", "the size of one count (the field one count when importing)"),
        ("then make a run of each part (--run when importing)", "(gyrocal import --run when importing)"),
        ("put the limit into the model (gyrocal add saturation)", "into the model (under Diagnose, Try any effect)"),
        ("calibrate, and calibrate --method model", "calibrate, and gyrocal calibrate --method model"),
        (BLOCKED, "overrule them by Accept it."),
    ],
)  # fmt: skip
def test_an_option_becomes_a_field_or_a_command(said: str, shown: str) -> None:
    assert shown in on_page(said)
