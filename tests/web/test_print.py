"""Printed on A4: no header without rows, no rows without a header, no line of a file broken, no page nearly empty."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gyrocal.present import page
from gyrocal.present.report import PARAMETERS, WHERE

LEAST_LINES = 8
"""A page of fewer lines of text and without a picture is nearly empty."""


@pytest.fixture
def printed(chromium: Any, require_tool: Callable[[str], str], tmp_path: Path) -> Callable[[str], list[str]]:
    """`printed(html)` prints a page as PDF and gives the text of each sheet as it is laid out."""
    pdftotext = require_tool("pdftotext")

    def sheets(text: str) -> list[str]:
        (tmp_path / "page.html").write_text(text, encoding="utf-8")
        opened = chromium.new_page()
        opened.goto((tmp_path / "page.html").as_uri())
        opened.pdf(path=tmp_path / "page.pdf", format="A4", print_background=True)
        opened.close()
        command = [pdftotext, "-layout", str(tmp_path / "page.pdf"), "-"]
        told = subprocess.run(command, capture_output=True, text=True, check=True)
        return told.stdout.removesuffix("\f").split("\f")

    return sheets


def report(parameters: int, findings: int) -> str:
    rows = [[f"effect_{i}", "z", f"k{i}", "1.00", "0.10", "dps"] for i in range(parameters)]
    where = [["z", "rate", "5.0", f"finding_{i}"] for i in range(findings)]
    return page.render(
        "present/report.html", "session", "It does not fit.", False, (), model="default", held_out="day", levels=[],
        level_columns=("axis:",), where=where, where_columns=WHERE, pictures=[], parameters=rows, parameter_columns=PARAMETERS,
        moved=[], note="", judged_by="",
    )  # fmt: skip


@pytest.mark.parametrize("findings", [1, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35])
def test_a_table_over_several_sheets_has_its_column_names_on_each(
    findings: int, printed: Callable[[str], list[str]]
) -> None:
    """The second table begins anywhere on the sheet, its heading and its names never without two rows."""
    sheets = printed(report(100, findings))
    assert len(sheets) > 1
    for sheet in sheets:
        rows, names = sheet.count("effect_"), sheet.count("parameter ")
        assert (names > 0) == (rows > 0)
        assert rows == 0 or rows > 2
        assert "Parameters" not in sheet or rows > 2


@pytest.mark.parametrize("before", [0, 20, 40])
def test_lines_of_the_model_file_are_not_broken_and_their_caption_stays(
    before: int, printed: Callable[[str], list[str]]
) -> None:
    fitted = "amplitude = 0.1234567891, amplitude_se = 0.000603211696"
    lines = [f'  {{ id = "effect_{i}", axis = "z", {fitted} }},' for i in range(90)]
    lines[3] = lines[3].removesuffix(" },") + ", other_dps = 0.01234567, other_dps_se = 0.0012345678 },"
    text = page.render("web/report.html", "s", "It fits.", True, (), **content("\n".join(lines), before))
    sheets = printed(text)
    (first,) = (sheet for sheet in sheets if "The model file" in sheet)
    assert "effect_1" in first
    every = "\n".join(sheets)
    for line in lines:
        assert line.strip() in every
    for sheet in sheets[:-1]:
        assert len([line for line in sheet.splitlines() if line.strip()]) >= LEAST_LINES


def content(toml: str, rows: int) -> dict[str, Any]:
    """What the report of the page shows, with a table of so many rows before the model file and nothing else."""
    from gyrocal.web.worker.report import columns

    return {
        "facts": [], "held_out": "day", "unseen": lambda unit: "", "fall": None, "levels": [], "level_columns": ("axis:",),
        "where": [], "story": [], "missing": [], "missing_said": "", "pictures": [], "parameters": [],
        "parameter_columns": PARAMETERS, "correlations": [], "calibration": None, "commands": [], "toml": toml,
        "runs": [[f"{i:03d}.csv", "s000", "", "up", "z", "78", "10"] for i in range(rows)], "columns": columns,
    }  # fmt: skip
