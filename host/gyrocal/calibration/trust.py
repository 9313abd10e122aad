"""The rules that raise a flag against an answer, and its standard errors by the evidence of a pair of runs.

``gc_judge`` and ``gc_trust`` are the twins of these rules on the device.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gyrocal.calibration.estimator import Answer
from gyrocal.calibration.uncertainty import (
    Combined,
    FacePosterior,
    FaceSums,
    Index,
    face_posterior,
    held,
    last_turn,
    misfit,
    misfit_limit,
    misfit_of,
    moved,
    white_variance,
)
from gyrocal.policy import POLICY
from gyrocal.recording.full_scale import at_full_scale
from gyrocal.recording.long_steps import misses_samples
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.warning import Warning

EXPECTED_SD_DPS = 0.0448
"""Standard deviation of a sample's noise that is assumed if the readings show none: the LSM6DSO's (datasheet, table 3)."""

FLAG_OF_CODE = {"sign_flipped": "direction", "face_wrong": "direction", "constant_reading": "constant_reading"}
"""The flag that a blocking warning puts on the estimates that it concerns; that of any other code is ``implausible``."""


def warning_flags(warnings: Iterable[Warning], axis: str, runs: Sequence[Run]) -> set[str]:
    """The flags that blocking warnings put on an estimate of ``axis`` from ``runs``: those of all files and of these runs'."""
    files = {None, *(run.file for run in runs)}
    return {FLAG_OF_CODE.get(w.code, "implausible") for w in warnings if w.blocks(axis) and w.file in files}


def reading_flags(runs: Sequence[Run], axis: str, full_scale_dps: float | None) -> set[str]:
    """The flags that the readings of these runs raise: clipped, constant_reading, missed."""
    column = AXES.index(axis)
    flags = set()
    white_sd_dps = 0.0
    known = [_sums(r) for r in runs if r.axis == axis and not r.rate_is_mean]
    known = [s for s in known if s.first_n.sum() > 0]
    if known:
        white_sd_dps = float(np.sqrt(white_variance(known)[0]))
    for run in runs:
        y = run.gyro_dps[:, column]
        step_dps = run.count_dps(column)
        if full_scale_dps and at_full_scale(run, column, full_scale_dps).any():
            flags.add("clipped")
        if (white_sd_dps or EXPECTED_SD_DPS) > 0.5 * step_dps and stands_still(y, run.t_us):
            flags.add("constant_reading")
        if misses_samples(run):
            flags.add("missed")
    return flags


