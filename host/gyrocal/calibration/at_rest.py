"""This power cycle's bias from its own seconds at rest: what ``--bias rest:S`` of ``gyrocal apply`` asks for.

A bias cannot be told from a constant rate, so the seconds must be at rest by what is known of them. Where session.toml or a
reference says the true rate, that decides. Where nothing says it, readings that vary, or that are far from the model's bias,
are motion.
"""

from __future__ import annotations

import numpy as np

from gyrocal.effects.base import Role, with_role
from gyrocal.error_model.correction import left_at_rest_dps
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Run

INSTEAD = "use --bias model, or the output of `gyrocal calibrate --json`"


def biases_at_rest(model: Model, runs: tuple[Run, ...], seconds: float) -> dict[str, dict[str, float]]:
    """The bias in deg/s by scenario and axis, from the first ``seconds`` of the first run of each scenario that is at rest.

    Runs whose true rate is known go before those whose rate nothing says. Raises InputError if no run of a scenario is at rest
    in these seconds, or if their readings cannot be a bias.
    """
    return {scenario: _of_cycle(model, runs, scenario, seconds) for scenario in dict.fromkeys(r.scenario for r in runs)}


def _of_cycle(model: Model, runs: tuple[Run, ...], scenario: str, seconds: float) -> dict[str, float]:
    unsaid: list[Run] = []
    why: list[str] = []
    for run in (r for r in runs if r.scenario == scenario):
        first = run.first(seconds)
        if first is None:
            why.append(f"{run.file} is shorter than {seconds:g} s")
        elif not _is_known(first):
            unsaid.append(first)
        elif turning := _known_motion(first):
            why.append(f"{run.file}: {turning}")
        else:
            return _bias_dps(model, first, seconds, stated=True)
    if unsaid:
        return _bias_dps(model, unsaid[0], seconds, stated=False)
    more = "" if len(why) == 1 else f", and no other run of {scenario} is at rest"
    raise InputError(f"--bias rest:{seconds:g}: {why[0]}{more}; {INSTEAD}")


def _is_known(run: Run) -> bool:
    """True if the true rate is known at each moment: not for a turn known by its net angle, nor without a reference."""
    return run.table_rate_dps is not None or run.reference_dps is not None


def _known_motion(run: Run) -> str:
    """What says that a run moves; empty if its known true rate is zero within the reference's noise."""
    if run.reference_dps is None:
        rate_dps = run.table_rate_dps or 0.0
        return "" if abs(rate_dps) < POLICY.rest_dps else f"table_rate_dps is {rate_dps:g}"
    rates_dps = np.column_stack([run.about(axis).rate_dps for axis in AXES] if run.three_axes else [run.rate_dps])
    means_dps, varies_dps = np.abs(rates_dps.mean(axis=0)), float(_varies_dps(rates_dps, run.sample_rate_hz).max())
    noise_dps = np.sqrt(np.mean(np.diff(rates_dps, axis=0) ** 2, axis=0) / 2 / len(rates_dps))  # of the mean
    beyond = means_dps > np.maximum(POLICY.rest_reference_dps, POLICY.rest_reference_errors * noise_dps)
    if beyond.any():
        mean_dps = float(means_dps[beyond].max())
        return f"the reference turns by {mean_dps:.3g} dps in the mean"
    return f"the reference's rate varies by {varies_dps:.3g} dps (rms)" if varies_dps > 0 else ""


def _varies_dps(values: Array, rate_hz: float) -> Array:
    """Standard deviation of means over a tenth of a second of values [n, k]; 0 where noise explains it. Shape [k], deg/s."""
    size = max(1, min(round(POLICY.rest_block_s * rate_hz), len(values) // 2))
    blocks = values[: len(values) // size * size].reshape(-1, size, values.shape[1]).mean(axis=1)
    noise_dps = np.sqrt(np.mean(np.diff(values, axis=0) ** 2, axis=0) / 2 / size)
    varies_dps = blocks.std(axis=0)
    explained = np.maximum(POLICY.rest_off_dps, POLICY.rest_spreads * noise_dps)
    return np.asarray(np.where(varies_dps > explained, varies_dps, 0.0))


def _bias_dps(model: Model, run: Run, seconds: float, *, stated: bool) -> dict[str, float]:
    """The bias by axis, deg/s. Where no true rate is ``stated``, the model's bias says whether the part may be at rest."""
    left_dps = left_at_rest_dps(model, run)
    where = f"--bias rest:{seconds:g}: in the first {seconds:g} s of {run.file}"
    for axis, bias_dps, varies_dps in zip(AXES, left_dps.mean(axis=0), _varies_dps(left_dps, run.sample_rate_hz), strict=True):
        if varies_dps > 0:
            raise InputError(f"{where}, {axis} varies by {varies_dps:.3g} dps (rms), so the part moves; {INSTEAD}")
        known = model.term(with_role(Role.BIAS).id, axis)
        own_dps = 0.0 if known is None else known.values.get("bias_dps", 0.0)
        turn_on = model.noise_on(axis).turn_on_bias
        sd_dps = POLICY.turn_on_dps if turn_on is None or turn_on.sd_dps is None else turn_on.sd_dps
        near = known is None or abs(bias_dps - own_dps) <= max(POLICY.rest_bias_off_dps, POLICY.rest_bias_spreads * sd_dps)
        if abs(bias_dps) > POLICY.largest_bias_dps or not (stated or near):
            raise InputError(
                f"{where}, {axis} reads {bias_dps:.4g} dps and the model's bias is {own_dps:.4g} dps: the part turns, or "
                f"is another one; {INSTEAD}"
            )
    return dict(zip(AXES, map(float, left_dps.mean(axis=0)), strict=True))
