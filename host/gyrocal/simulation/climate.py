"""The temperature of a part over days in the laboratory.

The part warms while it is on and cools while it is off, each as a first-order lag. It stays warm over an interruption of
seconds and cools in a long pause, so temperature and time since power-on are not equivalent. The room differs from day to day,
warms over the day and follows its air conditioning. A chamber raises and lowers the temperature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal.recording.session import Array

SELF_HEATING_C = 4.0
SELF_HEATING_TAU_S = 120.0
ROOM_SD_C = 2.0
WARMING_C_PER_H = 1.0
AIR_CONDITIONING_C = 0.6
AIR_CONDITIONING_S = 1200.0
CHAMBER_S = 600.0
"""Duration of a chamber's way up and down again, s."""


@dataclass
class Day:
    """One day: its room, the clock since the first power-on, and how far the part is above the room."""

    room_c: float
    phase_rad: float
    chamber_c: float = 0.0
    clock_s: float = 0.0
    above_c: float = 0.0

    def off(self, seconds: float) -> None:
        """Advance the clock while the part is without power."""
        self.above_c *= float(np.exp(-seconds / SELF_HEATING_TAU_S))
        self.clock_s += seconds

    def on(self, power_on_s: Array, air_c: float | None = None) -> Array:
        """Temperature [n], degC, at times since power-on, s; the part was switched on at the clock's time.

        ``air_c`` is the air of a chamber that holds its temperature, degC; None = the room.
        """
        at_s = self.clock_s + power_on_s
        above_c = SELF_HEATING_C - (SELF_HEATING_C - self.above_c) * np.exp(-power_on_s / SELF_HEATING_TAU_S)
        if air_c is not None:
            return np.asarray(air_c + above_c)
        cycle_c = AIR_CONDITIONING_C * np.sin(2 * np.pi * at_s / AIR_CONDITIONING_S + self.phase_rad)
        chamber_c = self.chamber_c * np.sin(2 * np.pi * at_s / CHAMBER_S)
        return np.asarray(self.room_c + WARMING_C_PER_H * at_s / 3600 + cycle_c + chamber_c + above_c)

    def switch_off(self, power_on_s: float) -> None:
        """End the power cycle at this time after power-on."""
        self.above_c = SELF_HEATING_C - (SELF_HEATING_C - self.above_c) * float(np.exp(-power_on_s / SELF_HEATING_TAU_S))
        self.clock_s += power_on_s
