"""The thresholds that decide a verdict, in one place.

Each states what it means, what a larger and a smaller value would do, and what chose it: a command whose figures did, a test
that holds it, or a law. Where none did, that is said. ``gyrocal benchmark blind`` measured all of them together on 180 sessions
(docs/blind.md); unless a threshold says otherwise, it was not varied by itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

JUDGEMENT = "chosen by judgement; not yet measured by itself"


def threshold(value: float, meaning: str, *, larger: str, smaller: str, chosen_by: str = JUDGEMENT) -> Any:
    """A field of the policy with what has to be known of it."""
    words = {"meaning": meaning, "larger": larger, "smaller": smaller, "chosen_by": chosen_by}
    return field(default=value, metadata=words)


@dataclass(frozen=True)
class Policy:
    """Every threshold of outliers, held-out data, comparison, diagnosis and ``keep``."""

    # Outliers: single readings
    outlier_spreads: float = threshold(
        8.0, "spreads of its surroundings by which a reading must differ from its neighbours to be an outlier",
        larger="readings thrown off by less move block means and pass for effects",
        smaller="ordinary noise is taken out of the fits: Gaussian noise differs by 8 once in 10^15 readings",
        chosen_by="tail of the normal distribution; pytest tests/recording/test_outliers.py",
    )  # fmt: skip
    most_outliers: float = threshold(
        0.05, "part of a run's readings up to which they are outliers",
        larger="a sensor that reads in two ways has one of them taken out",
        smaller="a bus that loses bits more often is fitted as it is",
    )  # fmt: skip
    outlier_power: float = threshold(
        0.01, "power of a session's outliers, as a part of the white noise's, from which on they are a finding",
        larger="outliers that raise the error go unmentioned",
        smaller="two odd readings of an hour make a misfit",
    )  # fmt: skip

    # Held-out data
    time_blocks: int = threshold(
        5, "parts of each run that are left out in turn, where no run can be",
        larger="less is left out at a time, and slow effects are seen in the rest",
        smaller="parameters come from fewer data than the final fit uses",
    )  # fmt: skip
    time_gap_s: float = threshold(
        2.0, "time beside a left-out part of a run that is left out of the rest too, s",
        larger="less data to fit", smaller="drift carries from the rest into the left-out part",
    )  # fmt: skip
    shortest_run_s: float = threshold(
        20.0, "shortest run that is cut into parts, s",
        larger="short sessions have no held-out figures, and nothing can be added",
        smaller="parts as short as the drift are judged",
    )  # fmt: skip

    # Comparison: is something left over
    misfit_alarm: float = threshold(
        0.01, "chance of any finding in a session that holds no misfit, all tests of all axes together",
        larger="more false alarms; together with name_alarm it must stay below 0.02",
        smaller="small effects are not seen",
        chosen_by="half of the 2 % that all tests together may have; gyrocal benchmark blind: 0 of 72 nulls",
    )  # fmt: skip
    least_blocks: int = threshold(
        40, "blocks of 0.1 s below which nothing is judged",
        larger="seconds of data are called adequate unseen", smaller="asymptotic chances are used where they do not hold",
    )  # fmt: skip
    floor_line_chance: float = threshold(
        1e-3, "chance below which a line of the spectrum is no noise, and is left out of the floor",
        larger="noise is taken out of the floor, and the excess grows",
        smaller="weak tones count as noise, and their excess is hidden",
    )  # fmt: skip
    least_scatter: int = threshold(
        10, "degrees of freedom of the scatter within blocks below which the fit's white noise is the floor",
        larger="slow recordings use the fitted level", smaller="the floor comes from a handful of readings",
    )  # fmt: skip
    bump: float = threshold(
        0.15, "excess of a band's power over its neighbours', as a part of theirs, to be a bump",
        larger="tones that wander are not seen", smaller="the knee of a sensor's low-pass filter passes for a tone",
        chosen_by="pytest tests/diagnosis/test_whiteness.py (a second-order low-pass at 33 Hz is no bump)",
    )  # fmt: skip
    bands: int = threshold(
        6, "bands of frequency between drift and the block rate in which power is held against the noise",
        larger="each band has fewer values, and each test pays for more of them",
        smaller="a narrow disturbance is diluted in a wide band",
    )  # fmt: skip
    least_periodogram_values: int = threshold(
        4, "independent values of the periodogram that a band must hold to be judged",
        larger="short runs are not judged at low frequencies", smaller="a single value decides",
    )  # fmt: skip
    least_periodogram_blocks: int = threshold(
        64, "blocks that a run must hold to have a periodogram",
        larger="runs of some seconds are left out", smaller="bands of a few values",
    )  # fmt: skip
    wave_gain: float = threshold(
        2.0, "gain in log-likelihood below which a shape of each run is dropped, where the model has no drift",
        larger="weak waves are missed", smaller="more fits of waves that are not there: time, no alarms",
    )  # fmt: skip
    refit_gain: float = threshold(
        0.5, "gain in log-likelihood from which on the noise is estimated again with a shape of each run",
        larger="a wave is judged by a noise that holds it", smaller="more time for shapes that gain nothing",
    )  # fmt: skip
    toggling: float = threshold(
        0.25, "deviation from one half of the share of ones, of a bit that noise toggles, to be stuck",
        larger="a bit that sticks at times is not seen", smaller="a bit at the edge of the noise looks stuck",
    )  # fmt: skip
    known_step: float = threshold(
        0.75, "part of the model's own quantization step below which no bit is looked at",
        larger="the bit above the step is left out too", smaller="the step that the model knows is found again",
    )  # fmt: skip

    # Diagnosis: suggest
    false_discovery_rate: float = threshold(
        0.05, "share of false ones allowed among the suggested effects (Benjamini and Hochberg)",
        larger="more suggestions that are noise", smaller="fewer rivals are known, so groups are incomplete",
        chosen_by="convention; its part in the verdicts is chosen by judgement",
    )  # fmt: skip
    measurable: float = threshold(
        0.01, "part of a candidate's norm that must be left beside the model's own columns",
        larger="effects that a session could show are called not measurable",
        smaller="a parameter is fitted to what rounding leaves of its columns",
    )  # fmt: skip

    # Diagnosis: add
    name_alarm: float = threshold(
        0.01, "chance that any effect of a session without effects is named, all candidates together",
        larger="more false names; together with misfit_alarm it must stay below 0.02", smaller="small effects are not named",
        chosen_by="half of the 2 % that all tests together may have; gyrocal benchmark blind: 0 of 72 nulls",
    )  # fmt: skip
    gain_errors: float = threshold(
        2.0, "standard errors by which the held-out gain must exceed zero",
        larger="effects that help some runs only are not named",
        smaller="an effect is named though half of the runs are predicted worse",
    )  # fmt: skip
    reading_loss: float = threshold(
        1.0, "held-out log-likelihood that a fault of the reading may cost: it is seen in the codes themselves",
        larger="a wrong fault is named though predictions get worse",
        smaller="a fault that does not change the predictions is not named",
    )  # fmt: skip
    explained: float = threshold(
        0.10, "part of the excess that an effect must explain",
        larger="of several effects the small ones are not named", smaller="effects that hardly matter are named",
    )  # fmt: skip
    floor_errors: float = threshold(
        2.0, "standard errors of the floor granted to the excess that is to be explained",
        larger="anything explains enough of an excess that may be none",
        smaller="in sessions of few power cycles nothing explains enough",
    )  # fmt: skip
    main_cause: float = threshold(
        0.5, "part of the excess above which an effect is named whatever the probes gain",
        larger="a cause that the probes show better in another shape is not named",
        smaller="what explains a third of the excess is named before the rest is looked at",
    )  # fmt: skip
    of_finding: float = threshold(
        0.25, "part of the log-likelihood of the axis's strongest finding that an effect must gain",
        larger="causes that a probe describes better than they describe themselves are not named",
        smaller="an effect is named that explains a small remainder beside a large cause",
    )  # fmt: skip
    range_factor: float = threshold(
        10.0, "times its typical size that a parameter may have and still be in physical range",
        larger="sizes that no sensor has are named", smaller="strong effects are not named",
        chosen_by="the definition of a physical range; the factor is chosen by judgement",
    )  # fmt: skip
    mean_errors: float = threshold(
        2.0, "standard errors that the mean over the runs must have, where an effect has one",
        larger="transients with a small common part are not named", smaller="differences between runs pass for an effect",
    )  # fmt: skip
    even: float = threshold(
        0.5, "median over root mean square of a wave's size in each run, for a wave that has one size in all",
        larger="noise makes a steady tone look uneven: with noise alone it is 0.83",
        smaller="a tone in half of the runs is named",
        chosen_by="square root of ln 2 for noise alone (Rayleigh); chosen between it and 0",
    )  # fmt: skip

    # Diagnosis: rivals
    similar_shape: float = threshold(
        0.7, "cosine similarity of two fitted signals above which they may be one cause",
        larger="a name is given where the session cannot tell two effects apart",
        smaller="effects that the session does tell apart are shown as a group",
    )  # fmt: skip
    same_shape: float = threshold(
        0.97, "cosine similarity above which two signals are the same, and the simpler effect is taken",
        larger="of two effects that only parameters part, both are shown",
        smaller="the simpler effect hides a true one of a slightly different shape",
    )  # fmt: skip
    rival_errors: float = threshold(
        2.0, "standard errors by which one held-out gain must exceed a rival's",
        larger="larger groups", smaller="one of two equally good effects is named by chance",
    )  # fmt: skip
    parameter_gain: float = threshold(
        2.0, "held-out log-likelihood that each further parameter must gain over a rival of the same shape",
        larger="the true effect yields to a simpler one", smaller="a richer effect wins by fitting noise",
    )  # fmt: skip
    noisy_columns: float = threshold(
        0.01, "part of a gain that columns with noise of their own (an accelerometer's) may lose against computed ones",
        larger="a computed effect and a measured one stay a group though the gains differ",
        smaller="the measured one loses by its noise alone",
    )  # fmt: skip

    # Keep
    most_terms: int = threshold(
        8, "terms that a formula may have",
        larger="formulas that nobody can read", smaller="a curve of several bends is cut short",
    )  # fmt: skip


POLICY = Policy()
