"""The unit of rates by the end of the sensor's range: readings that heap up at the full scale of a part."""

from __future__ import annotations

import numpy as np

from gyrocal.recording.session import Array

NOMINAL_DPS = (125.0, 245.0, 250.0, 500.0, 1000.0, 2000.0)
OF_LARGEST_CODE_DPS = (143.36, 286.72, 573.44, 1146.88, 2293.76)
"""Where parts of ST end, whose ranges hold fewer codes than a word of 16 bits: 32768 counts of 4.375 mdps and its doubles."""
SAME = 1e-4
"""Readings that differ by this part or less have one size: the largest code and the least one are 3e-5 apart."""
OF_PART = 1.1e-3
"""A range ends at its nominal size within this part: the counts per deg/s of MPU-6050 and BMI160 are rounded by 0.98e-3."""
BESIDE = 0.02
"""Below a heap there are fewer readings, within this part of its size, than in it."""
FEWEST = 4


def in_rad_s(readings: Array) -> bool:
    """True if readings [n] in an unknown unit heap up at their largest size, and it is that of a range in rad/s."""
    sizes = np.abs(readings)
    largest = float(sizes.max(initial=0.0))
    at_end = int(np.sum(sizes >= largest * (1 - SAME)))
    beside = int(np.sum(sizes >= largest * (1 - BESIDE))) - at_end
    if at_end < max(FEWEST, beside + 1):
        return False
    ends = np.radians([*NOMINAL_DPS, *OF_LARGEST_CODE_DPS])
    within = np.array([OF_PART] * len(NOMINAL_DPS) + [2 * SAME] * len(OF_LARGEST_CODE_DPS))
    return bool(np.any(np.abs(largest / ends - 1) < within))
