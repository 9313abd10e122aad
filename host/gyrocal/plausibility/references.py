"""Checks of measured columns: a reference that jumps, an inverted or mirrored one, an open offset, an axis that hardly turns,
and unknown noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import polars as pl

from gyrocal.digits import percentage
from gyrocal.errors import InputError
from gyrocal.plausibility.runs import CLUSTERS, beside_others, clustered_se
from gyrocal.policy import POLICY
from gyrocal.recording.measured_rates import QUATERNION, RATES
from gyrocal.recording.register import registered
from gyrocal.recording.registration import Lost, Registration, RegistrationFit
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.recording.smoothing import Smoothed
from gyrocal.recording.stretches import stretches
from gyrocal.warning import Warning

INVERTED = (
    "the reference shows the motion of the readings only if its orientations are inverted. If its columns are in the order x, "
    "y, z, w, map ref_qw to the last of them; if they turn the fixed frame to the body, negate three of them "
    "(--map ref_qx=qx*-1, and likewise ref_qy and ref_qz)"
)
TOLD = 5
"""Times of stretches that a warning lists."""


def check(session: Session) -> list[Warning]:
    """``reference_jumps``, ``reference_unrelated``, ``sign_flipped`` for a mirrored reference, ``offset_ambiguous``,
    ``hardly_turned`` and ``noise_unknown``, also of times that scatter.
    """
    out = [*_noise_unknown(session)]
    for run in session.runs:
        jumps = 0 if run.measured_rates is None else run.measured_rates.jumps
        if jumps:
            text = (
                f"the reference jumps {jumps} times, by more than its motion before and after. The samples beside the jumps "
                "are left out. Check markers and tracking, or leave the cells of the bad samples empty"
            )
            out.append(Warning("reference_jumps", None, run.file, text))
        out += _noisy(run)
    found = registered(session)
    fit = found.registration_fit
    if fit is None:
        return out
    if _is_inverted(session, fit):
        return [*out, Warning("reference_unrelated", None, None, INVERTED, True)]
    if fit.left > POLICY.unrelated_part and fit.readings_dps > POLICY.unrelated_dps:
        text = (
            f"the reference does not show the motion of the readings: at its best offset, turned to fit best, it explains "
            f"{percentage(1 - fit.left)} of their power. Check that both belong to one recording and to one body, and that "
            "their times differ by less than 2 s"
        )
        return [*out, Warning("reference_unrelated", None, None, text, True)]
    out += map(_lost, fit.lost)
    out += _hardly_turned(found)
    out += [_mirrored(session, fit)] if fit.mirrored else _jitters(found)
    if fit.alternatives_s and fit.left <= POLICY.unrelated_part:
        offset_s = fit.registration.offset_s
        others = ", ".join(f"{s:+.3f}" for s in fit.alternatives_s)
        text = (
            f"the motion repeats itself, so that the offset of the reference's clock may be {offset_s:+.3f} s, or just as well "
            f"{others} s. Move irregularly for a few seconds to tell"
        )
        out.append(Warning("offset_ambiguous", None, None, text))
    return out


def _hardly_turned(session: Session) -> list[Warning]:
    """``hardly_turned``: axes with so little motion that small errors of the reference's axes change their scale."""
    runs = [run for run in session.runs if run.three_axes and run.reached.any()]
    if not runs:
        return []
    rates = [np.column_stack([run.about(axis).rate_dps for axis in AXES])[run.reached] for run in runs]
    centred = np.concatenate([r - r.mean(axis=0) for r in rates])
    out = []
    for i, axis in enumerate(AXES):
        beside = np.delete(centred, i, axis=1)
        alone, error = beside_others(centred[:, i], beside)
        if error < POLICY.hardly_turned or not beside.any():
            continue
        own_dps, others_dps = (float(np.sqrt(np.sum(part**2) / len(beside))) for part in (alone, beside))
        text = (
            f"the sensor hardly turns about {axis} ({own_dps:.2g} dps rms beside its turns about the other axes, of "
            f"{others_dps:.3g}). If the reference's axes bend against the sensor's by {np.rad2deg(POLICY.leak):.1g} deg "
            f"while it turns, the scale of {axis} is wrong by {min(error, 1.0):.0%}, which its standard error does not "
            f"contain. Turn the sensor about {axis} too, or do not use this scale"
        )
        out.append(Warning("hardly_turned", axis, None, text))
    return out


def _jitters(session: Session) -> list[Warning]:
    """``noise_unknown`` of readings that leave a reference of three axes the more, the faster the rate changes.

    So do times that scatter: the fit takes what they leave for noise. It is told where it is certain and the larger part.
    """
    out = []
    for run in session.runs:
        known, measured = run.reached, run.measured_rates
        if measured is None or not run.three_axes or known.sum() < CLUSTERS**2:
            continue
        rates = np.column_stack([run.about(axis).rate_dps for axis in AXES])[known]
        for i, axis in enumerate(AXES):
            slope, y = measured.slope_about(i, run.registration)[known], run.gyro_dps[known, i]
            columns = np.column_stack([np.ones(len(rates)), rates, slope])
            power = (y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]) ** 2
            fast = slope**2 - np.mean(slope**2)
            if not fast.any():
                continue
            jitter = float(fast @ power) / float(fast @ fast)
            se = clustered_se(fast, power - power.mean() - jitter * fast)
            if jitter > POLICY.turning_errors * se and 2 * jitter * np.mean(slope**2) > power.mean():
                calm = power[slope**2 <= np.median(slope**2)]
                out.append(Warning("noise_unknown", axis, run.file, _jitter_text(axis, power, calm, jitter)))
    return out


