"""A quarter turn by hand shows whether a sensor's axes are those of its accelerometer, and whether their signs are right.

Turned to the left as seen from above, a board turns about the axis that points up, in the positive sense of that axis.
"""

from __future__ import annotations

import numpy as np

from gyrocal.device.check import Check, Heard
from gyrocal.device.wire import raw_table

LEFT = "Turn it a quarter to the left, as seen from above, within 20 s."
TURN_S = 20.0
ENOUGH_DEG = 60.0
"""A quarter by eye is at least so much; drift and hands that tremble are far below."""
TILT = 0.5
"""Sine of the tilt to which a turn by hand may be off the axis that points up."""


class Turn:
    """One sensor's turn. ``rest`` is what it sent while it lay still."""

    def __init__(self, rest: Heard) -> None:
        counts = rest.counts().mean(axis=0)
        self._still, gravity = counts[:3], counts[3:6]
        self._up = int(np.argmax(np.abs(gravity)))
        self._sign = 1.0 if gravity[self._up] > 0 else -1.0

    def is_enough(self, heard: Heard) -> bool:
        """Whether it has turned far enough to be judged."""
        return float(np.abs(self._angles_deg(heard)).max()) >= ENOUGH_DEG

    def judge(self, imu: int, heard: Heard) -> Check:
        """The check of its axes."""
        angles_deg = self._angles_deg(heard)
        size_deg = float(np.abs(angles_deg).max())
        up = f"{'+' if self._sign > 0 else '-'}{'xyz'[self._up]}"
        words = ", ".join(f"{axis} {angle:+.0f}" for axis, angle in zip("xyz", angles_deg, strict=True))
        found = f"{up} points up, it turned {words} deg"
        if size_deg < ENOUGH_DEG:
            return Check("axes", None, f"{found}; nobody turned it far enough", imu=imu)
        others = np.delete(np.abs(angles_deg), self._up)
        if float(others.max()) > TILT * size_deg:
            advice = "turn it flat on the table; if you did, report it with the sensor's name: axes are exchanged"
            return Check("axes", False, found, advice, imu)
        if angles_deg[self._up] * self._sign < 0:
            advice = "turn it to the left; if you did, report it with the sensor's name: a sign is wrong"
            return Check("axes", False, found, advice, imu)
        return Check("axes", True, found, imu=imu)

    def _angles_deg(self, heard: Heard) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        table, lsb_dps = raw_table(heard.raw), heard.real("lsb_dps")
        if len(table.t_us) < 2 or lsb_dps is None:
            return np.zeros(3)
        rates_dps = lsb_dps * (table.counts[:, :3] - self._still)
        steps_s = 1e-6 * np.diff(table.t_us)[:, np.newaxis]
        return np.asarray((0.5 * (rates_dps[1:] + rates_dps[:-1]) * steps_s).sum(axis=0), float)
