"""Scale and bias of all three axes from rests and movements, with flags and the error budget."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal import plausibility
from gyrocal.calibration.calibrate import POOLED, Estimate
from gyrocal.calibration.flags import ordered
from gyrocal.calibration.trust import stands_still, warning_flags
from gyrocal.effects.base import Role
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.gravity.budget import budget
from gyrocal.gravity.fit import CROSS, GravityFit, fit, full
from gyrocal.gravity.scales import beyond_errors, unseen
from gyrocal.gravity.scene import Scene
from gyrocal.policy import POLICY
from gyrocal.recording.long_steps import misses_samples
from gyrocal.recording.session import AXES, Session
from gyrocal.warning import Warning


@dataclass(frozen=True)
class Calibration:
    """Estimates by scenario and axis, the fits that they come from, warnings, and the budget of their errors."""

    estimates: list[Estimate]
    fits: dict[str, GravityFit] = field(repr=False)
    warnings: list[Warning]

    def about(self, axis: str | None) -> Calibration:
        """The same with the estimates of one axis alone, or as it is without an axis."""
        return self if axis is None else replace(self, estimates=[e for e in self.estimates if e.axis == axis])

    def to_json(self) -> dict[str, Any]:
        last = next(iter(self.fits.values()))
        return {
            "estimates": [e.to_json() for e in self.estimates],
            "warnings": [w.to_json() for w in self.warnings],
            "misalignment": [row for name, f in self.fits.items() for row in misalignment(f, name)],
            "accelerometer": last.scene.accelerometer_json(),
            "rests": len(last.scene.rests), "movements": len(last.scene.movements),
            "budget": [row.to_json() for row in budget(last)],
        }  # fmt: skip


def calibrate(
    session: Session, seconds: Sequence[float | None] | None = None, methods: Iterable[str] | None = None,
    model: Model | str | Path | None = None,
) -> Calibration:  # fmt: skip
    """Scale and bias of each scenario, or of all together (scenario ``all``) if none has enough rests by itself.

    Of several ``seconds``, those that hold too few rests are told as ``no_answer``. Raises InputError for methods other than
    ``model``, and if all of them hold too few.
    """
    other = [m for m in (methods or ()) if m != "model"]
    if other:
        raise InputError(
            f"--method {other[0]}: it needs a turntable's known rate, and the reference here is gravity; use --method model"
        )
    opened = full(Model.open(model))
    warnings = plausibility.check(session, opened)
    spans: Sequence[float | None] = seconds or (None,)
    estimates: list[Estimate] = []
    fits: dict[str, GravityFit] = {}
    refused: InputError | None = None
    for span in spans:
        if span is not None and not 0 < span < np.inf:
            raise InputError(f"--seconds {span}: must be positive and finite")
        cut = [r if span is None else (r.first(span) or r) for r in session.runs]
        try:
            found = _by_scenario(session.with_runs(cut), opened)
        except InputError as error:
            refused = error
            of = "whole runs" if span is None else f"the first {span:g} s"
            warnings.append(Warning("no_answer", None, None, f"nothing from {of}: {error}"))
            continue
        fits.update(found)
        for name, fitted in found.items():
            warnings += [w for w in fitted.scene.warnings if w not in warnings]
            estimates += [_estimate(fitted, name, axis, warnings) for axis in AXES]
    if refused is not None and not fits:
        raise refused
    last = next(iter(fits.values()))
    return Calibration(estimates, fits, [*warnings, *unseen(last, POLICY.unseen)])


def _by_scenario(session: Session, model: Model) -> dict[str, GravityFit]:
    found = {}
    refused: InputError | None = None
    for name, runs in session.by_scenario():
        try:
            found[name] = fit(Scene.of(session.with_runs(runs)), model)
        except InputError as error:
            refused = error
    if found:
        return found
    if len(session.scenarios) == 1 and refused is not None:
        raise refused
    return {POOLED: fit(Scene.of(session), model)}


def _estimate(fitted: GravityFit, scenario: str, axis: str, warnings: Sequence[Warning]) -> Estimate:
    terms = {t.effect.role: t for t in fitted.model.on(axis) if t.effect.role is not None}
    scale, scale_se = (next(iter(d.values())) for d in (terms[Role.SCALE].values, terms[Role.SCALE].se))
    bias_dps, bias_se_dps = (next(iter(d.values())) for d in (terms[Role.BIAS].values, terms[Role.BIAS].se))
    seconds = sum(r.duration_s for r in fitted.scene.session.runs)
    flags = _flags(fitted, axis) | warning_flags(warnings, axis, fitted.scene.session.runs)
    if scale_se > POLICY.unseen:
        return Estimate(scenario, "model", seconds, axis, None, None, bias_dps, bias_se_dps, fitted.misfit, ordered(flags))
    excess = max(1.0, fitted.misfit)  # movements that fit worse than the noise allows determine the scale less well
    if beyond_errors(scale, scale_se * excess) or abs(bias_dps) > POLICY.largest_bias_dps:
        flags |= {"direction"} if 1 + scale < -POLICY.opposite else {"implausible"}
    return Estimate(
        scenario, "model", seconds, axis, scale, scale_se * excess, bias_dps, bias_se_dps, fitted.misfit, ordered(flags)
    )


def _flags(fitted: GravityFit, axis: str) -> set[str]:
    """The flags ``misfit``, ``missed`` and ``constant_reading`` of a fit, which contains no clipped movements."""
    flags = set()
    _, freedom = fitted.chi2(np.arange(fitted.observations.movement_rows))
    if not fitted.misfit <= 1 + POLICY.movement_misfit_errors / np.sqrt(2 * freedom):
        flags.add("misfit")
    for m in fitted.scene.movements:
        run = fitted.scene.session.runs[m.run]
        if misses_samples(run, m.start, m.stop):
            flags.add("missed")
        if stands_still(run.gyro_dps[m.start : m.stop, AXES.index(axis)], run.t_us[m.start : m.stop]):
            flags.add("constant_reading")
    return flags


def misalignment(fitted: GravityFit, scenario: str) -> list[dict[str, Any]]:
    """The off-diagonal elements: ``axis`` shows the fraction ``value`` of the rate about ``about``; None if not determined."""
    out = []
    for axis in AXES:
        term = fitted.model.term(CROSS, axis)
        for name in () if term is None else term.effect.coding.used(term.values):
            assert term is not None
            seen = term.se[name] <= POLICY.unseen
            out.append({
                "scenario": scenario, "axis": axis, "about": name.removeprefix("m_"),
                "value": term.values[name] if seen else None, "se": term.se[name] * max(1.0, fitted.misfit) if seen else None,
            })  # fmt: skip
    return out
