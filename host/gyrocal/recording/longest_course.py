"""The most stamps of a recording that do not go back."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
Index = np.ndarray[Any, np.dtype[np.intp]]


def longest_course(t_s: Array) -> Index:
    """The numbers of the most samples [k] whose stamps [n], s, do not go back (Schensted, Canad. J. Math. 13 (1961) 179)."""
    ends_s: list[float] = []
    last = np.zeros(t_s.size, dtype=np.intp)
    before = np.full(t_s.size, -1, dtype=np.intp)
    for i, t in enumerate(t_s.tolist()):
        k = bisect_right(ends_s, t)
        before[i] = last[k - 1] if k else -1
        last[k] = i
        ends_s[k : k + 1] = [t]
    course = np.empty(len(ends_s), dtype=np.intp)
    i = int(last[len(ends_s) - 1])
    for k in range(len(ends_s) - 1, -1, -1):
        course[k], i = i, int(before[i])
    return course
