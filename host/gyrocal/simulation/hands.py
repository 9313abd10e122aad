"""The campaign ``hands``: no table. A person turns the sensor about by hand and leaves it at rest in between.

The part is phone-grade. True orientation, rate and specific force are known at each moment; Earth turns too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from gyrocal.effects import base
from gyrocal.error_model.correction import turning_about
from gyrocal.noise.drift import Drift
from gyrocal.recording.header import Reference
from gyrocal.recording.session import AXES, Array, Run, Session

RATE_HZ = 100.0
REST_S, MOVE_S = (1.5, 3.0), (0.7, 1.6)
"""Length of a rest and of a movement, s, drawn evenly."""
TURN_DEG = (60.0, 180.0)
"""Angle of a movement about an axis drawn at random, deg."""
FIRST_REST_S = 10.0
POSES = 30
SWAY_DEG, SWAY_HZ = 3.0, 2.5
"""Amplitude and frequency of the hand's rotation about other axes during a movement."""
PUSH_G = 0.15
"""Linear acceleration in a movement, g."""
ACC_SCALE, ACC_CROSS, ACC_BIAS_G = 0.03, 0.01, 0.04
ACC_WHITE_G = 0.002
GYRO_CROSS = 0.015
"""Limits of the accelerometer's and the gyroscope's errors, which are drawn evenly for each part."""
WHITE_SD_DPS = 0.07
DRIFT = Drift(0.004, 100.0)
EARTH_DPS = 0.0041781
CLOCK_SD = 1e-4
LSB_DPS, LSB_G = 1 / 32.8, 1 / 8192
FULL_SCALE_DPS = 1000.0


FINER = 4
"""Number of orientations for each sample. Rates are their differences, which must not average over a sample's time."""