def stands_still(y: Array, t_us: Index) -> bool:
    """True if all readings [n] are equal, or ``POLICY.frozen_samples`` successive ones over ``POLICY.frozen_s``."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(y)) + 1, [y.size]])
    first, last = edges[:-1], edges[1:] - 1
    long = (t_us[last] - t_us[first] >= 1e6 * POLICY.frozen_s) & (last - first + 1 >= POLICY.frozen_samples)
    return edges.size == 2 or bool(long.any())


def answer_flags(answer: Answer, blocks: int) -> set[str]:
    """The flags that an answer from ``blocks`` block means raises: direction, implausible, misfit (also if it is NaN)."""
    flags = set()
    follows = 1.0 + answer.scale
    if follows < -POLICY.opposite and not follows >= -POLICY.opposite_errors * answer.scale_se:
        flags.add("direction")
    if not (abs(answer.scale) <= POLICY.largest_scale and abs(answer.bias_dps) <= POLICY.largest_bias_dps):
        flags.add("implausible")
    if answer.misfit is not None and not answer.misfit <= misfit_limit(blocks):
        flags.add("misfit")
    return flags


def _sums(run: Run) -> FaceSums:
    return FaceSums.of(_residual_dps(run), run.t_us, run.sample_rate_hz)


def _residual_dps(run: Run) -> Array:
    return run.gyro_dps[:, run.axis_index] - run.rate_dps


@dataclass(frozen=True)
class Evidence:
    """Scale and bias from runs at constant true rates, at least two of them different, and checks of other answers by them."""

    runs: Sequence[Run]
    faces: Sequence[FacePosterior]
    w_dps: Sequence[float]
    moved: float = 0.0
    """Standard errors between the answer and the last turn of the run that was recorded first; 0 if that is not known."""

    @staticmethod
    def of(runs: Sequence[Run], whole: Sequence[Run] = (), span_s: float | None = None) -> Evidence | None:
        """The evidence of runs about one axis with one sample rate; None if a run contains no whole block.

        ``runs`` are the first ``span_s`` of the runs ``whole``. The rest of the one that was recorded first is held against
        what they say.
        """
        sums = [_sums(run) for run in runs]
        if min(s.first_n.sum() for s in sums) == 0:
            return None
        variance = white_variance(sums)
        w_dps = [float(np.mean(run.rate_dps)) for run in runs]
        steps_dps = [run.count_dps(run.axis_index) for run in runs]
        faces = [face_posterior(s, variance, w, step) for s, w, step in zip(sums, w_dps, steps_dps, strict=True)]
        if not whole or span_s is None:
            return Evidence(runs, faces, w_dps)
        i = min(range(len(whole)), key=lambda k: whole[k].index)
        turn = last_turn(_residual_dps(whole[i]), whole[i].t_us, w_dps[i], round(1e6 * span_s))
        fit = Combined.of(faces, w_dps)
        off = 0.0 if turn is None else float(moved(fit, turn, w_dps[i], variance, span_s, steps_dps[i])[0])
        return Evidence(runs, faces, w_dps, off)

    @property
    def blocks(self) -> int:
        """Number of block means of all runs."""
        return sum(face.blocks for face in self.faces)

    def with_errors(self, answer: Answer) -> Answer:
        """The answer of a method without effects, with standard errors and misfit that allow for typical effects.

        Of more than two runs, their scatter about the line counts in both. The misfit is NaN if nothing is left to judge by.
        """
        fit = Combined.of(self.faces, self.w_dps)
        scale_se, bias_se_dps = fit.errors_of(np.array([answer.scale]), np.array([answer.bias_dps]))
        return Answer(
            answer.scale, with_table(float(scale_se[0]), self.runs), answer.bias_dps, float(bias_se_dps[0]),
            self._held(misfit(self.faces, fit)),
        )  # fmt: skip

    def _held(self, misfit: Array) -> float:
        return float(held(misfit, np.array([self.moved]), self.blocks)[0])

    def misfit_of(self, answer: Answer) -> float:
        """The misfit of the network's answer."""
        u_dps = [np.array([answer.bias_dps + answer.scale * w]) for w in self.w_dps]
        return float(misfit_of(self.faces, u_dps)[0])

    def with_errors_of(self, answer: Answer) -> Answer:
        """A network's answer on a table that may differ from those of its training, with standard errors and misfit.

        The effects of such a table may be larger, slower or of another kind, so that the errors are those which a fit with
        typical effects expects of the answer.
        """
        scale, bias_dps = np.array([answer.scale]), np.array([answer.bias_dps])
        scale_se, bias_se_dps = Combined.of(self.faces, self.w_dps).errors_of(scale, bias_dps)
        misfit = self._held(np.array([self.misfit_of(answer)]))
        return replace(answer, scale_se=float(scale_se[0]), bias_se_dps=float(bias_se_dps[0]), misfit=misfit)

    def disagrees(self, answer: Answer) -> bool:
        """True if a fit with the same effects expects a much larger error than the network's answer states."""
        return bool(disagreement(Combined.of(self.faces, self.w_dps), answer)[0] > POLICY.network_disagrees)


def disagreement(fit: Combined, answer: Answer) -> Array:
    """The larger ratio [N] of expected to stated error of scale and bias. The fields of ``answer`` may be arrays."""
    scale_se, bias_se_dps = fit.errors_of(np.atleast_1d(answer.scale), np.atleast_1d(answer.bias_dps))
    return np.maximum(scale_se / answer.scale_se, bias_se_dps / answer.bias_se_dps)


def with_table(scale_se: float, runs: Sequence[Run]) -> float:
    """Adds the standard error of the table's rate, which is common to both faces and does not average out."""
    return float(np.hypot(scale_se, max(run.relative_rate_se for run in runs)))
