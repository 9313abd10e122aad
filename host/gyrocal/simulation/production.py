"""A simulated production line: boards whose scale, bias and effects are drawn from a population, on one or more rigs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import polars as pl

from gyrocal.effects.base import Values, effect
from gyrocal.noise.drift import ou_noise
from gyrocal.recording.header import Face
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.simulation.simulate import FULL_SCALE_DPS, LSB_DPS, OU_SD_DPS, OU_TAU_S, RATE_HZ, TURN_ON_SD_DPS, WHITE_SD_DPS

SCALE, SCALE_SD = 0.004, 0.003
BIAS_DPS, BIAS_SD_DPS = -0.2, 0.5
CYCLES = 3
POSES: tuple[tuple[Face, float], ...] = (("up", 78.0), ("up", -150.0), ("down", 78.0), ("down", 0.0))
"""Face and table rate (deg/s) of the runs of one power cycle."""
FIRST_DAY = np.datetime64("2026-01-05")
BOARDS_A_DAY = 20


@dataclass(frozen=True)
class Planted:
    """An effect on the session's axis: a share of the boards has it, its linear parameter drawn from a normal distribution."""

    effect_id: str
    parameter: str
    mean: float
    sd: float = 0.0
    share: float = 1.0
    nonlinear: Values = field(default_factory=dict)


@dataclass(frozen=True)
class Production:
    """The population that a production line makes, and its measurement: twelve runs of ``seconds`` in three power cycles.

    Boards take turns on the rigs; ``rig_scale_sd`` is the spread of the rigs' own error of the scale. ``scale_step`` is added
    to the scale of the boards from number ``step_at`` on.
    """

    planted: Sequence[Planted] = ()
    rigs: int = 1
    rig_scale_sd: float = 0.0
    scale_step: float = 0.0
    step_at: int = 0
    seed: int = 0
    seconds: float = 6.0

    def board(self, number: int) -> Session:
        """The session of one board; the same number gives the same session."""
        rng = np.random.default_rng((self.seed, number))
        rig = number % self.rigs
        scale = rng.normal(SCALE, SCALE_SD) + (self.scale_step if number >= self.step_at else 0.0)
        scale += np.random.default_rng((self.seed, 1, rig)).normal(0.0, self.rig_scale_sd) if self.rig_scale_sd else 0.0
        bias_dps = rng.normal(BIAS_DPS, BIAS_SD_DPS, 3)
        sizes = [float(rng.normal(p.mean, p.sd)) if rng.random() < p.share else 0.0 for p in self.planted]
        runs: list[Run] = []
        for cycle in range(CYCLES):
            turn_on_dps = rng.normal(0.0, TURN_ON_SD_DPS, 3)
            room_c = rng.normal(24.0, 1.0)
            for k, (face, rate_dps) in enumerate(POSES):
                on_s = round(3.0 + (self.seconds + 3.0) * k + float(rng.uniform(0, 2)), 1)
                bare = _bare(len(runs), cycle, face, rate_dps, on_s, self.seconds, room_c, rng)
                y_dps = np.zeros((len(bare), 3)) + bias_dps + turn_on_dps
                y_dps[:, 2] += (1 + scale) * bare.rate_dps
                for plan, size in zip(self.planted, sizes, strict=True):
                    y_dps[:, 2] += effect(plan.effect_id).term(bare, 2, {plan.parameter: size, **plan.nonlinear})
                y_dps += rng.normal(0.0, WHITE_SD_DPS, y_dps.shape)
                y_dps += ou_noise(len(bare), 1 / RATE_HZ, OU_SD_DPS, OU_TAU_S, 3, rng)
                runs.append(_read(bare, y_dps))
        day = str(FIRST_DAY + number // BOARDS_A_DAY)
        return Session(
            RATE_HZ, tuple(runs), "z", "LSM6DSO (simulated)", FULL_SCALE_DPS, LSB_DPS,
            board=f"B{number:06d}", rig=f"rig{rig}", line="A", made_on=day,
        )  # fmt: skip

    def write(self, out: Path, boards: range, parquet: bool = False) -> None:
        """A session folder for each board in ``out``."""
        for number in boards:
            self.board(number).save(out / f"board{number:06d}", parquet=parquet)


def _bare(
    index: int, cycle: int, face: Face, rate_dps: float, power_on_s: float, seconds: float, room_c: float,
    rng: np.random.Generator,
) -> Run:  # fmt: skip
    """A run whose readings are zero: times, acceleration and temperature."""
    n = round(seconds * RATE_HZ)
    t_s = np.round(np.arange(n) / RATE_HZ, 6)
    gravity = np.array([0.0, 0.0, 1.0 if face == "up" else -1.0])
    acc_g = np.round((gravity + rng.normal(0, 0.0012, (n, 3))) / 6.1e-5) * 6.1e-5
    warming_c = 3.0 * (1 - np.exp(-(power_on_s + t_s) / 60.0))
    temp_c = np.round((room_c + warming_c + rng.normal(0, 0.02, n) - 25.0) * 256.0) / 256.0 + 25.0
    table = pl.DataFrame({
        "t_s": t_s, **{f"g{a}_dps": np.zeros(n) for a in AXES}, **{f"a{a}_g": acc_g[:, i] for i, a in enumerate(AXES)},
        "temp_c": temp_c,
    })  # fmt: skip
    return Run(
        index, f"{index:03d}_{face}.csv", f"s{cycle:03d}", face, "z", rate_dps, None, None, power_on_s, RATE_HZ,
        frame=table, lsb_dps=LSB_DPS,
    )  # fmt: skip


def _read(bare: Run, y_dps: Array) -> Run:
    counts_dps = np.round(np.round(y_dps / LSB_DPS) * LSB_DPS, 6) + 0.0
    table = bare.table.with_columns(pl.Series(f"g{a}_dps", counts_dps[:, i]) for i, a in enumerate(AXES))
    return replace(bare, frame=table)
