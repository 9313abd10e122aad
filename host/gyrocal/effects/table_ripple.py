"""Ripple of the turntable's speed, once (twice, ...) a turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Effect, Parameter, Values, stack, table_angle_rad
from gyrocal.recording.session import Array, Run

ORDERS = (1, 2, 3, 4)


class TableRipple(Effect):
    id = "table_ripple"
    title = "Ripple of the table's speed"
    cause = (
        "The table does not turn evenly: an eccentric pulley, a belt, a motor's poles or an unbalanced load speed it up and "
        "slow it down once or a few times a turn. The gyroscope reads the true rate faithfully; it is the assumed constant "
        "rate that is wrong. Over a part of a turn the wave does not average out and passes for scale and bias."
    )
    equation = "w·Σ_k amplitude_k·cos(k·th + phase_k)"
    looks_like = "gravity on a tilted table (g_sensitivity), the same once-a-turn wave at one rate"
    measure_next = (
        "average over whole turns, or record table_angle_deg; two rates part it from gravity on a tilted table"
    )
    parameters = tuple(
        parameter
        for k in ORDERS
        for parameter in (
            Parameter(
                f"amplitude_{k}", "fraction", (0.0005, 0.005), "turntables' speed ripple", 0.0016 if k == 1 else 0.0
            ),
            Parameter(f"phase_{k}_deg", "deg", (-180.0, 180.0), "the table's angle at the start"),
        )
    )
    linear = tuple(f"amplitude_{k}" for k in ORDERS)
    scope = "run"
    on_device = True

    def scope_in(self, runs: Sequence[Run]) -> str:
        known = all(r.column("table_angle_deg") is not None for r in runs)
        return "session" if known and runs else "run"

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        turning = any(r.axis_index == axis and not r.rate_is_mean and np.any(r.rate_dps) for r in runs)
        return None if turning else "a run in which the table turns about this axis at a known rate"

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        single = [{f"amplitude_{k}": 0.0} for k in ORDERS]
        growing = [dict.fromkeys(self.linear[:k], 0.0) for k in ORDERS[1:]]
        return single + growing

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        orders, columns = self.orders(values), []
        turned = np.exp(1j * table_angle_rad(run))
        wave = (run.rate_dps if axis == run.axis_index else np.zeros(len(run))).astype(complex)
        for k in range(1, max(orders, default=0) + 1):
            wave = wave * turned
            columns += [wave.real, wave.imag] if k in orders else []
        return stack(*columns)

    def orders(self, values: Mapping[str, float]) -> list[int]:
        """The orders in use: those whose amplitude is named."""
        return [k for k in ORDERS if f"amplitude_{k}" in values]

    def coefficients(self, values: Mapping[str, float]) -> Array:
        pairs = [(values[f"amplitude_{k}"], np.deg2rad(values.get(f"phase_{k}_deg", 0.0))) for k in self.orders(values)]
        return np.array([part for a, phase in pairs for part in (a * np.cos(phase), -a * np.sin(phase))])

    def named(self, coefficients: Array, values: Mapping[str, float]) -> Values:
        named: Values = {}
        for k, (a, b) in zip(self.orders(values), coefficients.reshape(-1, 2), strict=True):
            named[f"amplitude_{k}"] = float(np.hypot(a, b))
            named[f"phase_{k}_deg"] = float(np.rad2deg(np.arctan2(-b, a)))
        return named

    def spread(self, values: Mapping[str, float]) -> Array:
        # Of unknown phase: cosine and sine each carry half of the wave's mean square.
        return np.repeat([values[f"amplitude_{k}"] / np.sqrt(2) for k in self.orders(values)], 2)

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        return {
            f"amplitude_{k}": float(sd * np.sqrt(2)) for k, sd in zip(self.orders(values), spread[::2], strict=True)
        }

    def groups(self, values: Mapping[str, float]) -> list[int]:
        return [i for i in range(len(self.orders(values))) for _ in range(2)]

    def device_arguments(self, values: Mapping[str, float]) -> list[tuple[float, ...]]:
        return [(float(k), wave) for k in self.orders(values) for wave in (0.0, 1.0)]
