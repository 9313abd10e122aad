"""Which effects, odd boards and trends are reported of a fleet."""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.policy.threshold import threshold

ALARMS = "the 2 % that are allowed for false alarms; pytest tests/fleet/"


@dataclass(frozen=True)
class Fleet:
    """Thresholds of the effects, odd boards and trends of many boards."""

    fleet_names: float = threshold(
        0.02, "probability that any effect is named in a fleet without one, over all candidates",
        larger="more false names", smaller="effects of few boards are not named", chosen_by=ALARMS + "test_missing.py",
    )  # fmt: skip
    fleet_odd: float = threshold(
        0.02, "probability that any board is called odd in a fleet without an odd one",
        larger="sound boards are called odd", smaller="odd boards count in the population",
        chosen_by=ALARMS + "test_pooling.py",
    )  # fmt: skip
    fleet_trends: float = threshold(
        0.02, "probability that any trend is reported in a fleet without one, over all quantities and lines",
        larger="more false trends", smaller="slow changes of the production are not reported",
        chosen_by=ALARMS + "test_trend.py",
    )  # fmt: skip
    fleet_boards: int = threshold(
        20, "number of boards from which on effects and trends are reported",
        larger="small fleets have neither", smaller="asymptotic probabilities are used where they do not hold",
    )  # fmt: skip
    population_boards: int = threshold(
        3, "number of boards from which on a mean and a spread are stated",
        larger="small fleets have no population", smaller="a spread is stated from two values",
    )  # fmt: skip
    fleet_effects: int = threshold(
        5, "largest number of effects that are named on one axis",
        larger="remainders of wrong names are named too", smaller="the weakest effects of a fleet are not named",
    )  # fmt: skip
    error_of_variance: float = threshold(
        0.06, "deviation from one of the mean square of z of boards without an effect, which the standard errors may cause",
        larger="effects that differ from board to board about zero are not named",
        smaller="standard errors that are slightly too small are named as an effect",
        chosen_by="standard errors are correct to 3 %, see docs/coverage.md",
    )  # fmt: skip
    fleet_rival_gain: float = threshold(
        3.0, "log-likelihood by which the best candidate must exceed another that it makes unnecessary, or both are named",
        larger="more effects are named as a group that the fleet cannot distinguish",
        smaller="one of two equal effects is named",
        chosen_by="odds of 20 to 1 (3 = ln 20); chosen by judgement",
    )  # fmt: skip
    fleet_folds: int = threshold(
        10, "number of parts of the boards that are left out in turn",
        larger="the comparison takes longer", smaller="populations are estimated from fewer boards than there are",
    )  # fmt: skip
    fleet_identified: float = threshold(
        1e-4, "fraction of a candidate's squared norm that must be independent of the model's columns on a board",
        larger="boards that show an effect weakly do not count", smaller="rounding errors of the columns count as an effect",
    )  # fmt: skip
