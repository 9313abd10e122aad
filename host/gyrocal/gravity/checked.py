"""What a session by gravity contradicts as soon as it is imported: too few rests, and rates of the wrong size."""

from __future__ import annotations

from gyrocal.errors import InputError
from gyrocal.gravity import rests
from gyrocal.gravity.scene import Scene, SmallRatesError
from gyrocal.recording.session import Session
from gyrocal.warning import Warning, accepted


def check(session: Session) -> list[Warning]:
    """What rests show, and unless they are too few, ``scale_implausible`` where the rates are not of gravity's size."""
    found = accepted(rests.check(session), session.accept)
    if any(warning.code == "not_at_rest" for warning in found):
        return found
    try:
        return found + [warning for warning in Scene.of(session).warnings if warning.code == "scale_implausible"]
    except SmallRatesError as error:
        return found + accepted([Warning("scale_implausible", None, None, str(error), True)], session.accept)
    except InputError:  # the accelerations are not near 1 g, which accel_unit tells
        return found
