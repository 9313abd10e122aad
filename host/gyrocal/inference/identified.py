"""Which columns of a design the data tell apart, and what those left out may do to the others.

At one true rate, for example, the column of the scale is a multiple of the bias's, and the bias that is fitted holds both.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal.effects.base import Mask
from gyrocal.error_model.term import Term
from gyrocal.recording.session import Array

UNIDENTIFIED = 1e-7
"""A column counts as dependent if less than this fraction of its whitened squared norm is independent of the others."""


def identified(gram: Array, order: Sequence[int], least: Array) -> Mask:
    """Mask [p] of the columns that are independent of those kept before them, in the given order.

    ``gram`` is that of ``[y | columns | ...]``. A column whose independent part has a squared norm below ``least`` [p] is also
    left out: a transient that ended before the run, or the noise of a reference at rest.
    """
    keep, own = np.zeros(len(order), dtype=bool), slice(1, 1 + len(order))
    left = np.array(gram[own, own])  # products of what is independent of the columns kept so far
    norms = np.diagonal(left).copy()
    for j in order:
        rest = left[j, j]
        keep[j] = rest > UNIDENTIFIED * norms[j] and rest > least[j]
        if keep[j]:
            left -= np.outer(left[j], left[j] / rest)
    return keep


def sums_of(gram: Array, kept: Mask) -> Array:
    """What the coefficients of the kept columns [k] are of all coefficients [p], shape [k, p], where the others depend on them.

    ``gram`` is that of ``[y | columns | ...]``.
    """
    own = 1 + np.flatnonzero(kept)
    return np.asarray(np.linalg.lstsq(gram[np.ix_(own, own)], gram[own, 1 : 1 + kept.size], rcond=None)[0])


def left_out(
    gram: Array, columns: Sequence[tuple[Term, int, int]], kept: Mask, least: Array,
) -> list[tuple[int, Array]]:  # fmt: skip
    """The columns left out in favour of those kept: the index of each one's term and the shifts [p] of the kept coefficients.

    They shift by so much if the parameter left out has its largest typical size. ``gram`` is that of ``[y | columns | ...]``,
    and ``columns`` holds each column's term, the term's index and the column's number within it. Columns with a squared norm
    below ``least`` [columns] say nothing.
    """
    own = 1 + np.flatnonzero(kept)
    out = []
    for j in np.flatnonzero(~kept).tolist():
        term, index, number = columns[j]
        if gram[1 + j, 1 + j] > least[j] and (size := _typical(term, number)):
            out.append((index, np.linalg.lstsq(gram[np.ix_(own, own)], gram[own, 1 + j], rcond=None)[0] * size))
    return out


def _typical(term: Term, number: int) -> float:
    """The largest typical size of the linear parameter of a column, 0 if it has none."""
    names = term.effect.coding.used(term.values) or term.effect.linear
    sizes = {p.name: p.typical[1] for p in term.effect.parameters if np.isfinite(p.typical[1])}
    return sizes.get(names[number], 0.0) if number < len(names) else 0.0