def _jitter_text(axis: str, power: Array, calm: Array, jitter: float) -> str:
    whole_dps, calm_dps = (float(np.sqrt(np.mean(part))) for part in (power, calm))
    return (
        f"the readings of {axis} differ from the reference by {whole_dps:.2g} dps rms, "
        f"{whole_dps / max(calm_dps, 1e-9):.1f} times as much as where the rate hardly changes, and the more, the faster it "
        f"changes, as if times scattered by {1e3 * jitter**0.5:.2g} ms. The noise "
        f"and the floor of {axis} contain this. Stamp readings and reference when they are "
        "measured, or sample both faster"
    )


def _noisy(run: Run) -> list[Warning]:
    """``reference_jumps`` for stretches in which a tracker is much noisier than usual."""
    noisy = None if run.measured_rates is None else run.measured_rates.noisy
    if noisy is None or not noisy.any():
        return []
    starts_s = run.t_s[stretches(noisy)[0]]
    text = (
        f"the orientations are more than {POLICY.noisy_times:g} times as noisy as usual in {_stretches(starts_s)}. These "
        f"samples, {percentage(float(noisy.mean()), 1)} of the run, are left out. Check markers and tracking"
    )
    return [Warning("reference_jumps", None, run.file, text)]


def _stretches(starts_s: Array) -> str:
    at_s = ", ".join(f"{t:.1f}" for t in starts_s[:TOLD]) + (" ..." if starts_s.size > TOLD else "")
    return f"{'one stretch' if starts_s.size == 1 else f'{starts_s.size} stretches'} (at {at_s} s)"


def _is_inverted(session: Session, fit: RegistrationFit) -> bool:
    """True if inverted orientations show the motion of the readings, and the reference as it is does not."""
    if fit.left <= POLICY.inverted_part:
        return False
    found = _of_inverse(session)
    return found is not None and found.left < POLICY.inverted_part * fit.left


def _mirrored(session: Session, fit: RegistrationFit) -> Warning:
    """``sign_flipped`` of a reference that is a mirror image, or ``reference_unrelated`` where it is inverted instead.

    Where the sensor turns about one axis at a time from one position, the inverse of its orientations is the mirror image.
    """
    text = (
        "the readings follow the reference only as a mirror image: an axis of the sensor or of the reference has the wrong "
        "sign, or two are exchanged. Negate or exchange columns when importing, so that both frames are right-handed"
    )
    inverse = _of_inverse(session)
    if inverse is None or inverse.mirrored or inverse.left > max(fit.left, POLICY.inverted_part):
        return Warning("sign_flipped", None, None, text, True)
    if inverse.left < POLICY.inverted_image * fit.left:
        return Warning("reference_unrelated", None, None, INVERTED, True)
    text += (
        ". Inverted orientations show the motion without a mirror: if they turn the fixed frame to the body, negate three of "
        "them instead (--map ref_qx=qx*-1, and likewise ref_qy and ref_qz)"
    )
    return Warning("sign_flipped", None, None, text, True)


def _of_inverse(session: Session) -> RegistrationFit | None:
    """The fit of the reference with inverted orientations; None if it has none."""
    if any(run.column(QUATERNION[0]) is None or run.column(RATES[0]) is not None for run in session.runs):
        return None
    runs = (
        replace(run, frame=run.table.with_columns(-pl.col(QUATERNION[1:])), registration=Registration(), lost=None)
        for run in session.runs
    )
    try:
        return registered(replace(session, runs=tuple(runs), registration_fit=None)).registration_fit
    except InputError:
        return None


def _lost(found: Lost) -> Warning:
    """``reference_jumps`` for stretches in which the reference and the readings show different motions."""
    kept = (
        f"These are {percentage(found.part)} of the run. That is too much to tell whether the reference or the readings "
        "are wrong, and "
        "nothing is left out. Check markers and tracking, the axes and the range of the sensor"
    )
    left = (
        f"The tracker has lost the sensor, or the sensor has failed. These samples, {percentage(found.part, 1)} of the run, "
        "are left out. Look at both there; check markers and tracking"
    )
    text = (
        f"the reference and the readings differ by up to {found.largest_dps:.3g} dps in {_stretches(found.starts_s)}, and "
        f"usually by {found.usual_dps:.2g} dps. {left if found.left_out else kept}"
    )
    return Warning("reference_jumps", None, found.file, text)


def _noise_unknown(session: Session) -> list[Warning]:
    """``noise_unknown``: a measured column whose noise hides in its motion, and how much that noise may attenuate at most."""
    columns: list[tuple[str, str, str, str, Callable[[Run], Smoothed | None]]] = [
        ("true rate", "dps", "the scale", "ref_noise_dps", lambda run: run.smooth_rate),
        ("temperature", "°C", "the temperature coefficients", "temp_noise_c", lambda run: run.smooth_temp),
    ]
    out = []
    for name, unit, of, key, column in columns:
        found = [(c.noise, float(np.var(c.values))) for c in map(column, session.runs) if c is not None]
        most = max((n.sd for n, _ in found if not (n.estimated or n.stated)), default=0.0)
        motion = float(np.mean([variance for _, variance in found])) if found else 0.0
        if motion <= 0 or most**2 < POLICY.told_attenuation * motion:
            continue
        text = (
            f"the {name} moves up to half of the sampling rate, so its noise cannot be told from its motion. The noise is at "
            f"most {most:.2g} {unit}, and may make {of} too small by up to {percentage(min(most**2 / motion, 1.0), 2)}, "
            f"which the standard errors contain. State {key} under [reference] in session.toml, or sample faster"
        )
        out.append(Warning("noise_unknown", None, None, text))
    return out
