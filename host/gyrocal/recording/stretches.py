"""The stretches of successive samples that a mask selects."""

from __future__ import annotations

from typing import Any

import numpy as np

Mask = np.ndarray[Any, np.dtype[np.bool_]]
Index = np.ndarray[Any, np.dtype[np.intp]]


def stretches(mask: Mask) -> tuple[Index, Index]:
    """First sample [k] and length in samples [k] of each stretch of a mask [n]."""
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    return edges[::2], edges[1::2] - edges[::2]
