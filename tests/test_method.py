"""The pages on the method state every threshold that they name as the policy has it."""

import re
from dataclasses import asdict
from pathlib import Path

from gyrocal.policy import POLICY

DOCS = Path(__file__).parents[1] / "docs"
PAGES = [DOCS / "method.md", *sorted((DOCS / "details").glob("*.md"))]
STATED = re.compile(r"`(\w+)`(?:,\s+|\s+\()([\d.]+(?:e-?\d+)?)\)")
MOST_LINES = 350
"""Of the page that a reader without knowledge of gyrocal reads from the top."""


def test_thresholds_have_the_values_of_the_policy() -> None:
    values = asdict(POLICY)
    texts = [page.read_text(encoding="utf-8") for page in PAGES]
    stated = [(name, float(value)) for text in texts for name, value in STATED.findall(text) if name in values]
    assert len({name for name, _ in stated}) > 40
    assert [(name, value) for name, value in stated if value != values[name]] == []


def test_the_method_is_read_in_one_sitting() -> None:
    assert len(PAGES[0].read_text(encoding="utf-8").splitlines()) <= MOST_LINES
