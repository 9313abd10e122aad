"""Stretches in which a reference with three axes shows another motion than the sensor: the tracker has lost it."""

from __future__ import annotations

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.registration import Lost
from gyrocal.recording.run import AXES, Run
from gyrocal.recording.stretches import stretches


def lost(run: Run) -> Lost | None:
    """The stretches of a registered run; None if there are none.

    Reference and readings differ there by most of the larger of the two, and by far more than in the rest of the run. Readings
    near the end of their range do not count.
    """
    true_dps = np.column_stack([run.about(axis).rate_dps for axis in AXES])
    y_dps = run.gyro_dps
    known = run.reached & np.all(np.abs(y_dps) < POLICY.near_end * np.abs(y_dps).max(axis=0), axis=1)
    if not known.any():
        return None
    apart, size = np.zeros(len(run)), np.linalg.norm(y_dps, axis=1)
    apart[known] = np.linalg.norm(true_dps[known] - y_dps[known], axis=1)
    size[known] = np.maximum(size[known], np.linalg.norm(true_dps[known], axis=1))
    usual_dps = float(np.median(apart[known]))
    off = known & (apart > POLICY.lost_part * size) & (apart > max(POLICY.lost_times * usual_dps, POLICY.lost_dps))
    start, length = stretches(off)
    start, length = start[length >= POLICY.lost_samples], length[length >= POLICY.lost_samples]
    if not start.size:
        return None
    samples, beside = np.zeros(len(run), dtype=bool), round(POLICY.lost_beside_s * run.sample_rate_hz)
    for first, count in zip(start, length, strict=True):
        samples[max(0, first - beside) : first + count + beside] = True
    return Lost(run.file, samples, run.t_s[start], float(samples.mean()), float(apart[off].max()), usual_dps)
