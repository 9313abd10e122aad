"""The decision on each candidate: add, suggest or reject."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gyrocal import tails
from gyrocal.diagnosis.naming.candidate import Candidate, number_tested
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects.optional import OwnLine
from gyrocal.effects.wave import Tone
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Run
from gyrocal.variables.reading import Reading


def with_q_values(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Give each measurable candidate its q-value, the false-discovery rate by Benjamini and Hochberg."""
    tested = [i for i, c in enumerate(candidates) if c.decision != "not_measurable"]
    order = sorted(tested, key=lambda i: candidates[i].chance)
    q, smallest = {}, 1.0
    for rank in range(len(order), 0, -1):
        i = order[rank - 1]
        smallest = min(smallest, candidates[i].chance * len(order) / rank)
        q[i] = smallest
    return [replace(c, q_value=q[i]) if i in q else c for i, c in enumerate(candidates)]


def decide(candidates: Sequence[Candidate], comparison: Comparison) -> list[Candidate]:
    """Decide for each candidate, whose q-value must be known, whether to add, suggest or reject it."""
    tested = number_tested(candidates)
    out = []
    for c in candidates:
        if significant(c):
            named = proven(c, tested) and in_range(c) and c.enough and meets(c, comparison)
            c = replace(c, decision="add" if named else "suggest")
        out.append(c)
    return out


def significant(c: Candidate) -> bool:
    """True if a candidate was tested and its q-value is below the false-discovery rate."""
    return c.decision != "not_measurable" and c.q_value is not None and c.q_value < POLICY.false_discovery_rate


def without_unphysical(candidates: Sequence[Candidate]) -> list[Candidate]:
    """The candidates, of which no effect is suggested that the fit contradicts, that is larger than any sensor has it, or that
    makes the prediction of held-out data worse by more than its error.

    They take part in the comparisons before, because beside another effect their size can be another one.
    """

    def unlikely(c: Candidate) -> bool:
        worse = c.gain is not None and c.gain_se is not None and c.gain < -c.gain_se and not _grid(c)
        return c.contradicted or worse or not in_range(c)

    return [replace(c, decision="reject", group=()) if c.decision == "suggest" and unlikely(c) else c for c in candidates]


def meets(c: Candidate, comparison: Comparison) -> bool:
    """True if the candidate explains a substantial part of this axis's strongest finding, or most of the excess."""
    if c.effect.fault_of(c.values) or (c.explained or 0.0) > POLICY.main_cause:
        return True
    others = [
        f for f in comparison.where
        if f.axis == c.axis and f.against != Reading.name
        and not _own_line(c, f, comparison) and not _too_fast(c, f, comparison.fit.session.runs)
    ]  # fmt: skip
    gains = [max(f.strength, f.snr) ** 2 / 2 for f in others]
    return (c.gain or 0.0) >= POLICY.of_finding * max(gains, default=0.0)


def _too_fast(c: Candidate, finding: Finding, runs: Sequence[Run]) -> bool:
    """True if a candidate has no part in a line or a band, whose frequencies it does not reach.

    Block means do not show those of a slow one. A tone reaches its own frequency, or its order at the fastest turn.
    """
    if finding.band_hz is None:
        return False
    if isinstance(c.effect, Tone) and finding.band_hz[0] == finding.band_hz[1] and c.values:
        return finding.band_hz[0] > POLICY.another_line * c.effect.highest_hz(runs, c.values)
    return not c.effect.fast and finding.above_blocks


def _own_line(c: Candidate, finding: Finding, comparison: Comparison) -> bool:
    """True if a line is in the term of the candidate, or a line or band in one of the model: a filter changes both."""
    if finding.band_hz is None:
        return False
    of = [(t.effect, t.values) for t in comparison.fit.model.on(c.axis)]
    if finding.band_hz[0] == finding.band_hz[1]:
        of.append((c.effect, c.values))
    runs, axis = comparison.fit.session.runs, AXES.index(c.axis)
    own = ((effect, values) for effect, values in of if isinstance(effect, OwnLine))
    return any(effect.line_dps(runs, axis, values, *finding.band_hz) > 0 for effect, values in own)


def proven(c: Candidate, tested: int) -> bool:
    """True if a candidate is significant among all that were tested and improves the prediction of held-out data."""
    better = sure_gain(c)
    if c.effect.fault_of(c.values):
        shown = c.chance < POLICY.shown_by_codes
        better = better or _grid(c) or (shown and c.gain is not None and c.gain >= -POLICY.reading_loss)
    return better and c.chance * tested < POLICY.name_alarm


def _grid(c: Candidate) -> bool:
    """True if the codes show a grid: it is there, however little a step that hides the noise leaves to predict."""
    fault = c.effect.fault_of(c.values)
    return fault is not None and fault.step_dps(c.values) > 0 and c.chance < POLICY.shown_by_codes


def sure_gain(c: Candidate) -> bool:
    """True if the held-out gain exceeds zero by ``Policy.gain_errors`` standard errors."""
    return c.gain is not None and c.gain_se is not None and c.gain > POLICY.gain_errors * c.gain_se


def evident_gain(c: Candidate) -> bool:
    """True if the held-out gain is large enough for a name that the evidence of sets alone gives, or the tests alone."""
    return c.gain is not None and c.gain >= POLICY.evident_gain


def has_size(c: Candidate) -> bool:
    """True if one of its coefficients differs from zero by more than chance, within the whole error that is told with it."""
    told = [(abs(c.values[name]), c.se.get(name, 0.0)) for name in c.effect.coding.used(c.values) if name in c.values]
    return not told or any(se <= 0 or 2 * tails.normal(size / se) < POLICY.name_alarm for size, se in told)


def usual(candidate: Candidate) -> bool:
    """True if every linear parameter is at most as large as in the sources of the effect, within its standard error."""
    return _at_most(candidate, 1.0)


def in_range(candidate: Candidate) -> bool:
    """True if every linear parameter is at most ``Policy.range_factor`` times its typical size, within its standard error.

    A fault of the reading has no linear parameter and always passes.
    """
    return _at_most(candidate, POLICY.range_factor)


def _at_most(candidate: Candidate, factor: float) -> bool:
    if candidate.effect.fault_of(candidate.values):
        return True
    for parameter in candidate.effect.parameters:
        value = candidate.values.get(parameter.name)
        if (
            value is not None
            and parameter.sized
            and abs(value) - candidate.se.get(parameter.name, 0.0) > factor * parameter.typical[1]
        ):
            return False
    return True
