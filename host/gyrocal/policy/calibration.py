"""Whether an estimate of scale and bias is trusted."""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.policy.threshold import threshold

DEVICE = "chosen by judgement; pytest tests/parity/test_constants.py compares it with the device's"


@dataclass(frozen=True)
class Calibration:
    """Thresholds that raise a flag against an estimate. ``gc_judge.c``, ``gc_trust.c`` and ``gc_cnn.c`` have the same."""

    opposite: float = threshold(
        0.1, "fraction of the true rate beyond which a reading that follows it backwards has the flag direction",
        larger="a reversed sensor of small scale is called implausible instead",
        smaller="the misalignment of an axis across the table's is called a reversed sensor",
        chosen_by="misalignments of parts stay below it; pytest tests/calibration/test_trust.py",
    )  # fmt: skip
    opposite_errors: float = threshold(
        5.0, "standard errors of the scale by which the reading must also follow the rate backwards",
        larger="reversed sensors in short noisy runs have no flag", smaller="noise is called a reversed sensor",
        chosen_by="tail of the normal distribution; pytest tests/calibration/test_trust.py",
    )  # fmt: skip
    frozen_s: float = threshold(
        0.5, "time without a change of the reading from which on an estimate has the flag constant_reading, s",
        larger="short failures of the bus pass", smaller="a slow output rate is called a failure", chosen_by=DEVICE,
    )  # fmt: skip
    frozen_samples: int = threshold(
        40, "number of equal successive readings from which on an estimate has the flag constant_reading",
        larger="failures at low sample rates pass", smaller="chance makes readings of quiet sensors equal", chosen_by=DEVICE,
    )  # fmt: skip
    misfit_errors: float = threshold(
        2.5, "standard deviations by which the misfit of noise alone must be exceeded for the flag misfit, or by which the "
        "last turn of the first run must differ from the answer",
        larger="answers with unmodelled effects are trusted", smaller="sound answers are flagged",
        chosen_by="tail of the normal distribution; pytest tests/parity/test_constants.py",
    )  # fmt: skip
    network_disagrees: float = threshold(
        4.5, "expected error of the network's answer, by a fit that contains the effects, over its stated standard error",
        larger="wrong answers of the network are trusted on tables unlike those of its training",
        smaller="more answers are flagged on the tables for which the network was trained",
        chosen_by="gyrocal benchmark population: none of 2000 sound sensors exceeds it",
    )  # fmt: skip
    network_table_rate: float = threshold(
        0.03, "relative deviation from the table rate of its training up to which a network answers",
        larger="the network answers for effects of another size", smaller="tables with a rough speed setting have no answer",
        chosen_by=DEVICE,
    )  # fmt: skip
    network_sample_rate: float = threshold(
        1e-3, "relative deviation from the sample rate of its training up to which a network answers",
        larger="the network answers for another time scale", smaller="rounding of a stated rate leaves no answer",
    )  # fmt: skip
    ages_errors: float = threshold(
        3.0, "standard errors of the change of a parameter a year beyond which a model over months follows the line",
        larger="models keep the mean of an ageing sensor", smaller="models follow the chance of few sessions",
        chosen_by="tail of the normal distribution; pytest tests/fleet/test_history.py",
    )  # fmt: skip
    beyond_part: float = threshold(
        0.05, "part of the width of the range of rates or accelerations of a model's session that may be added at both ends "
        "before a sample lies beyond the model", larger="a rate that no term was fitted to passes",
        smaller="a table that turns a few percent faster is beyond the model",
    )  # fmt: skip
    beyond_rate_dps: float = threshold(
        2.0, "rate by which a sample may exceed these ends besides, deg/s",
        larger="slow turns about an axis about which the session never turned pass",
        smaller="the bias of another power cycle or a table that is not level is called a rate beyond the model",
    )  # fmt: skip
    beyond_acc_g: float = threshold(
        0.1, "acceleration by which a sample may exceed these ends besides, g",
        larger="tilts pass of which a sensitivity to gravity is not known",
        smaller="the accelerometer's own bias is called an acceleration beyond the model",
    )  # fmt: skip
    beyond_temp_c: float = threshold(
        1.0, "temperature beyond those of a model's session from which on the warning beyond_model is given, °C",
        larger="models are used in the cold or heat without a word",
        smaller="the next day's room is called a temperature beyond the model",
    )  # fmt: skip
