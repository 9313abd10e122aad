"""Stretches in which a reference with three axes shows another motion than the sensor: the tracker has lost it."""

from __future__ import annotations

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.registration import Lost
from gyrocal.recording.run import AXES, Array, Run
from gyrocal.recording.stretches import Mask, stretches


def lost(run: Run) -> Lost | None:
    """The stretches of a registered run; None if there are none.

    Reference and readings differ there by most of the larger of the two, and by far more than in the rest of the run. The
    samples before and after belong to the stretch as long as both differ more than usual, which grows with the rate. Readings
    near the end of their range do not count.
    """
    true_dps = np.column_stack([run.about(axis).rate_dps for axis in AXES])
    y_dps = run.gyro_dps
    reached = run.reached
    known = reached & np.all(np.abs(y_dps) < POLICY.near_end * np.abs(y_dps).max(axis=0), axis=1)
    if not known.any():
        return None
    apart, size = np.zeros(len(run)), np.linalg.norm(y_dps, axis=1)
    apart[reached] = np.linalg.norm(true_dps[reached] - y_dps[reached], axis=1)
    size[reached] = np.maximum(size[reached], np.linalg.norm(true_dps[reached], axis=1))
    usual_dps = float(np.median(apart[known]))
    off = known & (apart > POLICY.lost_part * size) & (apart > max(POLICY.lost_times * usual_dps, POLICY.lost_dps))
    start, length = stretches(off)
    start, length = start[length >= POLICY.lost_samples], length[length >= POLICY.lost_samples]
    if not start.size:
        return None
    beside = round(POLICY.lost_beside_s * run.sample_rate_hz)
    usual_here_dps = np.maximum(usual_dps, _usual_part(apart, size, known) * size)
    near = ~reached | off | (apart > POLICY.lost_edge_times * usual_here_dps)
    samples, starts_s = np.zeros(len(run), dtype=bool), []
    for first, end in _joined(near, beside):
        if np.any((start >= first) & (start < end)):
            samples[max(0, first - beside) : end + beside] = True
            starts_s.append(run.t_s[first])
    return Lost(run.file, samples, np.array(starts_s), float(samples.mean()), float(apart[off].max()), usual_dps)


def _usual_part(apart: Array, size: Array, known: Mask) -> float:
    """The usual difference as a part of the larger rate, among the samples that turn faster than in the mean."""
    fast = known & (size > np.sqrt(np.mean(size[known] ** 2)))
    return float(np.median(apart[fast] / size[fast])) if fast.any() else 0.0


def _joined(mask: Mask, gap: int) -> list[tuple[int, int]]:
    """First sample and end of each stretch of a mask [n]; stretches up to ``gap`` samples apart are one."""
    joined: list[tuple[int, int]] = []
    for first, count in zip(*(part.tolist() for part in stretches(mask)), strict=True):
        end = first + count
        if joined and first - joined[-1][1] <= gap:
            first = joined.pop()[0]
        joined.append((first, end))
    return joined
