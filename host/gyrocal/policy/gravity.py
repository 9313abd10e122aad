"""Whether a session without a table determines a gyroscope, and which of its rests count."""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.policy.threshold import threshold

RESTS = "chosen by judgement; pytest tests/gravity/test_calibration.py"


@dataclass(frozen=True)
class Gravity:
    """Thresholds of rests, of the calibration by gravity, and of its held-out data."""

    # Rests
    rest_factors: tuple[float, ...] = threshold(
        (3.0, 10.0, 30.0), "factors by which the variance of a window at rest may exceed that of the stillest windows; "
        "the first that yields `enough_rests` is used",
        larger="slow movements count as rests", smaller="rests in a hand that trembles are not found",
        chosen_by="noise reaches 1.5 once in 10^5 windows of 40 samples, the tremor of a hand 10; chosen by judgement",
    )  # fmt: skip
    enough_rests: int = threshold(
        10, "number of poses of rests with which no larger factor is tried",
        larger="slow movements count as rests in short sessions", smaller="the accelerometer is calibrated from few poses",
        chosen_by="the nine parameters of an accelerometer need ten poses; chosen by judgement",
    )  # fmt: skip
    clear_turn_deg: float = threshold(
        20.0, "smallest turn of gravity in a movement whose path by the gyroscope is held against it, deg",
        larger="sessions of small movements are not checked for a wrong unit", smaller="errors of the rests decide",
        chosen_by=RESTS,
    )  # fmt: skip
    least_path: float = threshold(
        0.5, "path by the gyroscope over the turn of gravity, in the median movement, below which the readings are refused",
        larger="a gyroscope whose range is exceeded is refused", smaller="readings in a wrong unit are calibrated",
        chosen_by="readings in deg/s have 1 or more, in rad/s 0.02 to 0.1; pytest tests/gravity/test_calibration.py",
    )  # fmt: skip
    largest_factor: float = threshold(
        4.0, "largest factor by which the rates may be off, looked for where they do not lead gravity from rest to rest",
        larger="turns by whole circles are mistaken for others", smaller="a range that is off by two steps is not told",
        chosen_by="two steps of a sensor's ranges; pytest tests/gravity/test_calibration.py",
    )  # fmt: skip
    fewest_rests: int = threshold(
        4, "number of rests below which a session is refused",
        larger="short sessions that would give an answer are refused", smaller="a scale is stated from one movement",
    )  # fmt: skip
    shortest_rest_s: float = threshold(
        0.5, "shortest rest that is used, s",
        larger="short rests are left out, and their movements with them", smaller="the noise of its mean spoils a movement",
    )  # fmt: skip
    same_pose_deg: float = threshold(
        3.0, "angle between gravity in two successive rests below which they count as one pose, deg",
        larger="turns about a nearly level axis make no pose", smaller="one rest that was cut counts as several",
        chosen_by="pytest tests/gravity/test_rests.py; chosen by judgement",
    )  # fmt: skip
    rest_turns_deg: float = threshold(
        0.3, "angle by which gravity must turn within a rest for the rest to be left out, deg",
        larger="a moving sensor counts as a rest", smaller="noise of the accelerometer removes rests", chosen_by=RESTS,
    )  # fmt: skip
    rest_turns_errors: float = threshold(
        6.0, "standard errors by which gravity must also turn within a rest for the rest to be left out",
        larger="a moving sensor counts as a rest", smaller="noise of the accelerometer removes rests", chosen_by=RESTS,
    )  # fmt: skip
    rest_rate_dps: float = threshold(
        1.0, "deviation of a rest's mean rate from the median of the rests for the rest to be left out, dps",
        larger="a sensor that turns about gravity counts as a rest", smaller="warm-up and drift remove rests", chosen_by=RESTS,
    )  # fmt: skip
    rest_rate_spreads: float = threshold(
        8.0, "standard deviations of the rests by which the mean rate must also deviate for the rest to be left out",
        larger="a sensor that turns about gravity counts as a rest", smaller="ordinary scatter removes rests", chosen_by=RESTS,
    )  # fmt: skip
    still_s: float = threshold(
        0.4, "length of the pieces of a recording by hand of which the stillest are taken for rests, s",
        larger="short rests are missed", smaller="noise decides which pieces are still", chosen_by="chosen by judgement",
    )  # fmt: skip
    still_part: float = threshold(
        0.3, "part of these pieces that is taken for rests", larger="movements count", smaller="one pose stands for all",
        chosen_by="pytest tests/gravity/test_wrong_accelerometer.py",
    )  # fmt: skip
    gravity_size_g: float = threshold(
        0.1, "deviation of the median acceleration at rest from 1 g, and spread of its size over the poses, from which on the "
        "accelerometer's scale and bias are taken from the rests, with little trust in those that it states, g",
        larger="wrong scales bend the directions of gravity", smaller="few poses leave the directions of gravity open",
        chosen_by="the warning accel_unit has the same limit; pytest tests/gravity/test_wrong_accelerometer.py",
    )  # fmt: skip
    wrong_accelerometer: float = threshold(
        5.0, "factor on the prior errors of scale and bias of an accelerometer whose scale is wrong",
        larger="few poses leave the directions of gravity open", smaller="wrong scales bend the directions of gravity",
        chosen_by="pytest tests/gravity/test_wrong_accelerometer.py",
    )  # fmt: skip
    smallest_gravity_g: float = threshold(
        0.1, "size of the acceleration at rest below which the column is in another unit, g",
        larger="an accelerometer of a wrong scale is refused", smaller="columns in another unit are taken for g",
        chosen_by="public loggers are off by up to a factor of 4; chosen by judgement",
    )  # fmt: skip
    largest_gravity_g: float = threshold(
        3.0, "size of the acceleration at rest above which the column is in another unit, g",
        larger="columns in m/s2 are taken for g", smaller="an accelerometer of a wrong scale is refused",
        chosen_by="1 g is 9.8 m/s2; chosen by judgement",
    )  # fmt: skip

    # Calibration
    unseen: float = threshold(
        0.02, "standard error of a scale or misalignment above which it is not stated",
        larger="values are stated that the movements do not determine", smaller="short sessions have no scale",
    )  # fmt: skip
    implausible_errors: float = threshold(
        3.0, "standard errors by which a scale must be beyond the largest one of a working sensor to be implausible",
        larger="scales that no sensor has pass", smaller="scales that few movements determine are called implausible",
        chosen_by="chosen by judgement; pytest tests/gravity/test_scales.py holds a session on both sides",
    )  # fmt: skip
    movement_misfit_errors: float = threshold(
        4.0, "standard deviations by which the misfit of noise alone must be exceeded for the flag misfit",
        larger="answers with unmodelled effects are trusted", smaller="sound answers are flagged",
        chosen_by="gyrocal benchmark references --kind by_hand: none of 30 sound sessions exceeds it",
    )  # fmt: skip

    # Guided recording
    scale_aim: float = threshold(
        0.0015, "standard error of every scale at which a guided recording ends",
        larger="recordings are shorter and scales less certain", smaller="more poses are asked for",
        chosen_by="half of 0.3 %, so that 95 % of the scales are within 0.3 %; pytest tests/gravity/test_aims.py",
    )  # fmt: skip
    misalignment_aim: float = threshold(
        0.002, "standard error of every misalignment at which a guided recording ends",
        larger="recordings are shorter and misalignments less certain", smaller="more poses are asked for",
        chosen_by="half of 0.004, so that 95 % of the misalignments are within 0.004; pytest tests/gravity/test_aims.py",
    )  # fmt: skip
    aim_rests: int = threshold(
        15, "least number of rests of a guided recording",
        larger="more poses are asked for", smaller="too few movements remain to show that the model does not fit",
    )  # fmt: skip

    # Held-out data
    movement_blocks: int = threshold(
        8, "stretches of time that are left out in turn if days, power cycles and runs are too few",
        larger="less is left out at a time, and neighbouring rests show slow effects of the left-out movements",
        smaller="parameters are fitted to fewer movements than in the final fit",
    )  # fmt: skip
    fewest_units: int = threshold(
        3, "number of power cycles or of runs from which on these are left out in turn",
        larger="sessions of few power cycles are judged by stretches of time",
        smaller="half of the movements are left out at a time",
    )  # fmt: skip
