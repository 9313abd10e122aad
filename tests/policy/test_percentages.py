"""A part of a whole in percent: 100% is said of the whole alone, and 0% has no sign."""

import re
from pathlib import Path

import numpy as np
import pytest

from gyrocal.digits import percentage

HOST = Path(__file__).resolve().parents[2] / "host/gyrocal"
NOT_A_PART = {
    "calibrate.py", "references.py", "scales.py", "sizes.py", "hands.py",  # errors, and a scatter of the scale
    "doubt.py",  # limits of the policy
    "guide.py", "budget.py",  # forms of errors, and the widths of bars
}  # fmt: skip


@pytest.mark.parametrize(
    ("part", "decimals", "words"),
    [
        (1.0, 0, "100%"), (1.0, 1, "100.0%"), (0.9996, 0, "99.96%"), (0.9996, 1, "99.96%"), (0.996, 0, "99.6%"),
        (0.994, 0, "99%"), (0.994, 1, "99.4%"), (1 - 1e-9, 0, "more than 99.999%"), (1 - 2e-5, 1, "99.998%"),
        (0.5, 0, "50%"), (0.0, 0, "0%"), (-0.004, 0, "0%"), (-0.17, 0, "-17%"),
    ],
)  # fmt: skip
def test_percentages(part: float, decimals: int, words: str) -> None:
    assert percentage(part, decimals) == words


@pytest.mark.parametrize("decimals", [0, 1])
def test_less_than_the_whole_is_never_told_as_the_whole(decimals: int) -> None:
    for left in np.geomspace(1e-14, 0.5, 400):
        told = percentage(1 - left, decimals)
        number = float(told.removeprefix("more than ").removesuffix("%"))
        assert number < 100
        assert number <= 100 * (1 - left) if told.startswith("more") else abs(number - 100 * (1 - left)) <= 50 * left + 0.5


def test_no_sentence_rounds_a_part_by_itself() -> None:
    own = re.compile(r":\.\d%\}")
    found = [p.name for p in HOST.rglob("*.py") if own.search(p.read_text(encoding="utf-8"))]
    assert set(found) <= NOT_A_PART
