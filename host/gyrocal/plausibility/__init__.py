"""Checks whether a session contradicts itself: units, axes, faces, rates, constant or clipped readings, units of columns.

There is one file for each kind of evidence. :func:`check` collects the warnings in the order in which people should read them.
Each is a :class:`~gyrocal.warning.Warning`; docs/warnings.md explains each code. This folder imports ``inference`` and the
folders below it.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from gyrocal.error_model.model import Model
from gyrocal.inference.fitted import Fit
from gyrocal.plausibility import columns, header, lone, noise, readings, references, rests, sizes, slopes
from gyrocal.plausibility.runs import Means
from gyrocal.recording.register import registered
from gyrocal.recording.session import AXES, Session
from gyrocal.warning import Warning, accepted


def check(session: Session, model: Model | str | Path | None = None) -> list[Warning]:
    """All warnings of a session. ``model`` is the one in use, None = ``default``. Accepted warnings do not block."""
    if session.reference.kind == "gravity":  # no true rate is known, and the rests are checked when they are found
        cut = readings.clipped(session, Model.open(model), readings.clip_levels_dps(session))
        found = [*cut, *columns.check(session), *readings.repeated(session), *header.check(session)]
        return accepted(found, session.accept)
    session = registered(session)
    levels_dps = readings.clip_levels_dps(session)
    dead = readings.constant(session, levels_dps)
    useless = readings.cut_off(session, levels_dps) | columns.mistimed_turns(session)
    means = Means(session, skip={(w.axis, w.file) for w in dead} | useless)
    lines = slopes.lines(means)
    moved = rests.moved(means, lines)
    accused = slopes.contradictions(means, lines)
    about_reference = references.check(session)
    if any(w.blocking for w in about_reference):  # slopes against a reference of another motion say nothing
        sized: list[Warning] = []
        accused = [w for w in accused if w.code == "unit_rad_s"]
    else:
        sized = sizes.check(means, lines, accused, moved)
    found = [
        *accused,
        *sized,
        *moved,
        *dead,
        *noise.unit_unsure(session, {w.file for w in moved}),
        *readings.clipped(session, Model.open(model), levels_dps),
        *columns.check(session, {w.file for w in moved}),
        *about_reference,
        *readings.first_sample(session, levels_dps),
        *readings.last_sample(session, levels_dps),
        *readings.repeated(session),
        *lone.check(session),
        *header.check(session),
    ]
    return accepted(found, session.accept)


OF_THE_TURN = ("face_wrong", "rate_wrong")
"""Warnings that a run turned otherwise than stated. What its axes read in proportion to the rate then is no effect."""


def unsure(warnings: list[Warning], session: Session) -> set[str]:
    """The axes on which no effect is named, because the true rate that they are held against may be another one.

    A run whose other axis a blocking warning accuses turned otherwise. A measured rate about one axis that contradicts the
    readings of that axis may be the motion of something else.
    """
    accused = [w for w in warnings if w.blocking and w.file is not None and w.code in OF_THE_TURN]
    if any(r.table_rate_dps is None and not r.rate_is_mean and not r.three_axes for r in session.runs):
        accused += [w for w in warnings if w.blocks(session.axis)]
    return {a for a in AXES if any(not w.blocks(a) for w in accused)}


def of_fit(fitted: Fit, warnings: list[Warning], failing: Collection[str] = ()) -> list[Warning]:
    """The warnings of a session, and those of what was fitted to it. ``failing`` are axes with a misfit, which says more."""
    return [*warnings, *accepted(sizes.of_fit(fitted, warnings, failing), fitted.session.accept)]


def blocked(warnings: list[Warning], axes: tuple[str, ...]) -> set[str]:
    """The axes that are not judged, because they have a blocking warning or no readings."""
    return absent(warnings) | {a for a in axes if any(w.blocks(a) for w in warnings)}


def absent(warnings: list[Warning]) -> set[str]:
    """The axes that the sensor does not have, as far as its readings say."""
    return {w.axis for w in warnings if w.code == "axis_absent" and w.axis is not None}
