"""What the lines above a table state in words: the rate of its samples, and the unit of its rates."""

from __future__ import annotations

import re
from collections.abc import Sequence

from gyrocal.recording.column_names import UNIT_WORDS

RATE = (
    r"(?:sampl\w*|update|output|data|frame|imu|odr)[ _-]*(?:data[ _-]*)?(?:rate|freq\w*)|fs|odr"
    r"|samples? per s(?:ec(?:ond)?)?"
)
"""Words of the rate of samples."""
BETWEEN = r"[ _]*[(\[]?(?:k?hz)?[)\]]?[\"' ]*[:=,;\t ]+[\"' ]*"
NUMBER = rf"(?i)(?:^|[^a-z])(?:{RATE}){BETWEEN}(\d+(?:\.\d+)?) *(k?)(?:hz|sps|$|[^\d.a-z])"
OTHERS = r"(?i)acc|mag|baro|press|gps|gnss|temp|emg|ecg|video|camera"
"""Words of other instruments: a line with one of them, and none of a gyroscope, states nothing about this."""
GYROSCOPE = r"(?i)gyr|angular|rotation|omega"
UNITS = r"(?i)\bunits?\b"
SIZES = r"(?i)range|scale|sensitiv|resolution|bandwidth|noise|bias|fsr?\b|lsb"
"""Words of lines whose numbers have a unit of their own, which is not that of the readings."""


def rate_hz(lines: Sequence[str]) -> float | None:
    """The sample rate, Hz, that lines state; None if none does, or if they differ."""
    found = set()
    for line in lines:
        if re.search(OTHERS, line) and not re.search(GYROSCOPE, line):
            continue
        found |= {float(number) * (1e3 if kilo else 1.0) for number, kilo in re.findall(NUMBER, line)}
    return found.pop() if len(found) == 1 and min(found) > 0 else None


def unit_of_rates(lines: Sequence[str]) -> str | None:
    """The unit of a gyroscope's rates that lines of it, or of units in general, state; None if none does, or if they differ."""
    lines = [line for line in lines if not re.search(SIZES, line)]
    for words in (GYROSCOPE, UNITS):
        found = {unit for line in lines if re.search(words, line) for unit in _units(line)}
        if found:
            return found.pop() if len(found) == 1 else None
    return None


def _units(line: str) -> set[str]:
    """The units of rates among the words of a line; of a list with slashes, as ``seconds/meters/radians``, each is one."""
    words = [word.strip(".") for word in re.split(r"[\s,;:()\[\]\"'=]+", line.lower())]
    each = [part for word in words for part in (word.split("/") if word.count("/") > 1 else [word])]
    return {unit for part in each for unit, known in UNIT_WORDS["gyro"].items() if re.fullmatch(known, part)}
