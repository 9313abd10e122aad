"""Whether a model fits, and which effect it lacks."""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.policy.threshold import threshold


@dataclass(frozen=True)
class Diagnosis:
    """Thresholds of held-out data, comparison, diagnosis and ``keep``."""

    # Held-out data
    least_left: float = threshold(
        1e-6, "fraction of the information on any combination of parameters that must remain when a unit is left out",
        larger="sessions in which one unit shows most of an effect are judged by blocks of time",
        smaller="a parameter is determined by rounding errors of its columns, and the left-out unit is predicted by chance",
    )  # fmt: skip
    time_blocks: int = threshold(
        5, "parts of each run that are left out in turn if no whole run can be left out",
        larger="less is left out at a time, and the remaining data show slow effects of the left-out part",
        smaller="parameters are fitted to fewer data than in the final fit",
    )  # fmt: skip
    time_gap_s: float = threshold(
        2.0, "gap on both sides of a left-out part of a run, s",
        larger="fewer data remain for the fit", smaller="drift correlates the left-out part with the rest",
    )  # fmt: skip
    shortest_run_s: float = threshold(
        20.0, "shortest run that is cut into parts, s",
        larger="short sessions have no held-out figures, and no effect can be added",
        smaller="parts become as short as the correlation time of the drift",
    )  # fmt: skip

    # Comparison: is something left over
    misfit_alarm: float = threshold(
        0.01, "probability of any finding in a session without a misfit, over all tests of all axes",
        larger="more false alarms; together with name_alarm it must stay below 0.02",
        smaller="small effects are not detected",
        chosen_by="half of the 2 % allowed for all tests together; gyrocal benchmark blind: 0 of 72 nulls",
    )  # fmt: skip
    least_blocks: int = threshold(
        40, "smallest number of blocks of 0.1 s that is judged",
        larger="several seconds of data are called adequate without a test",
        smaller="asymptotic probabilities are used where they do not hold",
    )  # fmt: skip
    floor_line_chance: float = threshold(
        1e-3, "probability under noise below which a line of the spectrum is excluded from the floor",
        larger="noise is excluded from the floor, and the excess grows",
        smaller="weak tones count as noise, and their excess is hidden",
    )  # fmt: skip
    least_scatter: int = threshold(
        10, "degrees of freedom of the scatter within blocks below which the floor uses the white noise of the fit",
        larger="more slow recordings use the fitted level", smaller="the floor is estimated from a few readings",
    )  # fmt: skip
    few_cycles: int = threshold(
        8, "number of power cycles below which the explained part is computed within power cycles",
        larger="effects that differ only between power cycles have no explained part",
        smaller="offset and scale of a few power cycles decide the explained part",
        chosen_by="docs/details/decisions.md, rms, floor and excess",
    )  # fmt: skip
    least_excess: float = threshold(
        0.3, "smallest excess within power cycles over the floor that is a misfit although no test finds its shape",
        larger="an error of unknown shape is called adequate",
        smaller="noise whose level changes or that has heavy tails is called a misfit",
        chosen_by="bursts and Student's t noise of benchmarks/null_noise.py leave up to 0.25; chosen by judgement above it",
    )  # fmt: skip
    told: float = threshold(
        0.25, "fraction of an axis's squared excess that its findings must describe, or the excess is a finding of its own",
        larger="an excess is reported beside the findings that make it up",
        smaller="a small finding hides a large error of unknown shape",
    )  # fmt: skip
    alike: float = threshold(
        0.1, "fraction of the residual's mean square by which two variables describe an excess equally well",
        larger="a variable of few steps is reported although the picture of another shows more",
        smaller="time in the run is reported for every cause that changes smoothly in time",
    )  # fmt: skip
    cancelled: float = threshold(
        1.1, "size of one wave over that of all waves together, above which the waves cancel each other and none is told alone",
        larger="a wave is told that no picture shows", smaller="the largest wave of a table is not told",
    )  # fmt: skip
    as_large: float = threshold(
        0.5, "amplitude of a wave over that of a line at its frequency from which on the line is the wave's",
        larger="a wave of the table is told again as a line", smaller="a disturbance of irregular period is told as waves",
        chosen_by="pytest tests/blind/test_sample.py: stick-slip has 0.3 as a wave",
    )  # fmt: skip
    more_as_line: float = threshold(
        1.2, "energy of a line in all runs over that of a wave in the runs that turn, from which on the line is told",
        larger="a line of one frequency is told as a wave of the table", smaller="a wave of the table is told as a line",
    )  # fmt: skip
    visible: float = threshold(
        0.5, "fraction of the residual's mean square that follows a variable, from which on an excess is reported against it",
        larger="an excess that a picture shows is said to have no shape", smaller="noise names the variable of an excess",
    )  # fmt: skip
    excess_errors: float = threshold(
        2.0, "standard errors below which an excess has no explained part",
        larger="fewer candidates have an explained part", smaller="the explained part is a ratio of two noises",
        chosen_by="docs/details/decisions.md, rms, floor and excess",
    )  # fmt: skip
    adequate_errors: float = threshold(
        3.0, "standard errors up to which the excess of an adequate model is noise",
        larger="a model is adequate beside an excess that is told with a small error", smaller="noise alone is a misfit",
        chosen_by="chosen by judgement; pytest tests/diagnosis/test_angles.py: twelve sessions of turns and noise are adequate",
    )  # fmt: skip
    bump: float = threshold(
        0.15, "relative excess of a band's power over that of its neighbours from which on it is a bump",
        larger="tones that wander are not detected", smaller="the knee of a sensor's low-pass filter counts as a tone",
        chosen_by="pytest tests/diagnosis/test_whiteness.py (a second-order low-pass at 33 Hz is no bump)",
    )  # fmt: skip
    clock_errors: float = threshold(
        4.0, "standard errors by which another axis excludes the error of a clock that serves all axes",
        larger="an error of one axis is named an error of the clock",
        smaller="errors that are too small beside a misfit of one axis hide an error of the clock",
        chosen_by="chosen by judgement",
    )  # fmt: skip
    rates_per_wave: float = threshold(
        4.0, "number of different rates, to a hundredth of their range, for each period of a wave over the rate",
        larger="such a wave in a staircase of few levels is given the name of another effect",
        smaller="a wave follows any error of a few rates, between which nobody measured, and known effects lose their names",
        chosen_by="pytest tests/diagnosis/test_rate_wave.py",
    )  # fmt: skip
    rates_alike: float = threshold(
        0.01, "part of the range of the rate within which rates count as one",
        larger="the waves of a converter with many steps are not looked for", smaller="a table's wander counts as many rates",
        chosen_by="pytest tests/diagnosis/test_rate_wave.py",
    )  # fmt: skip
    rates_kept: float = threshold(
        0.95, "part of the block means, those of the most frequent rates, whose different rates are counted",
        larger="block means between two levels count as rates", smaller="the ends of a motion by hand do not count",
        chosen_by="pytest tests/diagnosis/test_rate_wave.py",
    )  # fmt: skip
    most_rate_cycles: float = threshold(
        40.0, "largest number of periods of a wave over the range of the rate",
        larger="more looks, which hide a faint wave", smaller="a nonlinearity with more periods is not found",
        chosen_by="chosen by judgement",
    )  # fmt: skip
    louder_in_time: float = threshold(
        0.001, "probability under noise below which a patch of a spectrogram is louder than the frequencies beside it",
        larger="a change of the noise's level, stronger at low frequencies, counts as interference",
        smaller="a tone of a second, which has few neighbours, is not found", chosen_by="chosen by judgement",
    )  # fmt: skip
    white_beyond: float = threshold(
        0.1, "scatter of samples within blocks, relative to that of white noise with the density of the fastest block means, "
        "from which on the knee of a low-pass lies above 5 Hz",
        larger="sessions behind a low-pass are not searched for humps", smaller="the knee of a low-pass counts as a hump",
        chosen_by="python benchmarks/null_noise.py: 0.01 to 0.03 behind 5 Hz, 0.2 and more behind 12 Hz",
    )  # fmt: skip
    white_within: float = threshold(
        0.7, "the same scatter, below which the knee of a low-pass may lie within the examined frequencies",
        larger="a hump of white noise counts as the knee of a low-pass", smaller="the knee of a low-pass counts as a hump",
        chosen_by="pytest tests/diagnosis/test_power_band.py: 0.15 to 0.61 behind 3 to 5 Hz, 1 for white noise",
    )  # fmt: skip
    bands: int = threshold(
        6, "number of frequency bands between drift and the block rate in which power is compared with the noise",
        larger="each band has fewer values, and the correction for multiple tests grows",
        smaller="a narrow disturbance is diluted in a wide band",
    )  # fmt: skip
    least_periodogram_values: int = threshold(
        4, "independent values of the periodogram that a band must hold to be judged",
        larger="short runs are not judged at low frequencies", smaller="a single value can decide",
    )  # fmt: skip
    least_periodogram_blocks: int = threshold(
        64, "smallest number of blocks of a run with a periodogram",
        larger="runs of several seconds are left out", smaller="bands contain only a few values",
    )  # fmt: skip
    wave_gain: float = threshold(
        2.0, "gain in log-likelihood below which a shape of each run is dropped if the model has no drift",
        larger="weak waves are missed", smaller="absent waves are fitted more often, which takes time but causes no alarms",
    )  # fmt: skip
    refit_gain: float = threshold(
        0.5, "gain in log-likelihood from which on the noise is estimated again with a shape of each run",
        larger="a wave is judged against noise that includes it", smaller="more time for shapes without a gain",
    )  # fmt: skip
    toggling: float = threshold(
        0.25, "deviation of the fraction of ones from one half from which on a bit that noise toggles counts as stuck",
        larger="a bit that sticks at times is not detected", smaller="a bit at the edge of the noise counts as stuck",
    )  # fmt: skip
    known_step: float = threshold(
        0.75, "fraction of the model's own quantization step below which bits are not tested",
        larger="the bit above the step is not tested either", smaller="the step that the model contains is found again",
    )  # fmt: skip

    # Diagnosis: suggest
    false_discovery_rate: float = threshold(
        0.05, "false-discovery rate allowed among the suggested effects (Benjamini and Hochberg)",
        larger="more suggestions that are noise", smaller="fewer rivals are known, so groups are incomplete",
        chosen_by="convention; its role in the verdicts is chosen by judgement",
    )  # fmt: skip
    measurable: float = threshold(
        0.005, "fraction of a candidate's squared norm that must be independent of the model's own columns",
        larger="effects that a session could show are called not measurable",
        smaller="a parameter is fitted to rounding errors of its columns",
    )  # fmt: skip

    # Diagnosis: add
    name_alarm: float = threshold(
        0.01, "probability that any effect is named in a session without effects, over all candidates",
        larger="more false names; together with misfit_alarm it must stay below 0.02", smaller="small effects are not named",
        chosen_by="half of the 2 % allowed for all tests together; gyrocal benchmark blind: 0 of 72 nulls",
    )  # fmt: skip
    moved_alarm: float = threshold(
        0.002, "probability that a parameter of another session's model is said to have moved when none has, over all of them",
        larger="more false alarms beside those of misfit_alarm and name_alarm", smaller="small changes are not told",
        chosen_by="a tenth of the 2 % allowed for all tests together; pytest tests/diagnosis/test_as_is.py",
    )  # fmt: skip
    gain_errors: float = threshold(
        2.0, "standard errors by which the held-out gain must exceed zero",
        larger="effects that improve only some runs are not named",
        smaller="an effect is named though half of the runs are predicted worse",
    )  # fmt: skip
    evident_gain: float = threshold(
        11.0, "held-out log-likelihood that a name which the evidence alone gives must gain, and one of a session by hand, "
        "which has no evidence of sets",
        larger="an effect that hides behind another is not named",
        smaller="what resembles a disturbance is named though it hardly predicts: of such names with less than 11, six of six "
        "were wrong, with more two of nineteen",
        chosen_by="gyrocal benchmark edge --part frozen, five states of the code (docs/evidence.md)",
    )  # fmt: skip
    unweighed_gain: float = threshold(
        50.0, "held-out log-likelihood that a wave, jumps or a dead band must gain: the evidence of sets cannot weigh them",
        larger="small waves are suggested and not named: of five such names with 50 to 100 four were true",
        smaller="what else has a part at that frequency, or a course in the runs, is named: of nine such names with less than "
        "50 four were wrong",
        chosen_by="gyrocal benchmark edge --part frozen, five states of the code, diagnosed anew (docs/evidence.md)",
    )  # fmt: skip
    shown_by_codes: float = threshold(
        1e-8, "probability of the codes of sound readings below which they show a fault although no gain confirms it",
        larger="one of many sound axes whose codes look odd is given a fault",
        smaller="a fault of few readings, which changes no prediction, is only suggested",
        chosen_by="chosen by judgement, far below what the number of axes and tests explains",
    )  # fmt: skip
    reading_loss: float = threshold(
        1.0, "loss of held-out log-likelihood that is allowed for a fault of the reading, which the codes themselves show",
        larger="a wrong fault is named although predictions get worse",
        smaller="a fault that does not change the predictions is not named",
    )  # fmt: skip
    explained: float = threshold(
        0.10, "fraction of the excess that an effect must explain",
        larger="small effects beside large ones are not named", smaller="effects that hardly matter are named",
    )  # fmt: skip
    floor_errors: float = threshold(
        2.0, "standard errors of the floor by which the excess to be explained is reduced",
        larger="any effect explains enough of an excess that may be zero",
        smaller="no effect explains enough in sessions with few power cycles",
    )  # fmt: skip
    main_cause: float = threshold(
        0.5, "fraction of the excess above which an effect is named whatever the probes gain",
        larger="a cause is not named if a probe describes it better in another shape",
        smaller="an effect that explains a third of the excess is named before the rest is examined",
    )  # fmt: skip
    of_finding: float = threshold(
        0.25, "fraction of the log-likelihood of the axis's strongest finding that an effect must gain",
        larger="a cause is not named if a probe describes it better than the effect's own model",
        smaller="an effect is named that explains a small remainder beside a large cause",
    )  # fmt: skip
    range_factor: float = threshold(
        10.0, "ratio of a parameter to its typical size up to which it is in physical range",
        larger="effects are named with sizes that no sensor has", smaller="strong effects are not named",
        chosen_by="the definition of a physical range; the factor is chosen by judgement",
    )  # fmt: skip
    mean_errors: float = threshold(
        2.0, "standard errors by which the mean over the runs must differ from zero if an effect has a common mean",
        larger="transients with a small common part are not named", smaller="differences between runs count as an effect",
    )  # fmt: skip
    even: float = threshold(
        0.5, "smallest ratio of median to root mean square over the runs' sizes of a tone",
        larger="noise makes a steady tone look uneven; with noise alone the ratio is 0.83",
        smaller="a tone in half of the runs is named",
        chosen_by="square root of ln 2 for noise alone (Rayleigh); chosen between this and 0",
    )  # fmt: skip
    coherent: float = threshold(
        0.5, "smallest part of a vibration's power that keeps one phase within each run",
        larger="a motor whose speed wanders is no tone", smaller="a resonance of the mount is named a vibration",
        chosen_by="half of the power; pytest tests/diagnosis/test_mistaken.py has a resonance and a tone",
    )  # fmt: skip
    coherent_turn: float = threshold(
        0.8, "smallest part of the power of a wave over the table's angle that keeps one phase within each run",
        larger="a wave beside another of nearly its order is not named", smaller="stick-slip is named a ripple",
        chosen_by="waves of the table keep 0.94 and more, periods that differ by 30 % 0.76 and less; chosen by judgement "
        "between; pytest tests/diagnosis/test_mistaken.py",
    )  # fmt: skip
    another_line: float = threshold(
        1.5, "frequency of a line over the highest one of a tone from which on the line has another cause",
        larger="lines of another cause keep a tone from being named", smaller="a tone is named beside a line that is its own",
    )  # fmt: skip
    left_of_line: float = threshold(
        2.0, "amplitude of a line over that of a term's line at the same frequency up to which a filter leaves it of that one",
        larger="a vibration of the same frequency is taken for it", smaller="the line of rectified vibration stays unknown",
        chosen_by="a delay of half a period makes it 2, a second-order low-pass 1.27; pytest tests/diagnosis/test_physics.py",
    )  # fmt: skip
    late_repeats: float = threshold(
        1.5, "delay over the mean age of repeated readings up to which these are its cause",
        larger="a delay beside many repeated readings is not named", smaller="repeated readings are named a delay as well",
        chosen_by="fits of repeated readings find 0.8 to 1.0; pytest tests/diagnosis/test_repeated_readings.py",
    )  # fmt: skip
    most_parts: int = threshold(
        8, "largest number of parts of a run in which the phase of a tone is compared, of at least four periods each",
        larger="each part knows the phase of a weak tone less well", smaller="a resonance keeps its phase over a part of a run",
    )  # fmt: skip
    coherence_errors: float = threshold(
        4.0, "standard errors by which power without a common phase must exceed noise to speak against a tone",
        larger="a weak resonance is named a vibration", smaller="noise speaks against a weak tone",
    )  # fmt: skip
    wave_of_reference: float = threshold(
        0.5, "part of a wave in the readings that the reference must hold for the wave to be the reference's",
        larger="the beat of an encoder's steps with the sampling is named an error of the sensor",
        smaller="a vibration that the reference follows in part is not named",
        chosen_by="pytest tests/diagnosis/test_tone_of_reference.py",
    )  # fmt: skip
    size_within: float = threshold(
        0.1, "standard deviation of the sizes of a wave of the table about their law, relative to the strongest one: no law is "
        "exact, and what leaks from one order into another has no one size",
        larger="over less than two turns, disturbances of nearly one size in the runs are named a wave of the table",
        smaller="a true wave whose size differs a little from run to run is not named",
        chosen_by="the waves that five frozen parts of gyrocal benchmark edge named: 20 of 20 true ones have even odds or "
        "better (docs/evidence.md)",
    )  # fmt: skip

    # Diagnosis: rivals
    overlap: float = threshold(
        0.3, "cosine similarity of two fitted signals above which `explain` compares the effects as sets",
        larger="effects that absorb a part of each other are added one by one",
        smaller="more sets are fitted, which takes longer",
    )  # fmt: skip
    largest_set: int = threshold(
        3, "largest number of overlapping effects that `explain` adds together",
        larger="more sets are fitted, which takes longer", smaller="three effects that need each other are not found",
    )  # fmt: skip
    member_errors: float = threshold(
        1.0, "standard errors by which each member must raise the held-out gain of a set; the set as a whole needs gain_errors",
        larger="sets whose members share a shape are not found, because a few held-out units show the share of each poorly",
        smaller="a member joins a set that predicts as well without it",
        chosen_by="the one-standard-error rule (Breiman and others 1984); gyrocal benchmark real: x in the chamber",
    )  # fmt: skip
    largest_pool: int = threshold(
        5, "largest number of overlapping effects of which `explain` forms sets; five give 25 sets",
        larger="more sets are fitted, which takes longer", smaller="the true effect may be left out of the sets",
    )  # fmt: skip
    most_steps: int = threshold(
        12, "largest number of steps that `explain` makes unless the user gives another",
        larger="a wrong path is followed longer", smaller="a session with many effects needs several calls",
    )  # fmt: skip
    noticeable: float = threshold(
        0.1, "fraction of an axis's squared excess, without a step of `explain`, that the step must remove to matter",
        larger="more effects are reported as too small to matter", smaller="fewer effects are reported as too small to matter",
    )  # fmt: skip
    similar_shape: float = threshold(
        0.7, "cosine similarity of two fitted signals above which they may be one cause",
        larger="an effect is named although the session cannot tell it from another",
        smaller="effects that the session can tell apart are shown as a group",
    )  # fmt: skip
    same_shape: float = threshold(
        0.97, "cosine similarity above which two signals count as equal, and the simpler effect is preferred",
        larger="two effects that differ only in their number of parameters are both shown",
        smaller="the simpler effect hides a true effect of a slightly different shape",
    )  # fmt: skip
    rival_errors: float = threshold(
        2.0, "standard errors by which a held-out gain must exceed that of a rival",
        larger="larger groups", smaller="one of two equally good effects is named by chance",
    )  # fmt: skip
    needed: float = threshold(
        1e-3, "probability of a candidate's gain beside a rival below which it is needed there",
        larger="one of two equally good effects is named by chance", smaller="larger groups",
        chosen_by="3.3 standard errors, which a difference of 5 reaches in 95 %; pytest tests/diagnosis/test_mistaken.py",
    )  # fmt: skip
    needless: float = threshold(
        0.05, "probability of a rival's gain beside a candidate above which it is not needed there",
        larger="a rival that noise makes look needed stays in the group", smaller="a rival that acts too is left out",
    )  # fmt: skip
    parameter_gain: float = threshold(
        2.0, "held-out log-likelihood that each further parameter must gain over a rival of the same shape",
        larger="a simpler effect is preferred to the true one", smaller="a richer effect is preferred because it fits noise",
    )  # fmt: skip
    noisy_columns: float = threshold(
        0.01, "fraction of a gain that noisy measured columns (an accelerometer's) may lose against computed ones",
        larger="a computed effect and a measured one stay a group although their gains differ",
        smaller="the measured effect is rejected because of the noise of its columns",
    )  # fmt: skip

    # Rounding of coarse readings
    rounding_size: float = threshold(
        1.25, "ratio to the amplitude of rounding above which an error has another cause; the noise is known to a few percent",
        larger="a small effect in the shape of rounding is hidden", smaller="rounding is reported as an effect",
        chosen_by="chosen by judgement; pytest tests/diagnosis/test_rounding.py has a session on both sides",
    )  # fmt: skip
    rounding_errors: float = threshold(
        3.0, "standard errors by which an amplitude must exceed what rounding can do",
        larger="a small effect in the shape of rounding is hidden", smaller="noise on the amplitudes brings rounding back",
        chosen_by="chosen by judgement; pytest tests/diagnosis/test_rounding.py has a session on both sides",
    )  # fmt: skip

    # Keep
    most_terms: int = threshold(
        8, "largest number of terms of a formula",
        larger="formulas become unreadable", smaller="a curve with several bends is not described completely",
    )  # fmt: skip
