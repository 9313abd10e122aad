"""Two fits of one axis brought to the blocks that both see, so that their likelihoods compare.

An effect of time shifts the reference, and a fault of the reading makes samples useless, so that a fit with one of them sees
fewer blocks. The density of a block that one fit lacks is no evidence: beside a noise above 0.24 deg/s it would count for that
fit, and below it against it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal.inference.blocks import Index
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import carried


def on_same_blocks(one: AxisFit, other: AxisFit) -> tuple[AxisFit, AxisFit]:
    """Both fits over the blocks that both see, each at its own noise; as they are if these are the same blocks."""
    starts = [
        np.intersect1d(a.start, b.start, assume_unique=True)
        for a, b in zip(one.design.blocks, other.design.blocks, strict=True)
    ]  # fmt: skip
    return _over(one, starts), _over(other, starts)


def _over(fit: AxisFit, starts: Sequence[Index]) -> AxisFit:
    """A fit over the blocks of each run that begin at ``starts``, at its own noise."""
    old = fit.design
    if all(b.start.size == start.size for b, start in zip(old.blocks, starts, strict=True)):
        return fit
    design = old.over([b.select(np.isin(b.start, start)) for b, start in zip(old.given, starts, strict=True)])
    return carried(fit, design)
