"""Is the excess of compare what least squares leaves beyond the noise, and do its errors hold?

    python benchmarks/excess.py [planted|null] ...

``planted``: simulated sessions with one effect that the model lacks. The excess is held against block means of 1 s from which
numpy takes scale and bias by least squares, less the white noise, the drift and the turn-on bias that the session was
simulated with. ``null``: sessions without an effect; how many excesses lie beyond two of their errors, and how far floors lie
above the rms. Without an argument both are run.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gyrocal.diagnosis.residual.comparison import Comparison, measure
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.simulation.simulate import LSB_DPS, OU_SD_DPS, WHITE_SD_DPS, simulate

NOISE_DPS2 = WHITE_SD_DPS**2 + LSB_DPS**2 / 12
"""Variance of the simulated noise of one sample, with its rounding, dps^2."""


@dataclass(frozen=True)
class Case:
    """A simulated session: campaign, effect (empty: none), the axis on which it acts, and the block means that show it."""

    campaign: str
    effect: str = ""
    axis: str = "z"
    seed: int = 1
    how: Mapping[str, Any] = field(default_factory=dict)
    means_s: float = 1.0

    def session(self) -> tuple[Session, Array]:
        """The session, and the turn-on bias [runs, 3] of its power cycles, deg/s."""
        session, truth = simulate(None, self.campaign, [self.effect] if self.effect else [], self.seed, **self.how)
        bias_dps = np.array([run["bias_dps"] for run in truth["runs"]])
        return session, bias_dps - bias_dps.mean(axis=0)

    def __str__(self) -> str:
        return f"{self.campaign:8s} {self.effect or 'nothing'}"


PLANTED = (
    Case("full", "spin_up:A=0.002,tau_s=2", seed=11),
    Case("full", "warmup:A_dps=0.1,tau_s=60", seed=12),
    Case("full", "table_ripple", seed=13, means_s=0.1),
    Case("full", "bias_temperature:k1_dps_per_c=0.02", seed=14),
    Case("full", "scale_asymmetry:k=0.0005", seed=15),
    Case("full", "scale_nonlinearity", seed=16),
    Case("swing", "lag:tau_s=0.0005", seed=17, means_s=0.1),
    Case("paper", "spin_up:A=0.002,tau_s=2", seed=18, how={"scenarios": 12}),
    Case("paper", "warmup:A_dps=0.1,tau_s=60", seed=19, how={"scenarios": 12}),
    Case("bench", "g_sensitivity", seed=20, how={"scenarios": 2}),
    Case("swing", "scale_asymmetry:k=0.0005", seed=21, means_s=0.1),
    Case("chamber", "bias_temperature:k1_dps_per_c=0.02,k2_dps_per_c2=0.0005", seed=22, how={"scenarios": 2}),
)  # fmt: skip
NULL = tuple(
    Case(campaign, seed=seed, how=how)
    for seed in (101, 102)
    for campaign, how in (
        ("full", {}), ("paper", {"scenarios": 12}), ("bench", {"scenarios": 2}), ("shaker", {}), ("swing", {}),
        ("chamber", {"scenarios": 2}), ("paper", {"scenarios": 3}), ("full", {"scenarios": 1}),
    )
)  # fmt: skip


def least_squares_dps(session: Session, turn_on_dps: Array, axis: str, means_s: float) -> tuple[float, float]:
    """What scale and bias by least squares leave of block means beyond the simulated noise, deg/s.

    In sample, and where each day (each run, in a session of one day) is predicted from the others.
    """
    a = AXES.index(axis)
    y, x, per_mean = [], [], []
    for run, offset in zip(session.runs, turn_on_dps[:, a], strict=True):
        rate = run.rate_dps if run.axis_index == a else np.zeros(len(run))
        off = run.gyro_dps[:, a] - rate - offset
        size = round(means_s * run.sample_rate_hz)
        y.append(off[: off.size // size * size].reshape(-1, size).mean(axis=1))
        x.append(rate[: off.size // size * size].reshape(-1, size).mean(axis=1))
        per_mean.append(size)
    means, rates = np.concatenate(y), np.concatenate(x)
    columns = np.column_stack([np.ones_like(means), rates])[:, : 2 if np.any(rates) else 1]
    left = means - columns @ np.linalg.lstsq(columns, means, rcond=None)[0]
    noise = NOISE_DPS2 / float(np.mean(per_mean)) + OU_SD_DPS**2
    powers = [float(left @ left) / (means.size - columns.shape[1])]
    several = len(set(session.days)) > 1
    unit = np.concatenate([np.full(len(m), r.day if several else r.index) for m, r in zip(y, session.runs, strict=True)])
    for one in np.unique(unit):
        held = unit == one
        left[held] = means[held] - columns[held] @ np.linalg.lstsq(columns[~held], means[~held], rcond=None)[0]
    powers.append(float(left @ left) / means.size)
    in_sample, held_out = (float(np.sqrt(max(0.0, power - noise))) for power in powers)
    return in_sample, held_out


def planted() -> None:
    print("mdps; LS: least squares in sample, and held out; off: errors by which the excess differs from either")
    heads = " ".join(f"{head:>7s}" for head in ("LS", "off", "LS out", "off"))
    print(f"{'session':66s} {'excess':>17s} {heads} {'within':>17s} {'rms':>7s} {'floor':>7s}")
    agree = np.zeros(2, dtype=int)
    for case in PLANTED:
        session, turn_on_dps = case.session()
        level = measure(session).per_axis[case.axis]
        truths = least_squares_dps(session, turn_on_dps, case.axis, case.means_s)
        excess, se, within, within_se, rms, floor = (
            1e3 * (value or 0.0) for value in (
                level.excess_dps, level.excess_se_dps, level.excess_within_dps, level.excess_within_se_dps, level.rms_dps,
                level.floor_dps,
            )
        )  # fmt: skip
        off = [(excess - 1e3 * truth) / se for truth in truths]
        agree += np.abs(off) <= 2
        told = " ".join(f"{1e3 * truth:7.2f} {o:7.1f}" for truth, o in zip(truths, off, strict=True))
        print(
            f"{case!s:66s} {excess:8.2f} +- {se:5.2f} {told} {within:8.2f} +- {within_se:5.2f} {rms:7.2f} {floor:7.2f}",
            flush=True,
        )
    print(f"of {len(PLANTED)} agree within two errors: {agree[0]} with least squares in sample, {agree[1]} with it held out")


def null() -> None:
    ratios, z = [], []
    for case in NULL:
        found: Comparison = measure(case.session()[0])
        for axis, level in found.per_axis.items():
            squares, floor = found.squares[axis], found.floors[axis]
            both = ((level.excess_dps, level.excess_se_dps), (level.excess_within_dps, level.excess_within_se_dps))
            ratios.append([(e or 0.0) / se if se else 0.0 for e, se in both])
            z.append([(squares.all - floor.all) / floor.error, (squares.within - floor.within) / floor.error_within])
    for name, of, difference in zip(("all", "within"), np.transpose(ratios), np.transpose(z), strict=True):
        print(
            f"null, {name:6s}: {of.size} axes, excess beyond 2 errors {np.sum(of > 2)}, beyond 3 {np.sum(of > 3)}, largest "
            f"{of.max():.2f}; mean square over floor in errors: mean {difference.mean():.2f}, sd {difference.std():.2f}, from "
            f"{difference.min():.2f} to {difference.max():.2f}"
        )


def main() -> int:
    for what in sys.argv[1:] or ("planted", "null"):
        {"planted": planted, "null": null}[what]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
