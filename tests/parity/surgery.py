"""A header with one wrong number in it: what a comparison must notice."""

import re
from pathlib import Path

from gyrocal_firmware import INCLUDE

WEIGHTS = INCLUDE / "weights.h"


def with_largest_negated(array: str, folder: Path) -> Path:
    """``weights.h`` as it ships, but for the sign of the largest number of one of its arrays, written into ``folder``."""
    text = WEIGHTS.read_text()
    found = re.search(rf"{array}\[\d+\] = {{(.*?)}};", text, re.S)
    assert found is not None
    values = re.findall(r"[^\s,]+", found[1])
    at = max(range(len(values)), key=lambda i: abs(float(values[i].rstrip("f"))))
    values[at] = values[at][1:] if values[at].startswith("-") else "-" + values[at]
    broken = folder / "weights.h"
    broken.write_text(text[: found.start(1)] + ", ".join(values) + text[found.end(1) :])
    return broken
