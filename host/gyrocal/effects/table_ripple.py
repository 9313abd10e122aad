"""Ripple of the turntable's speed, once (twice, ...) a turn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal.effects.base import Law, Parameter, Tried, Values
from gyrocal.effects.order_tone import HARMONIC, strong_orders, swept_turns, waves_per_turn
from gyrocal.effects.quantities import TURNING, rate_about
from gyrocal.effects.wave import TableWave
from gyrocal.recording.session import Array, Run

ORDERS = (1, 2, 3, 4)
OF_NOISE = range(9, 17)
"""Orders whose size is taken as noise."""
LEAST_TURNS = 0.5 / max(ORDERS)
"""Angle, in turns, that a run must sweep at least."""
FEWEST, STANDS_OUT, ALIGNED_RAD = 3, 4.0, 0.45
"""A wide pulse has so many orders, each so many times the noise, whose crests are within so much of their own turn."""
BEYOND = (5, 6)
"""Orders that all stand out if the wave is a pulse once a turn. One alone may be the teeth of a gear."""


class TableRipple(TableWave):
    id = "table_ripple"
    title = "Ripple of the table's speed"
    cause = (
        "The table does not turn evenly. An eccentric pulley, a belt, a motor's poles or an unbalanced load speed it up and "
        "slow it down once or a few times per turn. The gyroscope reads the true rate correctly, but the assumed constant "
        "rate is wrong. Over part of a turn the wave does not average out and looks like scale and bias."
    )
    equation = "w·Σ_k amplitude_k·cos(k·th + phase_k)"
    looks_like = "gravity on a tilted table (g_sensitivity), which is the same wave once per turn at a single rate"
    measure_next = (
        "average over whole turns, or record table_angle_deg; two rates separate it from gravity on a tilted table"
    )
    parameters = tuple(
        parameter
        for k in ORDERS
        for parameter in (
            Parameter(
                f"amplitude_{k}", "fraction", (0.0005, 0.005), "turntables' speed ripple", 0.0016 if k == 1 else 0.0
            ),
            Parameter(f"phase_{k}_deg", "deg", (-180.0, 180.0), "the table's angle at the start", sized=False),
        )
    )
    linear = tuple(f"amplitude_{k}" for k in ORDERS)
    phases = tuple(f"phase_{k}_deg" for k in ORDERS)
    orders = ORDERS
    needs = TURNING
    on_device, device_columns = True, dict(zip(linear, ORDERS, strict=True))
    offered_as = "a ripple of the turntable"
    law = Law({"amplitude_2": 0.002, "phase_2_deg": 90.0}, "-rate*0.002*sin(2*theta)", degree=1)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        """Through less than half a period of the highest order, a ripple is a scale of each run."""
        lacking = super().missing(runs, axis)
        return lacking or (None if swept_turns(runs) >= LEAST_TURNS else "a run that turns through an eighth of a turn")

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        single = [{name: 0.0} for name in self.linear]
        growing = [dict.fromkeys(self.linear[:k], 0.0) for k in ORDERS[1:]]
        return single + growing

    def tried_on(self, runs: Sequence[Run], axis: int, line_chance: float) -> Tried:
        """Not tried for a pulse once a turn, as of a magnet beside the table.

        The lines of a narrow one go on beyond those of a ripple. Those of a wide one fall from order to order, and all their
        crests (or all their troughs) are at the angle of the pulse.
        """
        lines = strong_orders(runs, axis)
        strongest_dps = max((size for k, size in lines.items() if k in ORDERS), default=0.0)
        beyond = sum(lines.get(k, 0.0) > HARMONIC * strongest_dps for k in BEYOND)
        return None if beyond >= len(BEYOND) or _is_wide_pulse(runs, axis) else "blocks"

    def size(self, run: Run, axis: int) -> Array:
        return rate_about(run, axis)


def _is_wide_pulse(runs: Sequence[Run], axis: int) -> bool:
    """True if the orders of a turn fall in size and have their crests, or their troughs, at one angle.

    The angle may be another one in each run. A ripple of three orders does so by chance in one case of a hundred.
    """
    waves = waves_per_turn(runs, axis, [*ORDERS, *OF_NOISE])
    if not len(waves):
        return False
    sizes = np.sqrt(np.mean(np.abs(waves) ** 2, axis=0))
    clear = sizes[: len(ORDERS)] > STANDS_OUT * float(np.median(sizes[len(ORDERS) :]))
    count = len(ORDERS) if clear.all() else int(np.argmin(clear))
    if count < FEWEST or np.any(np.diff(sizes[:count]) > 0):
        return False
    first = waves[:, 0] / np.abs(waves[:, 0])
    # crests at the angle a: the wave of order k has the phase k·a; troughs there: half a turn more
    beside = [np.sum(waves[:, k] * np.conj(first) ** (k + 1)) for k in range(1, count)]
    turned = [np.abs(np.angle(np.array(beside) * sign ** np.arange(1, count))) for sign in (1.0, -1.0)]
    return bool(min(t.max() for t in turned) < ALIGNED_RAD)
