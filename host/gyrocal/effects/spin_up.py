"""Transient of a table that has not reached its rate when the run begins."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Effect, Law, Objection, OfEachRun, Parameter, Values, elapsed_s
from gyrocal.effects.mistaken import by_temperature, settling_scale
from gyrocal.effects.quantities import power_on_time_s, rate_about, temperature_moves, turns
from gyrocal.parameter import POSITIVE
from gyrocal.recording.session import Array, Run

STATED = "a run in which the table turns about this axis at a stated rate; a measured rate (rate_ref_dps) holds the spin-up"
SEEN = 0.25
"""Part of its start to which a transient has to fall within the longest run, so that the run shows the rate that it ends at."""


class SpinUp(OfEachRun):
    id = "spin_up"
    title = "The table is still spinning up"
    offered_as = "a table that is slow to reach its rate"
    cause = (
        "The recording starts before the table, its belt or its speed controller has settled. The true rate approaches "
        "the set rate over a few seconds, from below or after an overshoot. The error is largest in the first seconds, "
        "which a quick calibration uses."
    )
    equation = "-w·A·exp(-t/tau_s)"
    uncorrected = "it belongs to the turntable and not to the sensor"
    looks_like = "warmup (an effect of the sensor, with the same sign face up and face down, which also shows at rest)"
    measure_next = (
        "wait longer before each run, or record the table's encoder as rate_ref_dps; a run at rest shows no spin-up"
    )
    parameters = (
        Parameter("A", "fraction", (0.0005, 0.01), "belt-driven tables, seconds after the set rate is shown", 0.002),
        Parameter("tau_s", "s", (0.5, 10.0), "speed controllers' settling times", 2.0, POSITIVE, sized=False),
    )
    linear = ("A",)
    nonlinear = ("tau_s",)
    common_mean = True
    on_device = True
    law = Law({"A": 0.002, "tau_s": 3.0}, "-rate*0.002*exp(-t/3)", degree=1)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if turns([r for r in runs if _is_stated(r)], axis) else STATED

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        return [{"A": 0.0, "tau_s": float(tau_s)} for tau_s in np.geomspace(0.5, 16.0, 6)]

    def objections(
        self, values: Values, runs: Sequence[Run], axis: int, known: Sequence[tuple[Effect, Values]]
    ) -> Iterable[Objection]:
        """A transient does not end within the longest run, or would last longer than any table's if it could."""
        longest_s = max((r.duration_s for r in runs if _is_stated(r) and np.any(r.rate_dps)), default=0.0)
        slowest_s = self.parameter("tau_s").search_range[1]
        if values["tau_s"] >= min(0.99 * slowest_s, longest_s / -np.log(SEEN)):
            yield Objection.UNSEEN

    def passes_for_it(self, runs: Sequence[Run], axis: int) -> Sequence[Effect]:
        """A scale that settles after power-on and not in each run, and what follows the measured temperature."""
        settles = [settling_scale()] if any(power_on_time_s(r) is not None for r in runs) else []
        return [*settles, by_temperature()] if temperature_moves(runs) else settles

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        if not _is_stated(run):
            return np.zeros((len(run), 1))
        return (-rate_about(run, axis) * np.exp(-elapsed_s(run) / values["tau_s"]))[:, None]


def _is_stated(run: Run) -> bool:
    """True if the true rate is the table's set rate, and no reference that measures it."""
    return run.reference_dps is None
