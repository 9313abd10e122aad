"""Groups of candidates that a session cannot tell apart."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import in_range, usual
from gyrocal.diagnosis.naming.gains import total
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

Excludes = Callable[[Candidate, Candidate], bool]


def with_groups(candidates: Sequence[Candidate], excludes: Excludes | None = None) -> list[Candidate]:
    """Give each candidate with decision ``add`` its group: the candidates that this session cannot tell from it.

    ``excludes`` says whether a fit of both shows that the first candidate acts and the second does not.

    The signals of the members overlap, and their held-out gains do not differ significantly. Of two candidates with the same
    shape, the simpler one is preferred unless the other gains enough for each further parameter, or the simpler one alone is
    smaller than any known one. A candidate that reached only ``suggest`` is still a rival of one that reached ``add``, also if
    it is the simpler one. So is an effect that the session cannot measure, if what is known of its course has the same shape.
    An effect of a size that no sensor has is no rival of one of a usual size. It is a rival of one that is itself larger than
    usual: something that neither describes may make the sizes of both.
    """
    passed = [c for c in candidates if c.decision in ("add", "suggest")]

    def rivals(c: Candidate) -> list[Candidate]:
        return [r for r in passed if r is not c and r.axis == c.axis and (in_range(r) or not usual(c))]

    unmeasured = [c for c in candidates if c.decision == "not_measurable"]
    grouped = (_grouped(c, rivals(c), excludes) if c.decision == "add" else c for c in candidates)
    return [_with_unmeasured(c, unmeasured) if c.decision == "add" else c for c in grouped]


def _with_unmeasured(c: Candidate, unmeasured: Sequence[Candidate]) -> Candidate:
    """The candidate with the effects in its group that have the same shape and a physical size, as far as these are known."""
    of_axis = (r for r in unmeasured if r.axis == c.axis and _looks_the_same(c, r))
    return replace(c, group=(*c.group, *(r.effect.id for r in of_axis if _as_large(c, r))))


def _looks_the_same(c: Candidate, unmeasured: Candidate) -> bool:
    """True if an effect has the shape of a candidate, and what it lacks of this would be lost in the noise.

    The part of a signal that is in another is the square of their cosine. A difference of two gains has about the root of
    twice itself as its standard error.
    """
    alike = cosine(c.signal, unmeasured.signal)
    lost = (c.gain or 0.0) * (1 - alike**2)
    return alike > POLICY.same_shape and lost < 2 * POLICY.rival_errors**2


def _as_large(c: Candidate, unmeasured: Candidate) -> bool:
    """True if an effect makes the signal of a candidate at a physical size. Its own signal is that of one unit."""
    assert c.signal is not None
    assert unmeasured.signal is not None
    both = np.isfinite(c.signal) & np.isfinite(unmeasured.signal)
    largest = max((p.typical[1] for p in unmeasured.effect.parameters if p.sized), default=np.inf)
    size = float(np.linalg.norm(c.signal[both]) / np.linalg.norm(unmeasured.signal[both]))
    return size <= POLICY.range_factor * largest


def with_suggested_groups(candidates: Sequence[Candidate], axes: Iterable[str]) -> list[Candidate]:
    """Give the best suggestion of each of the ``axes`` its group: the other suggestions of a similar shape.

    These axes have a misfit, and none of their candidates passed.
    """
    out = list(candidates)
    for axis in axes:
        suggested = [c for c in candidates if c.axis == axis and c.decision == "suggest" and not c.contradicted and in_range(c)]
        best = min(suggested, key=lambda c: c.chance, default=None)
        if best is not None:
            others = [c for c in suggested if c is not best and c.effect.id not in best.together]
            rivals = [c for c in others if cosine(best.signal, c.signal) > POLICY.similar_shape]
            group = (best.effect.id, *(c.effect.id for c in rivals))
            out = [replace(c, group=group) if c is best and rivals else c for c in out]
    return out


def _grouped(c: Candidate, rivals: Sequence[Candidate], excludes: Excludes | None) -> Candidate:
    group = [c]
    for rival in rivals:
        overlap = cosine(c.signal, rival.signal)
        same = overlap > POLICY.same_shape
        if overlap <= POLICY.similar_shape or not _as_good(c, rival, _price(c, rival) if same else 0.0):
            continue
        if same and rival.parameters < c.parameters and rival.decision == "add" and (c.tiny or not rival.tiny):
            return replace(c, decision="suggest", group=())  # the simpler candidate has the same shape
        if same and rival.parameters > c.parameters and (rival.gain or 0.0) - (c.gain or 0.0) < _price(rival, c):
            continue
        if not same and excludes is not None and excludes(c, rival):
            continue
        group.append(rival)
    group.sort(key=lambda x: -(x.gain or 0.0))
    return replace(c, group=tuple(dict.fromkeys(x.effect.id for x in group)))


def _price(c: Candidate, other: Candidate) -> float:
    """The held-out log-likelihood by which a candidate must exceed another of the same shape."""
    if c.parameters == other.parameters:
        return POLICY.noisy_columns * (c.gain or 0.0)
    return POLICY.parameter_gain * max(0, c.parameters - other.parameters)


def cosine(a: Array | None, b: Array | None) -> float:
    """Absolute cosine similarity of two signals [blocks]; 0 if they are not comparable."""
    if a is None or b is None or a.shape != b.shape:
        return 0.0
    both = np.isfinite(a) & np.isfinite(b)  # runs that lack the data of one of the two say nothing
    a, b = a[both], b[both]
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    return abs(float(a @ b)) / norm if norm > 0 else 0.0


def _as_good(c: Candidate, other: Candidate, price: float) -> bool:
    """True if the other's held-out gain is as large, within the standard error of the difference or the ``price``."""
    if c.unit_gains is None or other.unit_gains is None or c.unit_gains.shape != other.unit_gains.shape:
        return False
    difference = c.unit_gains - other.unit_gains
    difference = difference[np.isfinite(difference)]
    error = float(np.hypot(total(difference)[1] or 0.0, np.hypot(c.gain_noise, other.gain_noise)))
    return float(difference.sum()) < max(POLICY.rival_errors * error, price)
