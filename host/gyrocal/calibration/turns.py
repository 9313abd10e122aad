"""Errors that nobody states: of turns of a known angle, and of a bias that moves, by how far runs contradict each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyrocal import tails
from gyrocal.calibration.estimator import Answer, Calibration, estimate
from gyrocal.inference.turns import LARGEST, ROUNDS
from gyrocal.recording.session import AXES, Run


def with_scatter_of_turns(calibration: Calibration, runs: Sequence[Run]) -> list[Run]:
    """The runs of an axis, whose turns have the error by which they scatter about the line through them and the rests.

    Found from few turns it is itself uncertain: it is widened to hold 95 %, as Student's t has it. Turns that scatter no more
    than their noise stay exact, and so do those of which an error is stated, or of which one alone is there.
    """
    turns = ((i, r) for i, r in enumerate(runs) if r.rate_is_mean and r.axis == calibration.axis)
    of = [i for i, r in turns if r.turn_deg and r.turn_se_deg is None]
    noise = calibration.noise
    free = len(of) - (1 if any(not r.rate_is_mean for r in runs) else 2)
    if free < 1:
        return list(runs)

    def beside(error_deg: float) -> list[Run]:
        return [replace(r, turn_se_deg=error_deg) if i in of else r for i, r in enumerate(runs)]

    scatter_deg = LARGEST * max(abs(runs[i].turn_deg or 0.0) for i in of)
    for _ in range(ROUNDS):
        answer = estimate(calibration, beside(scatter_deg))
        if answer is None:
            return list(runs)
        left_deg2 = noise_deg2 = 0.0
        for run in (runs[i] for i in of):
            read_dps = float(np.mean(run.gyro_dps[:, AXES.index(calibration.axis)]))
            modelled_dps = (1 + answer.scale) * float(np.mean(run.rate_dps)) + answer.bias_dps
            left_deg2 += ((read_dps - modelled_dps) * run.duration_s) ** 2
            noise_deg2 += (noise.white_sd_dps**2 / len(run) + noise.ou_sd_dps**2) * run.duration_s**2 / len(of)
        if left_deg2 / free <= noise_deg2:
            return list(runs)
        scatter_deg = float(np.sqrt(left_deg2 / free - noise_deg2))
    return beside(scatter_deg * tails.widening_to_95(free))


def with_scatter_of_runs(answer: Answer, calibration: Calibration, runs: Sequence[Run]) -> Answer:
    """An answer whose errors hold how far the means of runs at stated rates scatter beyond noise.

    A bias that moves from run to run, or recordings that are no one power cycle, show in no single run. Turns move as the
    others do, unless their own scatter is in their error already.
    """
    if not any(r.rate_is_mean for r in runs):
        return answer
    noise, axis = calibration.noise, AXES.index(calibration.axis)
    known = [r for r in runs if r.measured_rates is None and r.reference_dps is None]
    rate_dps = np.array([float(np.mean(r.rate_dps)) if r.axis_index == axis else 0.0 for r in known])
    read_dps = np.array([float(np.mean(r.gyro_dps[:, axis])) for r in known])
    variance = np.array([noise.white_sd_dps**2 / len(r) + noise.ou_sd_dps**2 for r in known])
    turned = np.array([r.rate_is_mean for r in known])
    left_dps = read_dps - (1 + answer.scale) * rate_dps - answer.bias_dps
    free = np.count_nonzero(~turned) - 1 - bool(rate_dps[~turned].any())
    ratio = float(np.sum(left_dps[~turned] ** 2 / variance[~turned])) / free if free > 0 else 1.0
    if ratio <= 1:
        return answer
    of_turn = np.array([(r.turn_se_deg or 0.0) / r.duration_s if r.rate_is_mean else 0.0 for r in known])
    moved = np.where(of_turn > 0, 0.0, (ratio - 1) * variance)
    columns = np.column_stack([rate_dps, np.ones(len(known))])
    weighted = columns / (variance + moved + of_turn**2)[:, None]
    inverse = np.linalg.pinv(columns.T @ weighted)
    scale, bias_dps2 = np.diag(inverse @ (weighted.T * moved) @ weighted @ inverse)
    scale_se, bias_se_dps = np.sqrt([answer.scale_se**2 + scale, answer.bias_se_dps**2 + bias_dps2]).tolist()
    return replace(answer, scale_se=scale_se, bias_se_dps=bias_se_dps)
