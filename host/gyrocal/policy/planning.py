"""Which runs a plan may hold, and when it is good enough."""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.policy.threshold import threshold


@dataclass(frozen=True)
class Planning:
    """Thresholds of ``plan``."""

    enough_power: float = threshold(
        0.9, "power from which on a plan is good enough: no longer one is sought, and no further equipment is named",
        larger="longer plans", smaller="plans that miss their answer more often",
    )  # fmt: skip
    least_plan_minutes: float = threshold(
        5.0, "shortest plan that is tried if the user gives no --minutes; longer ones double it",
        larger="short plans that would do are not found", smaller="more searches",
    )  # fmt: skip
    most_plan_minutes: float = threshold(
        80.0, "longest plan that is tried if the user gives no --minutes",
        larger="questions that this rig cannot answer take longer to give up", smaller="an afternoon's plan is not found",
    )  # fmt: skip
    shortest_planned_s: float = threshold(
        20.0, "shortest run of a plan, s",
        larger="fewer power cycles in the same minutes", smaller="more work for a person in the same minutes",
        chosen_by="chosen by judgement; the shortest run that is cut into parts, shortest_run_s",
    )  # fmt: skip
    longest_planned_s: float = threshold(
        600.0, "longest run of a plan, s",
        larger="fewer power cycles in the same minutes", smaller="slow effects are seen over less of their course",
        chosen_by="chosen by judgement; the ten minutes that effects/drift.py asks for",
    )  # fmt: skip
    precision: float = threshold(
        0.1, "ratio of standard error to value at which a parameter counts as measured",
        larger="a rough value answers the question", smaller="longer plans",
        chosen_by="the question of `gyrocal plan --measure`: to a tenth",
    )  # fmt: skip
