"""When the evidence of sets of effects names an effect, supports a name of the tests, or fails it by a check."""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.policy.threshold import threshold


@dataclass(frozen=True)
class Evidence:
    """Thresholds of the evidence: its log odds, and the two checks of an effect that leads."""

    # Log odds
    sure_log_odds: float = threshold(
        3.0, "log odds (20 to 1) from which on the evidence is sure of an effect: it supports a name of the other tests, and "
        "names an effect that they only suggest or cannot tell from its rivals",
        larger="true names of the tests are only suggested, and fewer of rival effects are told apart",
        smaller="effects that resemble a disturbance are named: of eight names of the tests with less, three were wrong "
        "(gyrocal benchmark edge, the calibration and the work part)",
        chosen_by="gyrocal benchmark edge, the calibration and the work part (docs/evidence.md)",
    )  # fmt: skip
    supporting_log_odds: float = threshold(
        1.5, "log odds from which on the evidence supports a name of the tests if the held-out gain is beyond "
        "supported_gain_errors",
        larger="true names of a large gain are only suggested: of six that this limit kept five were true",
        smaller="wrong names are kept: of those with less of either, seven of twelve were true",
        chosen_by="gyrocal benchmark edge, the calibration and the work part, and eighty sessions of gyrocal benchmark blind",
    )  # fmt: skip
    supported_gain_errors: float = threshold(
        4.0, "standard errors of the held-out gain beyond which supporting_log_odds suffice",
        larger="true names are only suggested", smaller="wrong names are kept (the figures are those of supporting_log_odds)",
        chosen_by="gyrocal benchmark edge, the calibration and the work part, and eighty sessions of gyrocal benchmark blind",
    )  # fmt: skip
    least_hint: float = threshold(
        0.1, "probability of an effect beside a sure name on its axis, below which it is not suggested",
        larger="a second effect on an axis is not suggested",
        smaller="effects are suggested that share the shape of the one that is named: of 82 with less none was true",
        chosen_by="gyrocal benchmark edge, 175 sessions of the frozen part, and 87 sessions of others",
    )  # fmt: skip
    likely_hint: float = threshold(
        0.4, "probability from which on an effect that passes its checks is suggested, whatever the other tests make of it",
        larger="effects are rejected that are as probable as not", smaller="effects are suggested that are hardly probable",
    )  # fmt: skip
    adequate_noise: float = threshold(
        0.2, "probability of noise alone below which a model is not adequate, if the excess is of practical size",
        larger="noise in bursts, which left one of 24 axes with 0.48, is said to hold something "
        "(pytest tests/diagnosis/test_uneven_noise.py)",
        smaller="what is there and has no name is called adequate",
        chosen_by="chosen by judgement: with an excess of practical size it was below this in none of 41 adequate sessions of "
        "noise alone by two generators of others, and in 5 of 61 others",
    )  # fmt: skip
    practical_excess: float = threshold(
        0.1, "part of the floor from which on an excess is of practical size",
        larger="what is there and has no name is called adequate", smaller="chance makes an excess",
        chosen_by="chosen by judgement: it makes the rms half a percent larger than the floor",
    )  # fmt: skip
    leading_log_odds: float = threshold(
        -0.85, "log odds (a probability of 0.3) from which on an effect of the likeliest set is looked at more closely: its "
        "nonlinear parameter is refined and its checks are made",
        larger="an effect of which a refined parameter would make sure is not named",
        smaller="checks are made of effects that nothing names, which takes time",
    )  # fmt: skip
    weighable: float = threshold(
        1e-4, "part of the squared norm of an effect's column that the columns of the model in use must leave, or the evidence "
        "does not weigh the effect",
        larger="effects of few readings have no probability", smaller="rounding errors of the columns are weighed",
    )  # fmt: skip

    # Checks of an effect that leads
    least_share: float = threshold(
        0.25, "part of the power that an effect and a disturbance without a name explain together, from which on the effect "
        "passes the check of its share",
        larger="true effects fail beside a disturbance: of seven names with less than half of the power five were true",
        smaller="a part of a disturbance is named: of those with less than a quarter three of four were true",
        chosen_by="gyrocal benchmark edge, the calibration and the work part",
    )  # fmt: skip
    different_chance: float = threshold(
        1e-3, "probability that chance makes the sizes of an effect differ as much between the parts of the data, below which "
        "they differ",
        larger="true effects fail the check by chance", smaller="a disturbance that resembles an effect in part passes it",
    )  # fmt: skip
    shown_in_part: float = threshold(
        1e-3, "part of an effect's power that must differ between two parts of the data, so that they say anything of its size",
        larger="few effects can be checked", smaller="parts that hardly show the effect decide whether it passes",
    )  # fmt: skip
    largest_difference: float = threshold(
        0.18, "rms of the difference between the parts that chance does not explain, over the rms of the effect, up to which "
        "it says that no model is exact, if the log odds are at least exact_log_odds, or main_log_odds beside main_share",
        larger="wrong names pass: those of the calibration and the work part with log odds beyond 2.2 begin at 0.21",
        smaller="true effects fail: on recordings of a shaft with an encoder they differ by up to 0.16",
        chosen_by="gyrocal benchmark edge, the calibration and the work part; docs/evidence.md has the recording",
    )  # fmt: skip
    exact_log_odds: float = threshold(
        20.0, "log odds from which on there are so many data that the sizes of a true effect differ significantly too",
        larger="true effects fail on long recordings",
        smaller="misalignment for an offset that settles passes (log odds 14, share 0.92)",
        chosen_by="gyrocal benchmark edge --part frozen, six states of the code",
    )  # fmt: skip
    main_log_odds: float = threshold(
        8.0, "log odds from which on they do so for an effect that has main_share",
        larger="a misalignment fails on the recording of a shaft with an encoder (12.7): a curve over the rate is nearly it",
        smaller="of two names with less (3 and 6) and that share, both were wrong; of two with more (9 and 10), none",
        chosen_by="gyrocal benchmark edge --part frozen, six states of the code; gyrocal benchmark real",
    )  # fmt: skip
    main_share: float = threshold(
        0.95, "share from which on an effect is all but all that is left over on its axis",
        larger="true effects fail on long recordings; on that of the shaft the shares are 0.991 and 0.996",
        smaller="misalignment for an offset that settles passes (log odds 14, share 0.92)",
        chosen_by="gyrocal benchmark edge --part frozen, six states of the code; gyrocal benchmark real",
    )  # fmt: skip
