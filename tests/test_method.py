"""The page on the method states every threshold that it names as the policy has it."""

import re
from dataclasses import asdict
from pathlib import Path

from gyrocal.policy import POLICY

PAGE = Path(__file__).parents[1] / "docs" / "method.md"
STATED = re.compile(r"`(\w+)`(?:,\s+|\s+\()([\d.]+(?:e-?\d+)?)\)")


def test_thresholds_have_the_values_of_the_policy() -> None:
    values = asdict(POLICY)
    stated = [(name, float(value)) for name, value in STATED.findall(PAGE.read_text(encoding="utf-8")) if name in values]
    assert len({name for name, _ in stated}) > 40
    assert [(name, value) for name, value in stated if value != values[name]] == []
