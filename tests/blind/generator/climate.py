"""The temperature of the die over the days of a session."""

from __future__ import annotations

import numpy as np

from .case import Array, Case, random_of
from .protocol import Plan

SELF_HEATING_C = 1.5
SELF_HEATING_TAU_S = 60.0


class Climate:
    """The die's temperature: the room of each day, the die's own heat, and in a "chamber" a heater that cycles."""

    def __init__(self, case: Case, plans: list[Plan]) -> None:
        random = random_of(case, "climate")
        self.base_c = {day: random.uniform(23.0, 27.0) for day in (1, 2, 3)}
        self.slow = [(random.uniform(0.3, 0.8), random.uniform(900, 2400), random.random()) for _ in range(2)]
        self.heater = (3.0 if case.climate == "chamber" else 0.0, random.uniform(60.0, 80.0), random.random())
        self.ramp = (14.0, case.seconds * random.uniform(1.2, 1.5), random.random()) if case.climate == "ramp" else None
        # heat left from the power cycles before, at each power-on
        self.heat_c: dict[int, float] = {}
        heat_c, last_day, last_on_s, last_off_s = 0.0, 0, 0.0, 0.0
        for plan in plans:
            if plan.day != last_day:
                heat_c, last_day, last_on_s, last_off_s = 0.0, plan.day, plan.power_on_time_s, plan.power_on_time_s
            if plan.scenario not in self.heat_c:
                warm = np.exp(-(last_off_s - last_on_s) / SELF_HEATING_TAU_S)
                heat_c = SELF_HEATING_C + (heat_c - SELF_HEATING_C) * warm
                heat_c *= np.exp(-(plan.power_on_time_s - last_off_s) / SELF_HEATING_TAU_S)
                self.heat_c[plan.scenario] = heat_c
                last_on_s = plan.power_on_time_s
            last_off_s = plan.start_time_s + case.seconds

    def __call__(self, plan: Plan, t_s: Array) -> tuple[Array, Array]:
        """Temperature and its slope at times `t_s` of the run."""
        time_s = plan.start_time_s + t_s
        temp_c, slope = np.full_like(t_s, self.base_c[plan.day]), np.zeros_like(t_s)
        for amplitude_c, period_s, phase in (*self.slow, self.heater):
            angle = 2 * np.pi * (time_s / period_s + phase)
            temp_c += amplitude_c * np.sin(angle)
            slope += amplitude_c * 2 * np.pi / period_s * np.cos(angle)
        if self.ramp is not None:
            amplitude_c, period_s, phase = self.ramp
            for k in (1, 3, 5):  # of a triangle's waves: a chamber turns within seconds, not within a sample
                angle = 2 * np.pi * k * (time_s / period_s + phase)
                temp_c += amplitude_c * 8 / (np.pi * k) ** 2 * np.cos(angle)
                slope -= amplitude_c * 16 / (np.pi * k * period_s) * np.sin(angle)
        left = (self.heat_c[plan.scenario] - SELF_HEATING_C) * np.exp(
            -(time_s - plan.power_on_time_s) / SELF_HEATING_TAU_S
        )
        return temp_c + SELF_HEATING_C + left, slope - left / SELF_HEATING_TAU_S
