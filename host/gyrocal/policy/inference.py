"""Which structure of the noise and of an effect a fit takes."""

from __future__ import annotations

from dataclasses import dataclass

from gyrocal.policy.threshold import threshold


@dataclass(frozen=True)
class Inference:
    """Thresholds of the fit: power cycles, and the gain in log-likelihood that a richer structure must reach."""

    least_scenarios: int = threshold(
        3, "smallest number of power cycles from which on their spread is stated",
        larger="the spread of few power cycles is left out of the model",
        smaller="a spread is stated that two values determine, with one degree of freedom",
    )  # fmt: skip
    walking_runs: int = threshold(
        5, "runs of a power cycle from which on an effect must remain beside a bias that walks on from run to run",
        larger="in a log that is cut into a few runs, what moves slowly explains the walk of the bias",
        smaller="effects that differ between a few runs alone are not found",
        chosen_by="gyrocal benchmark edge --part frozen, sessions of five runs: the same answers as with 6",
    )  # fmt: skip
    same_in_cycles: float = threshold(
        0.2, "prior probability that scale or bias does not differ between power cycles, in the standard errors of few cycles",
        larger="errors are too small if the cycles differ by about what one of them shows",
        smaller="errors are too large if the cycles do not differ",
        chosen_by="pytest tests/inference/test_few_cycles_error.py",
    )  # fmt: skip
    largest_bias_spread_dps: float = threshold(
        5.0, "largest standard deviation of the bias over power cycles, dps",
        larger="a wrong face or rate counts as a spread of power cycles", smaller="poor sensors are called implausible",
        chosen_by="a hundred times the repeatability in datasheets; pytest tests/plausibility/test_plausible.py",
    )  # fmt: skip
    largest_scale_spread: float = threshold(
        0.05, "largest standard deviation of the scale over power cycles",
        larger="a wrong rate counts as a spread of power cycles", smaller="poor sensors are called implausible",
        chosen_by="a hundred times the repeatability in datasheets; pytest tests/plausibility/test_plausible.py",
    )  # fmt: skip
    structure_chance: float = threshold(
        0.01, "probability that noise gains as much as a richer variant of an effect, above which the simpler one is taken",
        larger="a second order or time constant is fitted to noise", smaller="weak parts of an effect are not fitted",
    )  # fmt: skip
    shape_gain: float = threshold(
        3.0, "log-likelihood that another shape of a delay must gain over the simplest",
        larger="a low-pass is described as a delay", smaller="the shape of the delay is chosen by noise",
        chosen_by="odds of 20 to 1 (3 = ln 20); chosen by judgement",
    )  # fmt: skip
    run_spread_gain: float = threshold(
        5.0, "log-likelihood that a spread of a nonlinear parameter over the runs must gain",
        larger="a time constant that differs from run to run is described by one value",
        smaller="runs have values of their own by noise",
    )  # fmt: skip
    determined_gain: float = threshold(
        6.0, "log-likelihood that a term must gain for its nonlinear parameters to be determined",
        larger="parameters that the session determines are given no standard error",
        smaller="a standard error is stated for a parameter that was fitted to noise",
        chosen_by="noise gains as much with a probability of a few thousandths if the parameter is searched over a factor of "
        "100; chosen by judgement",
    )  # fmt: skip
    noise_shape_gain: float = threshold(
        2.0, "log-likelihood that a changing level or a colour of the noise must gain",
        larger="bursts and filtered noise are described as white noise", smaller="white noise is given a shape by chance",
    )  # fmt: skip
    noise_level_loss: float = threshold(
        6.0, "log-likelihood that the level of the noise which samples show may cost the means of turns about other axes",
        larger="vibration that averages out over a turn counts in its mean",
        smaller="noise that grows with the rate is taken for that of rests: the true level cost up to 3.2 in 17 sessions",
        chosen_by="chosen by judgement: twice that cost; 20 turns that vibrate to twice the noise cost 20 (ln 2 - 3/8) = 6.4",
    )  # fmt: skip
    contradiction_chance: float = threshold(
        0.01, "probability under noise, over all coefficients of an axis with a misfit, that the parts of the data contradict "
        "each other, below which the contradiction counts in the standard errors",
        larger="noise widens the errors beside a misfit that does not concern them",
        smaller="errors hold noise alone though the value depends on which data there are",
        chosen_by="pytest tests/inference/test_contradictions.py",
    )  # fmt: skip
    faint_color: float = threshold(
        0.2, "correlation of successive block means that may be flicker noise, whatever the samples within blocks show",
        larger="an error of the model that lasts some tenths of a second counts as noise",
        smaller="flicker noise is described as white and drift alone",
        chosen_by="python benchmarks/null_noise.py: flicker noise reaches 0.12, a low-pass at 5 Hz 0.33; stick-slip 0.39",
    )  # fmt: skip
    of_samples: float = threshold(
        4.0, "largest scatter within blocks, relative to that behind a low-pass which explains the correlation of block means, "
        "with which the correlation counts as the low-pass's",
        larger="an error of the model that lasts some tenths of a second counts as noise",
        smaller="a low-pass of another shape than the assumed one is not described",
        chosen_by="python benchmarks/null_noise.py: low-passes have 1.2 to 1.6; stick-slip of a table 17",
    )  # fmt: skip
    color_errors: float = threshold(
        3.0, "standard errors from which on a correlation of successive blocks counts as a colour of the noise",
        larger="filtered noise is described as white", smaller="white noise is described as coloured once in 370 axes",
        chosen_by="tail of the normal distribution; chosen by judgement",
    )  # fmt: skip