def motion(rng: np.random.Generator, poses: int) -> tuple[Array, Array]:
    """Orientation [n, 3, 3] (sensor to room) ``FINER`` times a sample, and true for those [n] of a movement."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.random(random_state=np.random.RandomState(rng.integers(2**31)))
    parts = [rotation.as_matrix()[None].repeat(round(FIRST_REST_S * RATE_HZ) * FINER, axis=0)]
    moves = [np.zeros(len(parts[0]), dtype=bool)]
    for _ in range(poses - 1):
        n = round(rng.uniform(*MOVE_S) * RATE_HZ) * FINER
        phase = np.arange(1, n + 1) / n
        smooth = phase - np.sin(2 * np.pi * phase) / (2 * np.pi)
        axis = rng.normal(size=3)
        turn = axis / np.linalg.norm(axis) * np.deg2rad(rng.uniform(*TURN_DEG))
        window = np.sin(np.pi * phase) ** 2
        sway = np.deg2rad(SWAY_DEG) * np.sin(
            2 * np.pi * SWAY_HZ * phase[:, None] * n / (RATE_HZ * FINER) + rng.uniform(0, 2 * np.pi, 3)
        )
        way = rotation * Rotation.from_rotvec(smooth[:, None] * turn) * Rotation.from_rotvec(window[:, None] * sway)
        rotation = way[-1]
        rest = rotation.as_matrix()[None].repeat(round(rng.uniform(*REST_S) * RATE_HZ) * FINER, axis=0)
        parts += [way.as_matrix(), rest]
        moves += [np.ones(n, dtype=bool), np.zeros(len(rest), dtype=bool)]
    return np.concatenate(parts), np.concatenate(moves)


def true_rates_dps(orientation: Array) -> Array:
    """Rate at each sample in the sensor's frame, shape [n, 3], deg/s, from orientations: the motion, and Earth's own rate."""
    from scipy.spatial.transform import Rotation

    middle = orientation[FINER::FINER]
    change = np.swapaxes(orientation[FINER - 1 : -1 : FINER], 1, 2) @ orientation[FINER + 1 :: FINER][: len(middle)]
    between = Rotation.from_matrix(change).as_rotvec() * RATE_HZ * FINER / 2
    earth = EARTH_DPS * np.array([np.cos(0.8), 0.0, np.sin(0.8)])
    inner = np.vstack([np.zeros(3), np.rad2deg(between)])
    return np.asarray(inner + np.einsum("nji,j->ni", orientation[::FINER], earth))


def pushes_g(rng: np.random.Generator, n: int) -> Array:
    """Linear acceleration by a hand that moves all the time, shape [n, 3], g."""
    kernel = np.hanning(21) / np.hanning(21).sum()
    return 4 * PUSH_G * np.column_stack([np.convolve(rng.normal(size=n), kernel, mode="same") for _ in range(3)])


@dataclass(frozen=True)
class ByHand:
    """A session of one run turned by hand, the effects that were planted, and the truth of the part, as in ``truth.json``."""

    session: Session
    planted: list[dict[str, Any]]
    truth: dict[str, Any]


def simulate(
    effects: Sequence[tuple[str, base.Values]], part: tuple[Array, Array], seed: int, poses: int | None = None
) -> ByHand:
    """Simulate one run.

    ``part`` holds scale and bias (deg/s) of the axes, [3] each; ``poses`` is the number of rests.
    """
    rng = np.random.default_rng((seed, 7))
    orientation, moving = motion(rng, POSES if poses is None else poses)
    n = len(orientation) // FINER
    scale, bias_dps = part
    cross = rng.uniform(-GYRO_CROSS, GYRO_CROSS, (3, 3))
    np.fill_diagonal(cross, 0.0)
    acc_matrix = np.tril(rng.uniform(-ACC_CROSS, ACC_CROSS, (3, 3)), -1) + np.diag(1 + rng.uniform(-ACC_SCALE, ACC_SCALE, 3))
    acc_bias_g = rng.uniform(-ACC_BIAS_G, ACC_BIAS_G, 3)
    force_g = orientation[::FINER, 2] + pushes_g(rng, n) * moving[::FINER, None]  # up in the sensor's frame, and the hand
    acc_g = force_g @ acc_matrix.T + acc_bias_g + rng.normal(0, ACC_WHITE_G, (n, 3))
    clock = float(rng.normal(0, CLOCK_SD))
    t_s = np.round(np.arange(n) / RATE_HZ, 6)
    temp_c = 28.0 + 4.0 * (1 - np.exp(-t_s / 120.0)) + rng.normal(0, 0.02, n)
    rate_dps = true_rates_dps(orientation) / (1 + clock)
    table = pl.DataFrame({
        "t_s": t_s, **{f"g{a}_dps": np.zeros(n) for a in AXES},
        **{f"a{a}_g": np.round(acc_g[:, i] / LSB_G) * LSB_G for i, a in enumerate(AXES)},
        "temp_c": np.round(temp_c * 256) / 256,
    })  # fmt: skip

    def run_of(frame: pl.DataFrame) -> Run:
        return Run(
            0, "000_hands.csv", "s000", "up", "z", None, None, 1, 3.0, RATE_HZ, frame=frame, lsb_dps=LSB_DPS,
            reference=Reference(kind="gravity"),
        )  # fmt: skip

    y_dps = rate_dps + rate_dps @ (np.diag(scale) + cross).T + bias_dps
    turning = {i: turning_about(run_of(table), axis, rate_dps) for i, axis in enumerate(AXES)}
    planted = []
    for effect_id, given in effects:
        kind = base.effect(effect_id)
        values = kind.draw(given, rng)
        fault = kind.fault_of(values)
        for i, axis in enumerate(AXES):
            if fault is None:
                y_dps[:, i] += kind.error_dps(turning, i, values)
            planted.append({"id": kind.id, "axis": axis, **values})
        if fault is not None:
            y_dps = fault.distort(turning[2], y_dps, values, rng)
    y_dps += rng.normal(0, WHITE_SD_DPS, (n, 3)) + DRIFT.samples(n, 1 / RATE_HZ, 3, rng)
    y_dps = np.clip(np.round(y_dps / LSB_DPS) * LSB_DPS, -FULL_SCALE_DPS, FULL_SCALE_DPS) + 0.0
    frame = table.with_columns(pl.Series(f"g{a}_dps", np.round(y_dps[:, i], 6)) for i, a in enumerate(AXES))
    session = Session(
        RATE_HZ, (run_of(frame),), "z", "phone-grade (simulated)", FULL_SCALE_DPS, LSB_DPS, reference=Reference(kind="gravity")
    )
    truth: dict[str, Any] = {
        "misalignment": cross.tolist(), "clock_error": clock,
        "accelerometer": {"matrix": acc_matrix.tolist(), "bias_g": acc_bias_g.tolist()},
    }
    return ByHand(session, planted, truth)
