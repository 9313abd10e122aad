"""Which single readings are outliers, and whether the noise explains them."""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.policy.threshold import threshold


@dataclass(frozen=True)
class Outliers:
    """Thresholds of single readings that differ from their surroundings."""

    outlier_spreads: float = threshold(
        8.0, "standard deviations of its surroundings by which an outlier must differ from its neighbours",
        larger="smaller outliers shift block means and look like effects",
        smaller="ordinary noise is excluded from the fits; Gaussian noise differs by 8 once in 10^15 readings",
        chosen_by="tail of the normal distribution; pytest tests/recording/test_outliers.py",
    )  # fmt: skip
    most_outliers: float = threshold(
        0.05, "largest fraction of a run's readings that count as outliers",
        larger="if the readings have two modes, one of them is removed",
        smaller="the errors of a bus that often loses bits remain in the fit",
    )  # fmt: skip
    most_of_one_size: float = threshold(
        0.3, "largest fraction of a run's readings that count as outliers if all are off by the same size",
        larger="the rarer of two values between which readings change is removed",
        smaller="a carry that is lost near a border of the codes in every fourth reading remains in the fit",
    )  # fmt: skip
    one_size_spreads: float = threshold(
        20.0, "standard deviations of the noise by which they are off at least",
        larger="lost bits of a noisy sensor remain in the fit",
        smaller="a coarse step of the readings, whose two values noise alternates, looks the same",
    )  # fmt: skip
    large_spreads: float = threshold(
        4.0, "standard deviations from which on deviations show the tail of the noise, for what is to be expected beyond",
        larger="few readings tell the tail", smaller="the body of the noise decides on its tail",
    )  # fmt: skip
    tail_loss: float = threshold(
        2.0, "log-likelihood by which a heavier tail may be worse than the best and still be that of the noise",
        larger="few outliers are called a fault", smaller="heavy-tailed noise is called a fault",
        chosen_by="a 95 % interval of one parameter; pytest tests/diagnosis/test_null_noise.py",
    )  # fmt: skip
    disturbed_spreads: float = threshold(
        3.0, "standard deviations from which on a neighbour of an outlier is disturbed too, as in a burst of interference",
        larger="bursts are called faults of single readings", smaller="ordinary noise beside a fault hides it",
        chosen_by="tail of the normal distribution (one of six neighbours exceeds 3 in 1.6 % of cases); chosen by judgement",
    )  # fmt: skip
    read_part: float = threshold(
        0.5, "amplitude of a line or of outliers in the readings, over that in their residual to a measured reference, below "
        "which they are the reference's",
        larger="a vibration of the sensor is taken for the reference's", smaller="lines of a tracker's noise are reported",
    )  # fmt: skip
    outlier_chance: float = threshold(
        1e-4, "probability that the noise's own tail explains the outliers, above which the floor contains their power",
        larger="faults of the reading count as noise in the floor", smaller="heavy tails of the noise count as excess",
    )  # fmt: skip
    outlier_power: float = threshold(
        0.01, "power of a session's outliers, as a fraction of the white noise's power, from which on they are a finding",
        larger="outliers that raise the error are not reported",
        smaller="two outliers in an hour are a misfit",
    )  # fmt: skip
