"""Facts of a run from the name of its file: ``s003_down_-78dps.csv`` is face down, -78 deg/s, scenario s003."""

from __future__ import annotations

import re
from typing import Any

PATTERNS: tuple[tuple[str, str], ...] = (
    ("face", r"(?:face[-_ =]?)?(up|down)"),
    ("table_rate_dps", r"(?:rate[-_ =]?)?([-+]?\d+(?:\.\d+)?) ?(?:dps|degs)"),
    ("table_rate_dps", r"rate[-_ =]?([-+]?\d+(?:\.\d+)?)"),
    ("axis", r"(?:axis[-_ =]?)?([xyz])"),
    ("scenario", r"(?:scenario|cycle)[-_ =]?(\w+?)"),
    ("scenario", r"(s\d+)"),
    ("day", r"day[-_ =]?(\d+)"),
)
"""Key of ``[[run]]``, and what between two separators of the name gives its value."""
REST = r"rest|static|still|stationary"


def labels_of(stem: str) -> dict[str, Any]:
    """The run's keys that a file's name without its ending states; what it states twice differently is left out."""
    found: dict[str, set[str]] = {}
    for key, pattern in PATTERNS:
        for match in re.finditer(rf"(?:^|[_ .,]|(?<=[A-Za-z])-){pattern}(?=$|[-_ .,])", stem, re.IGNORECASE):
            found.setdefault(key, set()).add(match[1].lower() if key in ("face", "axis") else match[1])
    if re.search(rf"(?:^|[-_ .,])(?:{REST})(?=$|[-_ .,])", stem, re.IGNORECASE):
        found.setdefault("table_rate_dps", {"0"})
    return {key: next(iter(values)) for key, values in found.items() if len(values) == 1}
