"""What of a recording lies beyond the temperatures, rates and accelerations that a model was fitted on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gyrocal.calibration.calibrate import Estimate
from gyrocal.error_model.fitted_on import ACCELERATIONS, RATES, TEMPERATURE, VARIABLES, FittedOn, Range
from gyrocal.error_model.model import Model
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.units import CELSIUS
from gyrocal.warning import Warning

UNITS = {TEMPERATURE: CELSIUS, **dict.fromkeys(RATES, "dps"), **dict.fromkeys(ACCELERATIONS, "g")}


@dataclass(frozen=True)
class Beyond:
    """Samples beyond a model's ranges: their number by variable, of ``samples``, and the furthest value by quantity."""

    samples: int
    rows: Mapping[str, int]
    furthest: Mapping[str, float]


def limits(model: Model) -> dict[str, Range]:
    """The values of each quantity from which on a sample lies beyond what the model was fitted on.

    Those of the temperature are the ends of its range, because a correction clamps there. Rates and accelerations have noise,
    and a little more of them changes little, so their limits are wider.
    """
    out: dict[str, Range] = {}
    for name, (low, high) in model.fitted_on.ranges.items():
        wider = POLICY.beyond_part * (high - low)
        if name in RATES:
            white = model.noise_on(AXES[RATES.index(name)]).white_sd_dps or 0.0
            wider += max(POLICY.beyond_rate_dps, POLICY.outlier_spreads * white)
        elif name in ACCELERATIONS:
            wider += POLICY.beyond_acc_g
        else:
            wider = 0.0
        out[name] = (low - wider, high + wider)
    return out


def beyond(model: Model, recordings: Iterable[Mapping[str, Array]]) -> Beyond:
    """Count what lies beyond a model's ranges; a recording gives the values [n] of the quantities that it has."""
    known = limits(model)
    samples, rows, furthest = 0, dict.fromkeys(VARIABLES, 0), dict[str, float]()
    for columns in recordings:
        samples += max((values.size for values in columns.values()), default=0)
        for variable, names in VARIABLES.items():
            over = [_over(columns[name], known[name]) for name in names if name in columns and name in known]
            rows[variable] += int(np.count_nonzero(np.any([o > 0 for o in over], axis=0))) if over else 0
        for name in set(columns) & set(known):
            values = np.append(columns[name], furthest.get(name, np.nan))
            over_by = _over(values, known[name])
            if over_by.max() > 0:
                furthest[name] = float(values[over_by.argmax()])
    return Beyond(samples, {variable: count for variable, count in rows.items() if count}, furthest)


def _over(values: Array, ends: Range) -> Array:
    """By how much values [n] lie beyond a range; 0 or less within it and for missing ones."""
    return np.nan_to_num(np.maximum(ends[0] - values, values - ends[1]), nan=0.0)


def columns_of(run: Run, rate_dps: Array | None) -> dict[str, Array]:
    """The quantities of a run [n]; ``rate_dps`` are true rates [n, 3] about the three axes, NaN where not known."""
    names = (TEMPERATURE, *ACCELERATIONS)
    found = {name: values for name in names if (values := run.column(name)) is not None}
    return found if rate_dps is None else {**found, **{name: rate_dps[:, i] for i, name in enumerate(RATES)}}


def warned(model: Model, found: Beyond) -> list[Warning]:
    """``beyond_model``, if what lies beyond a model matters."""
    parts = []
    for name in (n for names in VARIABLES.values() for n in names if n in found.furthest):
        low, high = model.fitted_on.ranges[name]
        value, unit = found.furthest[name], UNITS[name]
        if name != TEMPERATURE or max(low - value, value - high) > POLICY.beyond_temp_c:
            parts.append(f"{name} reaches {value:.4g} {unit}, and the model was fitted on {low:.4g} to {high:.4g} {unit}")
    if not parts:
        return []
    rows = " and ".join(f"{count} ({variable})" for variable, count in found.rows.items())
    clamped = " A temperature beyond counts as the nearest end of its range." if TEMPERATURE in found.furthest else ""
    text = (
        f"{'; '.join(parts)}. That is so for {rows} of {found.samples} samples.{clamped} What the sensor does there is not "
        "known: record there, and fit the model again"
    )
    return [Warning("beyond_model", None, None, text)]


def beyond_of_calibration(
    session: Session, found: Sequence[Estimate], model: Model | str | Path | None
) -> list[Warning]:  # fmt: skip
    """``beyond_model`` of the seconds from which the model method has estimated scale and bias."""
    of_model = [e for e in found if e.method == "model"]
    opened = Model.open(model)
    if not of_model or opened.fitted_on == FittedOn():
        return []
    longest_s = max(e.seconds for e in of_model)
    runs = (run.first(longest_s) or run for run in session.runs)
    return warned(opened, beyond(opened, (columns_of(run, _known_rates(run)) for run in runs)))


def _known_rates(run: Run) -> Array | None:
    """The true rates [n, 3] of a run about its own axis, deg/s, NaN about the others; None if only their mean is known."""
    if run.rate_is_mean or run.reference.kind == "gravity":
        return None
    rate_dps = np.full((len(run), len(AXES)), np.nan)
    rate_dps[:, run.axis_index] = run.rate_dps
    return rate_dps
