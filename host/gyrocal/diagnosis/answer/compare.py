"""Compare a model with the measurements, on the same family of tests as a diagnosis.

The tests of the residual come first. Where they find nothing, the effects of the library are tried as well, because the test of
one known shape is more sensitive than a general one. Where they find nothing either, sets of effects and what has no name are
weighed against noise alone. A model is adequate if nothing is found in any of these ways, so ``compare`` and ``diagnose`` agree
on every model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from gyrocal.diagnosis.answer.as_is import compare_as_is
from gyrocal.diagnosis.naming import candidates as naming
from gyrocal.diagnosis.naming.probability import improbable_noise, with_probabilities
from gyrocal.diagnosis.residual.comparison import Comparison, measure
from gyrocal.error_model.model import Model
from gyrocal.policy import POLICY
from gyrocal.recording.session import Session
from gyrocal.threads import one_thread

Progress = Callable[[str], None]


@one_thread
def compare(
    session: Session, model: Model | str | Path | None = None, *, only_day: int | None = None, as_is: bool = False,
    progress: Progress | None = None,
) -> Comparison:  # fmt: skip
    """Fit a model to a session, judge it on held-out data, and find where it fails.

    ``only_day`` restricts the held-out data to one day. ``as_is`` keeps the model's parameters; ``moved`` of the result tells
    what has become of them (:mod:`gyrocal.diagnosis.answer.as_is`). Raises InputError if the model has no term on any axis, if
    the day cannot be left out, or if a model without parameters is to be kept as it is.
    """
    if as_is:
        return compare_as_is(session, model, progress=progress)
    measured = measure(session, model, only_day=only_day, progress=progress)
    if measured.where or measured.implausible:
        return measured
    judged = naming.candidates(measured, unless=POLICY.name_alarm, progress=progress)
    named = naming.with_named(measured, judged, only_day)
    if named.where:
        return named
    return replace(named, where=improbable_noise(with_probabilities(judged, named, progress)[1], named))
