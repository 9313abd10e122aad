"""Whether the movements by hand determine the scales that are fitted, and whether a sensor has such scales."""

from __future__ import annotations

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.gravity.budget import budget
from gyrocal.gravity.fit import GravityFit
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES
from gyrocal.warning import Warning


def unseen(fitted: GravityFit, largest_se: float) -> list[Warning]:
    """``no_answer``: a warning for each axis whose scale the movements leave unsure by more than ``largest_se``.

    A scale that no gyroscope has is unsure where ``calibrate`` would not state it.
    """
    out = []
    for axis in AXES:
        scale, se = _scale(fitted, axis)
        if se > largest_se or (se > POLICY.unseen and abs(scale) > POLICY.largest_scale):
            text = f"no scale for {axis}: the movements leave it unsure by {se:.0%}, {_reason(fitted, axis)}"
            out.append(Warning("no_answer", axis, None, text))
    return out


def _reason(fitted: GravityFit, axis: str) -> str:
    """Why the movements leave the scale of an axis unsure, and what to do: too few turn gravity about it, or what else."""
    if _turns(fitted, axis) < 2:
        return (
            f"because too few turn gravity about {axis}. Rotation about gravity cannot be seen. Hold {axis} level, and turn "
            "the sensor about it by 90 to 180 deg, several times both ways, with a rest of two seconds before and after"
        )
    row = next((row for row in budget(fitted) if row.axis == axis), None)
    cause = f"; most of that comes from the {row.cause}: {row.advice}" if row is not None else ""
    return f"although they turn gravity about {axis}{cause}"


def _turns(fitted: GravityFit, axis: str) -> int:
    """The number of movements that clearly turn gravity about an axis, by the readings."""
    scene, i = fitted.observations.scene, AXES.index(axis)
    count = 0
    for movement in scene.movements:
        run, rest = scene.session.runs[movement.run], scene.rests[movement.before]
        rate_dps = run.gyro_dps[movement.start : movement.stop, i] - rest.gyro_dps[i]
        turned_deg = abs(float(rate_dps[1:] @ np.diff(run.sample_s[movement.start : movement.stop])))
        level = float(np.sqrt(max(1 - scene.up[movement.before, i] ** 2, 0.0)))
        count += turned_deg * level > POLICY.clear_turn_deg
    return count


def implausible(fitted: GravityFit, stated: GravityFit | None = None) -> list[Warning]:
    """``scale_implausible``: fitted scales that no gyroscope has, beyond what their errors and the misfit explain.

    A scale that ``calibrate`` would not state, because the movements do not determine it, accuses nothing. ``stated`` is the
    fit with all misalignment, as ``calibrate`` states it: where that determines a scale, it is the one that is judged.
    """
    out = []
    for axis in AXES:
        scale, se = _scale(fitted, axis)
        accused = se <= POLICY.unseen and beyond_errors(scale, se * max(1.0, fitted.misfit))
        if accused and stated is not None and _scale(stated, axis)[1] <= POLICY.unseen:
            scale, se = _scale(stated, axis)
            accused = beyond_errors(scale, se * max(1.0, stated.misfit))
        if accused:
            text = (
                f"the movements give {axis} a scale error of {scale:+.0%}; gyroscopes have a few percent. Check the range, the "
                "size of one count (--lsb-dps when importing) and the samples a second, and that the sensor lay still between "
                "the movements"
            )
            out.append(Warning("scale_implausible", axis, None, text, True))
    return out


def beyond_errors(scale: float, se: float) -> bool:
    """True for a scale that no gyroscope has, beyond what its error explains, which the misfit has widened."""
    return abs(scale) > POLICY.largest_scale + POLICY.implausible_errors * se


def _scale(fitted: GravityFit, axis: str) -> tuple[float, float]:
    """The fitted error of the scale of an axis and its standard error; zeros if the model has none."""
    term = next((t for t in fitted.model.on(axis) if t.effect.role is Role.SCALE), None)
    return (0.0, 0.0) if term is None else (next(iter(term.values.values())), next(iter(term.se.values()), 0.0))
