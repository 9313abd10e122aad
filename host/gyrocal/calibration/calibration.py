"""The estimates of a session as one result."""

from __future__ import annotations

from gyrocal.calibration.calibrate import Estimate
from gyrocal.shown import Shown


class Calibration(Shown, list[Estimate]):
    """The estimates of :func:`gyrocal.calibration.calibrate.calibrate`, a list that shows itself."""

    __hash__ = None
