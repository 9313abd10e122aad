"""The excess that no test of the residual names: an axis whose held-out data hold more than noise is not adequate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.residual.angles import Angles
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.levels import Level
from gyrocal.policy import POLICY
from gyrocal.recording.session import Session
from gyrocal.units import rate_text
from gyrocal.variables.rate import Rate


def beyond_errors(
    session: Session, levels: Mapping[str, Level], angles: Angles | None, nearest: Mapping[str, Finding], axes: Sequence[str]
) -> list[Finding]:  # fmt: skip
    """The excess of each of the ``axes`` beyond its errors as a finding, against the variable that fits best (``nearest``).

    The excess is that of net ``angles`` in a session that is judged by them, of all or within power cycles. An excess of angles
    at each sample must also be a part of the floor, because their noise is that of the reference.
    """
    mean_s = float(np.mean([run.duration_s for run in session.runs]))
    out = []
    for axis in axes:
        if angles is None:
            size, se, least = levels[axis].excess_dps, levels[axis].excess_se_dps, 0.0
        else:
            of_axis = angles.level(axis)
            size, se = of_axis.excess_deg, of_axis.excess_se_deg
            least = POLICY.least_excess * (of_axis.floor_deg or 0.0) if angles.of_samples else 0.0
        if size is None or se is None or size <= max(POLICY.adequate_errors * se, least):
            out += _within_cycles(angles, axis, mean_s)
            continue
        what = f"{rate_text(size)} more" if angles is None else f"{size:.3g} deg of angle more"
        near, sigma = nearest.get(axis), size / se
        against, shape = (Rate.name, None) if near is None else (near.against, near.shape)
        note = f"{what} than noise leaves in held-out data, in no shape that a test knows"
        size_dps = size if angles is None else size / mean_s
        out.append(Finding(axis, against, sigma, float(tails.normal(sigma)), size_dps, note, shape))
    return out


def _within_cycles(angles: Angles | None, axis: str, mean_s: float) -> list[Finding]:
    """What the net angles of an axis hold within power cycles beyond noise, if chance makes it as rarely as three errors."""
    within = None if angles is None else angles.within.get(axis)
    floor_deg = None if angles is None else angles.level(axis).floor_deg
    if within is None or floor_deg is None or within.chance >= tails.normal(POLICY.adequate_errors):
        return []
    size_deg = floor_deg * float(np.sqrt(max(within.ratio - 1, 0.0)))
    note = f"{size_deg:.3g} deg of angle more than noise leaves within power cycles, in no shape that a test knows"
    sigma = float(np.sqrt(tails.chi_square_value(max(within.chance, 1e-300), 1)))
    return [Finding(axis, Rate.name, sigma, within.chance, size_deg / mean_s, note)]
