"""When a session contradicts itself."""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.policy.threshold import threshold

SLOPES = "chosen by judgement; pytest tests/plausibility/test_plausible.py holds a session on both sides"
READINGS = "chosen by judgement; pytest tests/plausibility/test_readings.py holds a session on both sides"
COLUMNS = "chosen by judgement; pytest tests/plausibility/test_columns.py holds a session on both sides"
REFERENCES = "chosen by judgement; pytest tests/recording/test_references.py holds a session on both sides"
EXPLAINED = "chosen by judgement; pytest tests/plausibility/test_explanations.py holds a session on both sides"


@dataclass(frozen=True)
class Plausibility:
    """Thresholds of the warnings. The slope of a run is what its readings follow of the true rate, 1 for a perfect sensor."""

    # Slopes: unit, sign, face, rate, scale
    copied_readings: int = threshold(
        50, "readings that two runs must share, each on every axis, to be the same recording",
        larger="a copy of a short run is not seen", smaller="a few coarse readings agree by chance",
        chosen_by="chosen by judgement",
    )  # fmt: skip
    unit_within: float = threshold(
        0.1, "relative deviation of a slope from pi/180 or 180/pi up to which the unit is wrong",
        larger="a small slope of another cause is called rad/s", smaller="poor sensors in rad/s are not recognised",
        chosen_by=SLOPES,
    )  # fmt: skip
    sign_within: float = threshold(
        0.15, "deviation of a slope from 1 or -1 up to which the sensor follows the rate or its opposite",
        larger="a wrong rate is called a wrong sign", smaller="a wrong sign of a poor sensor is called a wrong scale",
        chosen_by=SLOPES,
    )  # fmt: skip
    follows_not: float = threshold(
        0.1, "absolute slope below which an axis does not follow the rate",
        larger="a sensor on a wrong range is called exchanged", smaller="misalignment hides that axes are exchanged",
        chosen_by=SLOPES,
    )  # fmt: skip
    follows: tuple[float, float] = threshold(
        (0.9, 1.1), "absolute slope between which another axis follows the rate in place of the table's",
        larger="a strong misalignment is called an exchange of axes", smaller="exchanged axes of poor sensors pass",
        chosen_by=SLOPES,
    )  # fmt: skip
    rate_off: float = threshold(
        0.02, "relative deviation of a run's slope from that of the other runs from which on its rate is wrong",
        larger="small errors of the stated rate spoil the fit", smaller="nonlinearity and temperature are called wrong rates",
        chosen_by=SLOPES,
    )  # fmt: skip
    rate_errors: float = threshold(
        10.0, "standard errors by which a run's slope must also deviate from that of the other runs",
        larger="wrong rates in noisy or short runs are not reported", smaller="noise and drift are called wrong rates",
        chosen_by=SLOPES,
    )  # fmt: skip
    largest_scale: float = threshold(
        0.15, "largest error of the scale that a working sensor has; the device's limit is equal",
        larger="a wrong rate or range passes", smaller="poor sensors are called implausible",
        chosen_by="judgement: 15 times the 1 % of the LSM6DSO; pytest tests/parity/test_constants.py",
    )  # fmt: skip
    largest_bias_dps: float = threshold(
        50.0, "largest bias that a working sensor has, dps; the device's limit is equal",
        larger="an offset of the counts that was not subtracted passes", smaller="poor sensors are called implausible",
        chosen_by="judgement: 50 times the 1 dps of the LSM6DSO; pytest tests/parity/test_constants.py",
    )  # fmt: skip
    turn_on_dps: float = threshold(
        0.05, "standard deviation of the bias over power cycles that is assumed where they are few, dps",
        larger="wrong rates are not reported in sessions of few power cycles",
        smaller="differences between power cycles are called wrong rates",
        chosen_by="the upper end of the values in datasheets; chosen by judgement",
    )  # fmt: skip
    few_runs: int = threshold(
        4, "number of runs or power cycles below which their own scatter is not used",
        larger="the assumed scatter is used for more sessions", smaller="a scatter is estimated from three values",
    )  # fmt: skip
    unknown_bias_dps: float = threshold(
        10.0, "standard error of a bias that no run determines, dps",
        larger="sessions at one rate are judged less", smaller="a large bias at one rate is called a wrong unit",
        chosen_by="the largest bias in datasheets of consumer parts; chosen by judgement",
    )  # fmt: skip
    turning_errors: float = threshold(
        5.0, "standard errors by which the slope of a turning run must differ from zero; also the tolerances of a common line",
        larger="readings in rad/s at low rates are not recognised", smaller="a table at rest is called a wrong unit",
        chosen_by=SLOPES,
    )  # fmt: skip
    slope_se: float = threshold(
        0.05, "largest relative standard error of a slope that is judged",
        larger="slow and noisy runs are judged by their noise", smaller="contradictions of slow runs are not reported",
    )  # fmt: skip
    told_noise: float = threshold(
        0.1, "noise of a measured angle, as a fraction of the turn over the means whose slope is judged against it",
        larger="a coarse encoder flattens the slope", smaller="fast motions beside a coarse encoder are not judged",
        chosen_by="the square of it is lost of the slope, 1 %; pytest tests/plausibility/test_coarse_angles.py",
    )  # fmt: skip
    slow_s: float = threshold(
        0.25, "length of the means whose slope is judged against a reference with three axes, s",
        larger="fast motions are not judged", smaller="the sensor's low-pass and the jitter of both clocks flatten the slope",
        chosen_by="chosen by judgement: a hand-held sensor followed motion capture with 0.82 at 8 Hz and 0.99 below 1 Hz",
    )  # fmt: skip
    leak: float = threshold(
        0.005, "changing part of the rates about other axes that an axis reads, beside which its slope is judged",
        larger="an axis about which the sensor turns a little is not judged",
        smaller="a mount that bends is called a wrong scale of an axis about which the sensor hardly turns",
        chosen_by=SLOPES,
    )  # fmt: skip
    hardly_turned: float = threshold(
        0.05, "error of an axis's scale by `leak` from which on it is told that the sensor hardly turns about this axis",
        larger="wrong scales of axes about which the sensor hardly turns are not explained",
        smaller="the motion of an ordinary recording is complained about", chosen_by=REFERENCES,
    )  # fmt: skip
    lost_part: float = threshold(
        0.5, "difference of reference and readings, as a part of the larger, from which on the reference is lost",
        larger="a tracker that follows late is not reported", smaller="a strong misfit is called a lost reference",
        chosen_by=REFERENCES,
    )  # fmt: skip
    lost_times: float = threshold(
        20.0, "that difference over its median in the run",
        larger="a reference that is often lost is not reported", smaller="fast motions are called a lost reference",
        chosen_by=REFERENCES,
    )  # fmt: skip
    lost_edge_times: float = threshold(
        5.0, "that difference over its median, down to which the samples before and after a lost stretch belong to it",
        larger="a tracker that finds the sensor again slowly spoils the fit",
        smaller="much of an ordinary recording is left out", chosen_by=REFERENCES,
    )  # fmt: skip
    inverted_part: float = threshold(
        0.1, "part of the readings' power that orientations must leave, and part of that which their inverses may leave, for "
        "them to be called inverted",
        larger="a reference that misses a part of the motion is called inverted",
        smaller="inverted orientations of a motion with large errors are not recognised",
        chosen_by="pytest tests/recording/test_references.py: inverted orientations leave 0.4, right ones a millionth",
    )  # fmt: skip
    inverted_image: float = threshold(
        0.5, "part of what a mirrored reference leaves of the readings' power that its inverse may leave to be the cause of it",
        larger="columns with a wrong sign are taken for inverted orientations", smaller="both causes are named more often",
        chosen_by="judgement; pytest tests/recording/test_references.py holds turns about one axis at a time",
    )  # fmt: skip
    unrelated_part: float = threshold(
        0.5, "part of the readings' power that a reference about three axes, or by its own clock, leaves at its best offset",
        larger="a reference of another recording is fitted all the same",
        smaller="a reference that misses a part of the motion is called one of another recording", chosen_by=REFERENCES,
    )  # fmt: skip
    unrelated_dps: float = threshold(
        5.0, "smallest rms of the readings for that, dps", larger="a wrong reference of a slow motion is not reported",
        smaller="a recording at rest is held against its reference", chosen_by=REFERENCES,
    )  # fmt: skip
    unrelated_axis: float = threshold(
        0.1, "part of the power of an axis' readings that a reference about three axes explains at least",
        larger="an axis of a noisy reference is blocked", smaller="a scale is fitted to a reference that misses the motion",
        chosen_by="judgement; pytest tests/recording/test_references.py holds an axis that has noise alone",
    )  # fmt: skip
    lost_dps: float = threshold(
        20.0, "smallest such difference, dps", larger="losses in slow motions are not reported",
        smaller="a dead band is called a lost reference", chosen_by=REFERENCES,
    )  # fmt: skip
    lost_samples: int = threshold(
        3, "samples of the shortest such stretch", larger="short losses are not reported",
        smaller="single wrong readings are called a lost reference", chosen_by=REFERENCES,
    )  # fmt: skip
    lost_beside_s: float = threshold(
        0.1, "time on either side of such a stretch that is left out with it, s", larger="short runs lose much of themselves",
        smaller="the smoothed reference beside a loss is fitted", chosen_by=REFERENCES,
    )  # fmt: skip
    noisy_times: float = threshold(
        3.0, "noise of orientations over its median in the run, from which on they are left out",
        larger="moments in which few markers are seen decide the fit", smaller="much of an ordinary recording is left out",
        chosen_by=REFERENCES,
    )  # fmt: skip
    lost_most: float = threshold(
        0.3, "part of a run above which it is not clear whether the reference or the sensor is wrong, and all is used",
        larger="a sensor that fails is fitted where it works", smaller="a tracker that often fails spoils the fit",
        chosen_by=REFERENCES,
    )  # fmt: skip
    near_end: float = threshold(
        0.98, "part of an axis's largest reading from which on a reading does not count here, because it may be clipped",
        larger="clipping is called a lost reference", smaller="losses in fast motions are not reported",
        chosen_by=REFERENCES,
    )  # fmt: skip
    agree_dps: float = threshold(
        0.3, "deviation from a line up to which runs agree on it, dps, besides `agree` of their rate",
        larger="wrong runs pull the line", smaller="power cycles with different offsets do not agree",
        chosen_by=SLOPES,
    )  # fmt: skip
    agree: float = threshold(
        0.02, "deviation from a line, as a fraction of the rate, up to which runs agree on it",
        larger="wrong rates pull the line", smaller="nonlinearity keeps runs from agreeing", chosen_by=SLOPES,
    )  # fmt: skip
    two_rates: float = threshold(
        0.1, "difference of two rates, as a fraction of the largest, from which on they determine a slope and an offset",
        larger="more sessions count as recorded at one rate", smaller="a slope is the ratio of two small differences",
    )  # fmt: skip
    cycles_explain: float = threshold(
        4.0, "ratio of the runs' deviations from the common line to the spread of the power cycles' slopes, from which on "
        "offsets of power cycles explain the deviations",
        larger="different offsets of power cycles are called wrong rates", smaller="a wrong rate is called an offset",
        chosen_by=EXPLAINED,
    )  # fmt: skip
    gravity_along: float = threshold(
        0.7, "fraction of gravity along an axis from which on the accelerometer says whether the axis points up or down",
        larger="inclined sensors are not judged", smaller="a level axis is judged by its tilt",
        chosen_by="cosine of 45 degrees; pytest tests/plausibility/test_explanations.py",
    )  # fmt: skip
    granted_offset_dps: float = threshold(
        2.0, "standard deviation of the offset that is granted before the scale of power cycles of one run each scatters, dps",
        larger="wrong rates pass as offsets", smaller="offsets of power cycles are called scatter of the scale",
    )  # fmt: skip

    hidden_dps: float = threshold(
        1.0, "error of a run's mean that is granted before the scale of power cycles of several runs scatters, dps: what a "
        "dead band or another error of small rates leaves there",
        larger="scales of slow runs scatter unnoticed", smaller="the error of small rates is called scatter of the scale",
        chosen_by="drivers set rates below 0.1 to 1 dps to zero; pytest tests/plausibility/test_explanations.py",
    )  # fmt: skip

    # Motion and rest
    rate_varies_dps: float = threshold(
        1.0, "standard deviation of the true rate from which on a run has a slope of its own, dps",
        larger="slow swings are judged by their mean", smaller="the noise of an encoder is taken for motion",
        chosen_by="the noise of encoders is far smaller; pytest tests/plausibility/test_plausible.py",
    )  # fmt: skip
    one_rate: float = threshold(
        0.01, "standard deviation of a measured rate, as a fraction of its mean, below which a run has one rate for its scale",
        larger="a slow wobble, which a scale multiplies by no more than 1 %, is left in the residual",
        smaller="an eccentric encoder's error, which the sensor does not follow, decides on the scale and not the mean rates",
        chosen_by="an eccentricity of half a degree is 0.9 % of the rate; pytest tests/recording/test_one_rate.py",
    )  # fmt: skip
    rest_dps: float = threshold(
        0.01, "mean rate below which a run is at rest, dps",
        larger="very slow turns count as rests", smaller="rounding of the reference counts as a turn",
    )  # fmt: skip
    follows_correlation: float = threshold(
        0.9, "correlation of readings with a reference of small variation from which on the readings follow it",
        larger="a swing in rad/s counts as a constant rate", smaller="noise common to both counts as motion",
        chosen_by=SLOPES,
    )  # fmt: skip
    longest_lag_s: float = threshold(
        0.1, "longest delay between readings and reference that is no contradiction, s",
        larger="checks of slopes take longer", smaller="slopes of delayed readings are too small",
    )  # fmt: skip
    rest_off_dps: float = threshold(
        1.0, "smallest deviation of a rest's mean from the other rests of its power cycle that is reported, dps",
        larger="slow motion in a run at rest is not reported", smaller="warm-up and drift are called motion", chosen_by=SLOPES,
    )  # fmt: skip
    rest_off_cycles_dps: float = threshold(
        4.75, "smallest deviation of a rest's mean from the rests of other power cycles that is reported, dps",
        larger="a rest that is 5 dps off passes by its noise", smaller="the turn-on bias of a poor sensor is called motion",
    )  # fmt: skip
    rest_alone_dps: float = threshold(
        25.0, "mean of a rest, less the bias of turning runs where there are some, from which on the part turns steadily, dps",
        larger="a robot that spins steadily is taken for a biased part at rest", smaller="poor parts are called turning",
        chosen_by="half of largest_bias_dps; pytest tests/plausibility/test_steady_turns.py",
    )  # fmt: skip
    rest_part_dps: float = threshold(
        10.0, "difference of two steady readings, each in a tenth of a rest at least, with a step between them, that is "
        "reported, dps",
        larger="a part that turns steadily for a while is taken for one at rest", smaller="a jump of the bias is called motion",
        chosen_by="pytest tests/plausibility/test_steady_turns.py",
    )  # fmt: skip
    rest_spreads: float = threshold(
        6.0, "standard deviations of the other rests by which a rest must also deviate",
        larger="motion is not reported if power cycles scatter", smaller="one is reported if all rests scatter",
    )  # fmt: skip
    rest_block_s: float = threshold(
        0.1, "length of the means whose scatter shows whether the part moves in the seconds whose mean becomes its bias, s",
        larger="fast shaking is taken for rest", smaller="noise is taken for motion",
        chosen_by="pytest tests/calibration/test_at_rest.py",
    )  # fmt: skip
    rest_around_s: float = threshold(
        5.0, "time whose median is the reading around a tenth of a second of a rest, s",
        larger="a bias that wanders is taken for motion", smaller="a movement that lasts is taken for the reading around it",
        chosen_by="pytest tests/plausibility/test_steady_turns.py",
    )  # fmt: skip
    rest_moved_part: float = threshold(
        0.05, "part of a rest in which the readings must be off by rest_part_dps to be a movement, or by rest_off_dps in "
        "one that is still most of the time",
        larger="a push in a short rest passes", smaller="a knock in a long one is called motion",
        chosen_by="pytest tests/plausibility",
    )  # fmt: skip
    rest_reference_dps: float = threshold(
        0.1, "mean of a measured true rate up to which those seconds are at rest, dps",
        larger="a slow turn goes into the bias", smaller="the offset of a reference is taken for motion",
    )  # fmt: skip
    rest_reference_errors: float = threshold(
        3.0, "standard errors of that mean by the reference's noise up to which they are at rest too",
        larger="a slow turn under a noisy reference goes into the bias",
        smaller="the noise of a reference is taken for motion in the shortest rests",
        chosen_by="tail of the normal distribution; pytest tests/calibration/test_at_rest.py",
    )  # fmt: skip
    rest_bias_off_dps: float = threshold(
        2.0, "deviation of the mean of seconds of unknown true rate from the model's bias up to which they are at rest, dps",
        larger="a slow turn is taken for the bias",
        smaller="a bias that moved since the model was fitted, as with temperature, is refused",
        chosen_by="chosen by judgement: what a consumer part's bias moves over its temperature range; "
        "pytest tests/calibration/test_at_rest.py",
    )  # fmt: skip
    rest_bias_spreads: float = threshold(
        10.0, "spreads of the model's turn-on bias by which that mean may deviate at any rate",
        larger="turns are taken for the bias of a part that scatters", smaller="such a part's rests are refused",
    )  # fmt: skip
    rest_turned_deg: float = threshold(
        5.0, "angle by which gravity may turn in a run at rest, deg",
        larger="a sensor that is moved slowly passes", smaller="drift of the accelerometer is called motion",
        chosen_by=EXPLAINED,
    )  # fmt: skip
    vibration_errors: float = threshold(
        6.0, "standard errors of a mean acceleration that are subtracted from the angle by which gravity turns",
        larger="motion of a vibrating part is not reported", smaller="vibration is called motion",
        chosen_by=EXPLAINED,
    )  # fmt: skip

    # Readings that do not change
    noise_shows_counts: float = threshold(
        0.5, "noise of one sample from which on a constant reading contradicts it, counts",
        larger="dead readings of quiet sensors are not reported", smaller="a quiet sensor of coarse counts is called dead",
        chosen_by=READINGS,
    )  # fmt: skip
    standing_s: float = threshold(
        0.5, "shortest time without a change of the reading that is reported, s",
        larger="short failures of the bus are not reported", smaller="a slow output rate is called a failure",
        chosen_by=READINGS,
    )  # fmt: skip
    least_standing: int = threshold(
        5, "smallest number of equal readings that is reported",
        larger="failures at low sample rates are not reported", smaller="chance makes a few readings equal",
    )  # fmt: skip
    noise_share: float = threshold(
        0.7, "fraction of the estimated noise that is certain: drift across the edge of a count looks like noise",
        larger="drift of a quiet sensor is called a failure", smaller="failures of quiet sensors are not reported",
    )  # fmt: skip
    standing_chance: float = threshold(
        1e-6, "probability that noise leaves so many readings equal, below which the stretch is reported",
        larger="quiet sensors are called failed by chance", smaller="short failures of quiet sensors are not reported",
        chosen_by=READINGS,
    )  # fmt: skip
    follows_at_all: float = threshold(
        0.1, "absolute slope outside a constant stretch above which the reading follows the rate",
        larger="failures of badly scaled sensors are not reported", smaller="an axis across the table's is judged by the rate",
    )  # fmt: skip
    moves_counts: float = threshold(
        6.0, "counts, and standard deviations of the noise, by which the true rate must change for the reading to change",
        larger="failures in slow swings are not reported", smaller="a coarse count in a slow swing is called a failure",
        chosen_by=READINGS,
    )  # fmt: skip
    reference_spreads: float = threshold(
        3.0, "standard deviations of the reference's second differences that its noise alone covers in half a second",
        larger="failures with a noisy reference are not reported", smaller="the noise of a reference is taken for motion",
        chosen_by=READINGS,
    )  # fmt: skip
    quiet_density_dps: float = threshold(
        0.004, "noise density that a constant axis is assumed to have if no other axis shows noise, dps/sqrt(Hz)",
        larger="a quiet sensor of coarse counts is called dead", smaller="dead axes of fine counts are not reported",
        chosen_by="the lower part of the 0.003 to 0.015 of datasheets; chosen by judgement",
    )  # fmt: skip

    # Pauses between recordings
    pause_s: float = threshold(
        1.0, "shortest step of time that may be a pause between two recordings, s",
        larger="pauses of short recordings are called lost samples", smaller="losses of a radio link are called pauses",
        chosen_by=COLUMNS,
    )  # fmt: skip
    pause_losses: float = threshold(
        0.1, "part of the missing samples that may be missing within the recordings between pauses",
        larger="many losses are called pauses", smaller="pauses between recordings are called lost samples",
        chosen_by=COLUMNS,
    )  # fmt: skip
    pause_waits: float = threshold(
        8.0, "usual waits between bursts of samples that a gap between two is longer than",
        larger="gaps between bursts are not told", smaller="a host that stalled is called lost samples", chosen_by=COLUMNS,
    )  # fmt: skip
    pause_samples: int = threshold(
        32, "fewest samples between two pauses", larger="short recordings are called the rest of lost samples",
        smaller="the few samples between two losses are called a recording", chosen_by=COLUMNS,
    )  # fmt: skip

    # Readings at the end of the range
    least_range_dps: float = threshold(
        15.0, "smallest reading that may be the end of an unstated range, dps",
        larger="clipping of very small ranges is not reported", smaller="the largest reading of a slow swing is called clipped",
        chosen_by=READINGS,
    )  # fmt: skip
    rates_differ: float = threshold(
        0.03, "relative spread of the true rates of equal readings from which on the readings are clipped",
        larger="slight clipping is not reported", smaller="errors of the stated rates count as clipping", chosen_by=READINGS,
    )  # fmt: skip
    least_heap: int = threshold(
        5, "smallest number of readings at the limit whose true rates are compared",
        larger="rare clipping is not reported", smaller="the quantiles of a few values decide",
    )  # fmt: skip
    near_counts: float = threshold(
        50.0, "counts below the largest reading that hold fewer readings than it, if a hand came to the end of the range",
        larger="rare clipping by hand is not reported", smaller="a hand that turned back at the largest rate is called clipped",
        chosen_by="chosen by judgement: a parabola spends a seventh of the time of its last 50 counts in the last one",
    )  # fmt: skip
    far_below: float = threshold(
        0.5, "fraction of the limit that the true rates of clipped readings exceed",
        larger="clipping of badly scaled sensors is not reported", smaller="a reading that hangs is called clipped",
    )  # fmt: skip
    clipped_part: float = threshold(
        0.01, "fraction of clipped readings above which the mean of a run is not used",
        larger="clipping is called a wrong rate", smaller="runs with a few clipped readings are not checked",
        chosen_by=READINGS,
    )  # fmt: skip

    # Noise against the unit
    usual_density_dps: float = threshold(
        0.005, "usual noise density of consumer MEMS gyroscopes, dps/sqrt(Hz)",
        larger="quiet sensors at rest are called rad/s", smaller="noisy sensors at rest are called converted twice",
        chosen_by="0.003 to 0.015 in datasheets; chosen by judgement",
    )  # fmt: skip
    least_band_hz: float = threshold(
        50.0, "smallest bandwidth of a sensor that is assumed, Hz; a lower sample rate does not reduce the bandwidth",
        larger="slowly recorded quiet sensors are called rad/s", smaller="slowly recorded sensors in rad/s are not recognised",
    )  # fmt: skip
    density_factor: float = threshold(
        3.5, "factor by which the noise of sensors may differ from the usual in both directions",
        larger="very good and very poor sensors are called a wrong unit", smaller="a wrong unit is not recognised",
        chosen_by="below the square root of 57.3, so that both units exclude each other; chosen by judgement below it",
    )  # fmt: skip
    finest_step_dps: float = threshold(
        0.0035, "step of the readings from which on they are in deg/s, dps",
        larger="coarse sensors in rad/s are asked about their unit", smaller="readings in deg/s are asked about their unit",
        chosen_by="one count of the finest usual range (125 dps, 16 bit) is 0.0038 dps; chosen by judgement below it",
    )  # fmt: skip

    # Other columns
    sample_rate_off: float = threshold(
        0.05, "relative deviation of the times' sample rate from the stated one that is reported",
        larger="wrong sample rates pass", smaller="the tolerance of a part's clock is reported",
        chosen_by=COLUMNS,
    )  # fmt: skip
    milliseconds: tuple[float, float] = threshold(
        (300.0, 3000.0), "ratio of the sample rates between which the times are in another unit by a factor of 1000",
        larger="other errors of the rate are called milliseconds", smaller="milliseconds are not recognised at a wrong rate",
        chosen_by=COLUMNS,
    )  # fmt: skip
    slowest_hz: float = threshold(
        0.95, "slowest sample rate that a recording has, Hz: that of a log of once a second, off by sample_rate_off at most",
        larger="slow logs are called milliseconds", smaller="milliseconds are not recognised if the stated rate agrees",
        chosen_by=COLUMNS,
    )  # fmt: skip
    fastest_hz: float = threshold(
        20_000.0, "fastest sample rate that a recording has, Hz",
        larger="seconds that were taken for ms pass if the stated rate agrees", smaller="fast laboratory logs are reported",
        chosen_by=COLUMNS,
    )  # fmt: skip
    gravity_off: float = threshold(
        0.1, "deviation of the acceleration at rest from 1 g that is reported, g",
        larger="a wrong range passes", smaller="the bias of an accelerometer is reported", chosen_by=COLUMNS,
    )  # fmt: skip
    motion_g: float = threshold(
        5.0, "median size of the acceleration in a rest that moved, from which on its unit or scale is wrong, g",
        larger="a scale that is a few times wrong passes beside a motion", smaller="a shaker is called a wrong unit",
        chosen_by="a foot's median is below 1.5 g, a shaken hand's below 3; chosen by judgement",
    )  # fmt: skip
    temperatures_c: tuple[float, float] = threshold(
        (-60.0, 150.0), "temperatures of a working part, °C",
        larger="degrees Fahrenheit and kelvin pass", smaller="hot parts are reported",
        chosen_by="the usual -40 to 125 °C with a margin; pytest tests/plausibility/test_columns.py",
    )  # fmt: skip
    told_attenuation: float = threshold(
        1e-3, "attenuation by the unknown noise of a measured column, as a fraction, from which on its bound is told",
        larger="an attenuated scale is not told", smaller="a bound without meaning is told of fast motions",
        chosen_by="half of what smoothing may change; chosen by judgement",
    )  # fmt: skip
