"""Checks of a measured reference: whether it jumps, mirrors the motion, or leaves its offset in time ambiguous."""

from __future__ import annotations

from gyrocal.recording.register import registered
from gyrocal.recording.session import Session
from gyrocal.warning import Warning


def check(session: Session) -> list[Warning]:
    """``reference_jumps``, ``sign_flipped`` for a mirrored reference, and ``offset_ambiguous``."""
    out = []
    for run in session.runs:
        jumps = 0 if run.measured_rates is None else run.measured_rates.jumps
        if jumps:
            text = (
                f"the reference jumps {jumps} times, by more than its motion before and after. The samples beside the jumps "
                "are left out. Check markers and tracking, or leave the cells of the bad samples empty"
            )
            out.append(Warning("reference_jumps", None, run.file, text))
    fit = registered(session).registration_fit
    if fit is None:
        return out
    if fit.mirrored:
        text = (
            "the readings follow the reference only as a mirror image: an axis of the sensor or of the reference has the wrong "
            "sign, or two are exchanged. Negate or exchange columns when importing, so that both frames are right-handed"
        )
        out.append(Warning("sign_flipped", None, None, text, True))
    if fit.alternatives_s:
        offset_s = fit.registration.offset_s
        others = ", ".join(f"{s:+.3f}" for s in fit.alternatives_s)
        text = (
            f"the motion repeats itself, so that the offset of the reference's clock may be {offset_s:+.3f} s, or as well "
            f"{others} s. Move irregularly for a few seconds to tell"
        )
        out.append(Warning("offset_ambiguous", None, None, text))
    return out
