"""Runs that are not recorded yet, as block means of the columns that they are expected to show.

Time and rates follow from the plan. The temperature is that of the session's own power cycles, which self-heating raises; a
chamber replaces the room's air. The acceleration is gravity, as the session's own runs show it in the same pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from gyrocal.effects.quantities import temperature_by_second
from gyrocal.inference.blocks import BLOCK_S, Blocks
from gyrocal.planning.rig import Pose
from gyrocal.recording.session import AXES, Array, Run, Session

TAUS_S = np.geomspace(20.0, 1000.0, 18)
"""Time constants of self-heating that are tried, s."""
QUANTILES = (1 / 6, 1 / 2, 5 / 6)
"""Of the room's air over the session's power cycles: three rooms stand for the next ones."""


@dataclass(frozen=True)
class Warming:
    """The temperature of a part after power-on: ``air_c + rise_c·(1 - exp(-p/tau_s))``; ``airs_c`` are those of the session."""

    airs_c: tuple[float, ...]
    rise_c: float
    tau_s: float

    @staticmethod
    def of(session: Session) -> Warming | None:
        """The warming of the session's power cycles by least squares; None if no run has a thermometer."""
        scenarios = session.scenarios
        parts = []
        for run in session.runs:
            if run.temp_c is not None:
                t_s, temp_c = temperature_by_second(run)
                parts.append((scenarios.index(run.scenario), (run.power_on_s or 0.0) + t_s - run.t_s[0], temp_c))
        if not parts:
            return None
        cycle = np.concatenate([np.full(t.size, k) for k, t, _ in parts])
        p_s, temp_c = (np.concatenate([part[i] for part in parts]) for i in (1, 2))
        own = (cycle[:, None] == np.unique(cycle)).astype(float)
        best: tuple[float, Array, float] | None = None
        for tau_s in TAUS_S:
            columns = np.column_stack([own, 1 - np.exp(-p_s / tau_s)])
            beta = np.linalg.lstsq(columns, temp_c, rcond=None)[0]
            misfit = float(np.sum((temp_c - columns @ beta) ** 2))
            if best is None or misfit < best[0]:
                best = misfit, beta, float(tau_s)
        assert best is not None
        airs = np.quantile(best[1][:-1], QUANTILES)
        return Warming(tuple(map(float, airs)), float(best[1][-1]), best[2])

    def temp_c(self, air_c: float, power_on_s: Array) -> Array:
        """The part's temperature [n], degC, at times [n] since power-on, s, in air of ``air_c``."""
        return np.asarray(air_c + self.rise_c * (1 - np.exp(-power_on_s / self.tau_s)))


@dataclass(frozen=True)
class Expected:
    """Makes the expected blocks of planned runs of a session."""

    session: Session
    warming: Warming | None
    samples: float
    """Samples of a block."""

    @staticmethod
    def of(session: Session) -> Expected:
        """What planned runs of a session's rig are expected to show."""
        return Expected(session, Warming.of(session), session.sample_rate_hz * BLOCK_S)

    def rooms(self, pose: Pose) -> tuple[float, ...]:
        """The air that a pose may meet, degC: a chamber's, else that of the session's power cycles."""
        if pose.temp_c is not None:
            return (pose.temp_c,)
        return (25.0,) if self.warming is None else self.warming.airs_c

    def blocks(self, pose: Pose, seconds: float, power_on_s: float, air_c: float, scenario: int) -> Blocks:
        """One run, each of whose samples is the mean of a block; the readings are 0."""
        m = max(2, round(seconds / BLOCK_S))
        t_s = np.arange(m, dtype=np.float64) * BLOCK_S
        columns = {"t_s": t_s, **{f"g{a}_dps": np.zeros(m) for a in AXES}}
        own = self.session.runs
        if all(run.acc_g is not None for run in own):
            columns |= {f"a{a}_g": np.full(m, g) for a, g in zip(AXES, self._gravity_g(pose), strict=True)}
        if self.warming is not None:
            columns["temp_c"] = self.warming.temp_c(air_c, power_on_s + t_s)
        if all(run.column("table_angle_deg") is not None for run in own):
            columns["table_angle_deg"] = pose.table_rate_dps * t_s
        known = any(run.power_on_s is not None for run in own)
        run = Run(
            len(own) + scenario, "planned", f"planned {scenario}", pose.face, pose.axis, pose.table_rate_dps, None, None,
            power_on_s if known else None, 1 / BLOCK_S, frame=pl.DataFrame(columns), lsb_dps=self.session.lsb_dps,
            latitude_deg=self.session.latitude_deg, smooth=False,
        )  # fmt: skip
        run.__dict__["_read"] = run.frame, ""  # the table is ours and needs no check, which takes longer than the rest
        return Blocks(run, scenario, np.arange(m), np.full(m, self.samples), t_s, np.zeros((m, 3)), np.zeros(3), 0)

    def _gravity_g(self, pose: Pose) -> Array:
        """Mean acceleration [3] in a pose, g: that of the session's runs in it, else gravity along the run's axis."""
        seen = [run.acc_g.mean(axis=0) for run in _in_pose(self.session.runs, pose) if run.acc_g is not None]
        ideal = np.zeros(3)
        ideal[AXES.index(pose.axis)] = 1.0 if pose.face == "up" else -1.0
        return np.asarray(np.nanmean(seen, axis=0)) if seen else ideal


def _in_pose(runs: Sequence[Run], pose: Pose) -> list[Run]:
    return [run for run in runs if (run.axis, run.face) == (pose.axis, pose.face)]
