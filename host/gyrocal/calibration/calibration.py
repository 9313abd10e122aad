"""The estimates of a session as one result."""

from __future__ import annotations

from gyrocal.calibration.calibrate import Estimate
from gyrocal.error_model.accelerometer import AccelerometerModel
from gyrocal.shown import Shown


class Calibration(Shown, list[Estimate]):
    """The estimates of :func:`gyrocal.calibration.calibrate.calibrate`, a list that shows itself.

    ``accelerometer`` is that of a session by hand, and None for any other.
    """

    __hash__ = None
    accelerometer: AccelerometerModel | None = None
