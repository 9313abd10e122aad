"""Checks of session.toml and the tables as files: unknown keys, errors that are not stated, rows that were left out."""

from __future__ import annotations

from difflib import get_close_matches

from gyrocal.recording.header import Reference, RunEntry, SessionFile
from gyrocal.recording.session import AXES, Session
from gyrocal.warning import Warning

CODES = (
    "unit_rad_s", "axes_swapped", "sign_flipped", "face_wrong", "rate_wrong", "scale_implausible", "bias_implausible",
    "turn_on_implausible", "not_at_rest", "constant_reading", "axis_absent", "unit_unsure", "clipped", "accel_unit",
    "temp_unit", "sample_rate", "first_sample", "unknown_key", "line_damaged", "samples_lost", "run_unannounced", "device_gone",
    "no_answer", "reference_jumps", "reference_shifted", "reference_unrelated", "offset_ambiguous", "hardly_turned",
    "noise_unknown", "turn_exact", "corrected_already", "beyond_model", "same_readings", "last_sample",
)  # fmt: skip
"""Codes that ``accept`` may name."""


def check(session: Session) -> list[Warning]:
    """``corrected_already``, ``unknown_key``, ``line_damaged`` and ``turn_exact``."""
    out = _corrected(session)
    out += [Warning("unknown_key", None, None, _unread(key, SessionFile)) for key in session.unread]
    out += [Warning("unknown_key", None, None, text) for entry in session.accept if (text := _unaccepted(entry))]
    for run in session.runs:
        out += [Warning("unknown_key", None, run.file, _unread(key, RunEntry)) for key in run.unread]
        if run.damage:
            out.append(Warning("line_damaged", None, run.file, run.damage))
    return out + [warning for axis in range(len(AXES)) for warning in _exact_turn(session, axis)]


def _corrected(session: Session) -> list[Warning]:
    """``corrected_already``: rates that are not the sensor's own, which session.toml states."""
    if not session.corrected:
        return []
    text = (
        f"the rates are those of {session.corrected}: offsets, and perhaps a rotation, were applied to them before they were "
        "logged. A model fitted on them describes only what that left. Import the sensor's own rates where the log has them "
        "(sensor_gyro of PX4), or export the model with --add-to and the vehicle's parameters"
    )
    return [Warning("corrected_already", None, None, text)]


def corrected_otherwise(by: str | None, of_model: str) -> list[Warning]:
    """``corrected_already``: the rates of a log were not corrected by what had corrected those that its model was fitted on.

    ``by`` and ``of_model`` name what had corrected them; None or empty: nothing, they are the sensor's own.
    """
    if (by or "") == of_model:
        return []
    text = (
        f"the rates are {_whose(by)}, and the model was fitted on {_whose(of_model)}: the offsets between them stay in the "
        "readings or are removed twice. Take the same rates as for the model (--topic or --map)"
    )
    return [Warning("corrected_already", None, None, text)]


def _whose(by: str | None) -> str:
    return f"those of {by}" if by else "the sensor's own"


def _exact_turn(session: Session, axis: int) -> list[Warning]:
    """``turn_exact``: a single turn of known angle without a stated error, which no other turn can show."""
    turns = [r for r in session.runs if r.rate_is_mean and r.axis_index == axis and r.turn_se_deg is None]
    if len(turns) != 1 or not turns[0].turn_deg:
        return []
    angle_deg = abs(turns[0].turn_deg)
    text = (
        f"the angle of the turn of {angle_deg:g} deg counts as exact: no turn_se_deg states its error, and no second turn "
        f"about the axis shows it. An error of 1 deg moves the scale by {100 / angle_deg:.2g} %, which its standard error does "
        "not contain. Give turn_se_deg, or turn again"
    )
    return [Warning("turn_exact", AXES[axis], turns[0].file, text)]


def _unread(key: str, schema: type[RunEntry] | type[SessionFile]) -> str:
    known = [name for name in schema.model_fields if name != "run"]
    if key.startswith("reference."):
        known = [f"reference.{name}" for name in Reference.model_fields]
    (nearest,) = get_close_matches(key, known, n=1, cutoff=0.0)
    return f"no command reads the key {key!r} of session.toml; the nearest that is read is {nearest}. Correct or remove it"


def _unaccepted(entry: str) -> str:
    """The error in an entry of ``accept`` in words; empty if there is none."""
    code, colon, axis = entry.partition(":")
    (nearest,) = get_close_matches(code, CODES, n=1, cutoff=0.0)
    if code in CODES and (axis in AXES if colon else True):
        return ""
    correct = nearest + (f":{axis if axis in AXES else 'z'}" if colon else "")
    return f"accept = [{entry!r}] of session.toml names no warning; the nearest is {correct!r}. Correct or remove it"
