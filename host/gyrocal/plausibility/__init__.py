"""Does a session contradict itself: units, axes, faces, rates, dead or clipped readings, columns in another unit?

One file for each kind of evidence; :func:`check` collects them in the order in which a person should read them. Every warning
is a :class:`~gyrocal.warning.Warning`; docs/warnings.md explains each code. It imports ``inference`` and what lies below it.
"""

from __future__ import annotations

from pathlib import Path

from gyrocal.error_model.model import Model
from gyrocal.plausibility import columns, header, noise, readings, rests, sizes, slopes
from gyrocal.plausibility.runs import Means
from gyrocal.recording.session import Session
from gyrocal.warning import Warning, accepted


def check(session: Session, model: Model | str | Path | None = None) -> list[Warning]:
    """All warnings of a session; ``model`` is the one in use, None: ``default``. Accepted ones no longer block."""
    dead = readings.constant(session)
    means = Means(session, skip={(w.axis, w.file) for w in dead} | readings.cut_off(session))
    lines = slopes.lines(means)
    moved = rests.moved(means, lines)
    found = [
        *slopes.contradictions(means, lines),
        *sizes.check(means, lines, moved),
        *moved,
        *dead,
        *noise.unit_unsure(session),
        *readings.clipped(session, Model.open(model)),
        *columns.check(session),
        *readings.first_sample(session),
        *header.check(session),
    ]
    return accepted(found, session.accept)


def blocked(warnings: list[Warning], axes: tuple[str, ...]) -> set[str]:
    """The axes that are left out of every judgement: a blocking warning stands against them, or they hold no readings."""
    return {a for a in axes if any(w.blocks(a) or (w.code == "axis_absent" and w.axis == a) for w in warnings)}
