"""Faults of the reading: bits that do not toggle, and single readings that stand out."""

from __future__ import annotations

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.digits import percentage
from gyrocal.effects.byte_fault import lost_carry
from gyrocal.effects.dead_band import outliers_of
from gyrocal.effects.quantization import coarse_step_dps, is_whole
from gyrocal.effects.single_bits import count_dps_of, single_power
from gyrocal.inference.blocks import residual_dps
from gyrocal.inference.noise_search import LEAST_WHITE_DPS
from gyrocal.noise.sample import sample_sd_dps
from gyrocal.plausibility.readings import clip_level_dps
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.recording.tail import chance_of
from gyrocal.tails import ROBUST
from gyrocal.variables.reading import Reading

BITS = 16
"""Number of bits in the code of a reading."""
SHEPPARD = 1 / 12
"""Variance, counts^2, that rounding to whole counts adds."""


def reading_fault(session: Session, axis: str, alarm: float, known_step_dps: float = 0.0) -> Finding | None:
    """Find bits of the raw code that noise should toggle but that do not, as after a wrongly assembled byte or a stuck bit.

    ``alarm`` is the allowed probability of a false alarm. ``known_step_dps`` is the quantization step of the model in deg/s;
    bits below ``Policy.known_step`` of it are not tested. Neither are bits within steps that are no whole number of counts,
    as of a log with few decimals: these steps are the finding. Returns None without ``lsb_dps`` or without a finding.
    """
    if session.lsb_dps is None:
        return None
    i = AXES.index(axis)
    readings = [r.gyro_dps[:, i] for r in session.runs]
    step_dps = coarse_step_dps(session.runs, i)
    has_codes = is_whole(step_dps / session.lsb_dps)
    least_dps = max(POLICY.known_step * known_step_dps, 0.0 if has_codes else 2 * step_dps)
    worst = _stuck_bit(axis, readings, session.lsb_dps, alarm, least_dps)
    if worst is not None and (level_dps := clip_level_dps(session, i)) is not None:  # the end of the range is one code
        inside = [g[np.abs(g) < level_dps - 0.5 * session.lsb_dps] for g in readings]
        worst = _stuck_bit(axis, [g for g in inside if g.size > 1], session.lsb_dps, alarm, least_dps)
    if worst is None and POLICY.known_step * step_dps > known_step_dps:
        note = f"all readings are whole multiples of {step_dps:.6g} dps, and lsb_dps is {session.lsb_dps:.6g}"
        return Finding(axis, Reading.name, float(tails.normal_z(1e-300)), 1e-300, step_dps, note)
    return worst


def _stuck_bit(axis: str, readings: list[Array], lsb_dps: float, alarm: float, least_dps: float) -> Finding | None:
    """The bit, worth ``least_dps`` or more, that toggles least in readings [n] of each run; None if all toggle."""
    if not readings:
        return None
    codes = np.concatenate([np.rint(g / lsb_dps).astype(np.int64) for g in readings])
    noise = _steady_sd(np.concatenate([np.diff(g) for g in readings])) / lsb_dps
    mean_codes = np.array([int(np.rint(np.mean(g) / lsb_dps)) for g in readings])
    worst: Finding | None = None
    for bit in range(BITS):
        if 2**bit * lsb_dps < least_dps:
            continue
        ones = float(np.mean((codes >> bit) & 1))
        if 2**bit <= noise:  # noise alone toggles this bit
            z = abs(ones - 0.5) * 2 * np.sqrt(codes.size) / 2**bit
            chance = min(1.0, 2 * float(tails.normal(z)) * BITS) if abs(ones - 0.5) > POLICY.toggling else 1.0
        else:  # runs at different rates should show both states with equal probability
            places = np.unique(mean_codes >> bit).size
            stuck = ones in (0.0, 1.0)
            chance = min(1.0, BITS * min(0.5 ** (places - 1), _never(readings, lsb_dps, bit, ones))) if stuck else 1.0
            z = float(tails.normal_z(max(chance, 1e-300)))
        if chance < alarm and (worst is None or z > worst.strength):
            state, share = (1, ones) if ones > 0.5 else (0, 1 - ones)
            note = f"bit {bit} of the reading is {state} in {percentage(share)} of the samples"
            worst = Finding(axis, Reading.name, float(z), chance, 2**bit * lsb_dps, note)
    return worst


def _steady_sd(steps: Array) -> float:
    """The noise of readings from their differences [n]: what toggles a bit at all times, not a burst or a wild reading."""
    return min(float(np.sqrt(np.mean(steps**2))), ROBUST * float(np.median(np.abs(steps)))) / 2**0.5


def _never(readings: list[Array], lsb_dps: float, bit: int, state: float) -> float:
    """The probability that a bit of the code keeps its state in all readings, given the noise about each run's mean.

    A run whose noise is below one count is left out, because its codes do not determine the noise.
    """
    log_chance = 0.0
    for g in readings:
        mean, variance = float(g.mean()) / lsb_dps, (_steady_sd(np.diff(g)) / lsb_dps) ** 2 - SHEPPARD
        if variance < 1.0:
            continue
        sd = float(np.sqrt(variance))
        cells = np.arange(np.floor((mean - 6 * sd) / 2**bit), np.ceil((mean + 6 * sd) / 2**bit) + 1)
        edges = tails.normal(-(np.append(cells, cells[-1] + 1) * 2**bit - 0.5 - mean) / sd)
        kept = float(np.diff(edges)[cells.astype(np.int64) % 2 == int(state)].sum())
        log_chance += g.size * float(np.log(min(1.0, max(kept, 1e-300))))
    return float(np.exp(max(log_chance, -700.0)))


def dropped_carry(session: Session, axis: str) -> Finding | None:
    """A carry between two parts of the code that readings lack; None if the readings show none."""
    i = AXES.index(axis)
    carry = lost_carry(session.about(axis).runs, i)
    if carry is None:
        return None
    count_dps = count_dps_of(session.runs, i)
    return Finding(axis, Reading.name, carry.t, 0.0, 2.0**carry.bit * count_dps, carry.words(count_dps))


def single_readings(session: Session, axis: str, alarm: float) -> Finding | None:
    """Outliers that the noise's own tail does not explain and that add at least ``Policy.outlier_power`` to its power.

    ``alarm`` is the allowed probability of a false alarm. Returns None without a finding.
    """
    i = AXES.index(axis)
    steady = [r for r in session.about(axis).runs if not r.rate_is_mean]
    if not steady:
        return None
    readings = [residual_dps(r)[:, i] for r in steady]
    apart = np.concatenate([outliers_of(r, i, y)[1] for y, r in zip(readings, steady, strict=True)])
    white = sample_sd_dps(readings)
    samples = sum(y.size for y in readings)
    if apart.size < 2 or float(apart @ apart) < POLICY.outlier_power * white**2 * samples:
        return None
    chance = chance_of(readings, max(float(r.step_dps[i]) for r in steady))
    if chance >= alarm:
        return None
    size_dps = float(np.sqrt(np.mean(apart**2)))
    note = f"{apart.size} single readings stand out by {size_dps:.3g} dps"
    power = single_power(session.runs, i)
    if power is not None:
        counts = 2 ** power[0]
        several = float(np.abs(apart).max()) > 1.5 * counts * count_dps_of(session.runs, i)
        note += f", each by {'a multiple of ' * several}{counts} counts: bit {power[0]} lacks a carry or is of another sample"
    strength = float(np.sqrt(apart @ apart) / max(white, LEAST_WHITE_DPS))
    return Finding(axis, Reading.name, strength, chance, size_dps, note)
