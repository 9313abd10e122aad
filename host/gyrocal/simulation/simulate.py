"""Sessions with a known truth: the sensor of eq. (4), its noise, and any effects planted.

The sensor chain: true rate -> (1 + scale)·w + bias -> effects -> white noise and a slow Ornstein-Uhlenbeck drift -> LSB steps
and clipping. White noise is the LSM6DSO's 3.8 mdps/sqrt(Hz) (datasheet, table 3) through its 136 Hz low-pass at 416 Hz,
polled at 145 Hz, so that what lies above half the sampling rate folds back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.effects import base
from gyrocal.effects.reading_fault import Fault
from gyrocal.effects.timing import TimingEffect
from gyrocal.errors import InputError, did_you_mean
from gyrocal.noise.axis import COMPONENTS, AxisNoise
from gyrocal.noise.component import NoiseComponent
from gyrocal.noise.drift import Drift, ou_noise
from gyrocal.noise.power_cycles import TurnOnBias
from gyrocal.parameter import Described
from gyrocal.recording.plan_file import PlannedRuns
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.simulation import hands
from gyrocal.simulation.campaigns import (
    CAMPAIGNS,
    HANDS,
    OFF_S,
    PAUSE_EVERY,
    PAUSE_S,
    RIPPLE,
    TABLE_RATE_DPS,
    TRANSIENT,
    Planned,
    Swing,
    of_plan,
)
from gyrocal.simulation.climate import ROOM_SD_C, Day
from gyrocal.simulation.planted import parse
from gyrocal.simulation.truth import TRUTH_FORMAT, RunTruth, check_new, saved

RATE_HZ = 145.0
LSB_DPS = 0.00875
FULL_SCALE_DPS = 250.0
WHITE_SD_DPS = 0.0038 * np.sqrt(136.0)
OU_SD_DPS = 0.002
OU_TAU_S = 30.0
TURN_ON_SD_DPS = 0.005
SCALE_LIMIT, BIAS_LIMIT_DPS = 0.03, 10.0
"""Each axis of a part has its own scale and bias, drawn uniformly within these limits of uncalibrated parts."""
SCALE_MEAN, BIAS_MEAN_DPS = 0.004, -0.05
"""Mean scale and bias of the paper's sensors (its Fig. 4), which the campaign ``table2`` has instead."""
SCALE_SD, BIAS_SD_DPS = 0.0005, 0.04
"""Standard deviations of scale and bias between the paper's scenarios."""

# The campaign whose baseline errs as the paper's Table 2 does (bias, and 78 deg/s times scale, within 30 % of 55, 35 and
# 30 mdps at 2, 4 and 6 s): what each run draws. Measured by `gyrocal benchmark paper`.
RIPPLE_SD_DPS = 0.09
TRANSIENT_SD_DPS = 0.13
TRANSIENT_TAU_S = (0.7, 5.0)
LOG_TAU = (float(np.log(TRANSIENT_TAU_S[0])), float(np.log(TRANSIENT_TAU_S[1])))

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Sensor:
    """A simulated sensor: the distribution of its scale and bias, its turn-on bias and its drift."""

    turn_on_bias: TurnOnBias
    drift: Drift
    mean_scale: Array
    mean_bias_dps: Array
    """Standard deviations of the axes, [3]."""
    given: Mapping[base.Role, float] = field(default_factory=dict)
    """Scale (fraction) and bias (deg/s) that are given rather than drawn."""

    @staticmethod
    def of(
        wanted: Sequence[tuple[str, base.Values]], turn_on_sd_dps: float, means: tuple[Array, Array], rng: np.random.Generator
    ) -> tuple[Sensor, list[tuple[str, base.Values]]]:
        """The sensor with the properties that the wanted effects give it, and the other effects, which are planted.

        ``means``: scale and bias (deg/s) of the axes, [3] each.
        """
        noise = AxisNoise(drift=Drift(OU_SD_DPS, OU_TAU_S), turn_on_bias=TurnOnBias(turn_on_sd_dps))
        given: dict[base.Role, float] = {}
        left = []
        for effect_id, values in wanted:
            kind = _kind(effect_id)
            if isinstance(kind, NoiseComponent):
                noise = noise.having(kind.with_values(kind.draw(values, rng)))
            elif isinstance(kind, base.Effect) and kind.role is not None:
                given[kind.role] = kind.draw(values, rng)[kind.linear[0]]
            else:
                left.append((effect_id, values))
        assert noise.drift is not None
        assert noise.turn_on_bias is not None
        return Sensor(noise.turn_on_bias, noise.drift, *means, given), left

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Scale and bias of the three axes, [3] each."""
        scale = rng.normal(self.mean_scale, SCALE_SD)
        bias_dps = rng.normal(self.mean_bias_dps, BIAS_SD_DPS)
        return (
            np.full(3, self.given[base.Role.SCALE]) if base.Role.SCALE in self.given else scale,
            np.full(3, self.given[base.Role.BIAS]) if base.Role.BIAS in self.given else bias_dps,
        )


def part(campaign: str, number: int) -> tuple[Array, Array]:
    """Scale and bias (deg/s) of a simulated part's axes, [3] each: the paper's for ``table2``, else drawn by its number."""
    if campaign == "table2":
        return np.full(3, SCALE_MEAN), np.full(3, BIAS_MEAN_DPS)
    rng = np.random.default_rng((number, 2))
    return rng.uniform(-SCALE_LIMIT, SCALE_LIMIT, 3), rng.uniform(-BIAS_LIMIT_DPS, BIAS_LIMIT_DPS, 3)


def _kind(effect_id: str) -> Described:
    """The noise or the effect of an id."""
    return COMPONENTS.get(effect_id) or base.effect(effect_id)


def simulate(
    out: str | Path | None = None,
    campaign: str = "paper",
    effects: Sequence[str | tuple[str, Mapping[str, float]]] = (),
    seed: int = 0,
    *,
    scenarios: int | None = None,
    seconds: float | None = None,
    vary: bool = False,
    turn_on_sd_dps: float = TURN_ON_SD_DPS,
    sensor: int | None = None,
    parquet: bool = False,
    plan: PlannedRuns | None = None,
    add_to: Session | None = None,
    progress: Progress | None = None,
) -> tuple[Session, dict[str, Any]]:
    """Simulate a campaign; write it to the folder ``out`` with its truth beside it as ``out.truth.json``.

    ``effects`` are ``"id:name=value,..."`` or ``(id, {name: value})``; parameters left out take their default, phases are drawn
    for each run. A part, drawn by its number ``sensor`` (None: the seed), has a scale within 3 % and a bias within 10 deg/s on
    each axis. With ``vary`` they differ between scenarios. ``table2`` is ``paper`` with sensors and effects that make its
    baseline err as the paper's. A ``plan`` takes the campaign's place; its runs follow those of the session ``add_to``, of the
    same part where that was simulated with this seed and these effects. Returns both; ``out`` None: nothing is written.
    """
    _check(campaign, seconds, plan, add_to)
    wanted = [parse(e, _kind) if isinstance(e, str) else (_kind(e[0]).id, dict(e[1])) for e in effects]
    check_new(out)
    chosen = CAMPAIGNS[campaign]
    runs_of = chosen.plan(scenarios, seconds) if plan is None else of_plan(plan)
    if campaign == HANDS:
        return _by_hand(out, wanted, seed, seed if sensor is None else sensor, runs_of, parquet)
    rng, weather = np.random.default_rng(seed), np.random.default_rng((seed, 1))
    own, planted = Sensor.of(wanted, turn_on_sd_dps, part(campaign, seed if sensor is None else sensor), rng)
    mine, before = sorted({p.day for p in runs_of}), 0 if add_to is None else len(add_to.runs)
    rooms = {day: rng.normal(24.0, ROOM_SD_C) for day in (mine if add_to is None else add_to.days)}
    scale, bias_dps = own.draw(rng)
    if before:
        rng, weather = np.random.default_rng((seed, before, *mine)), np.random.default_rng((seed, before, *mine, 1))
        rooms = {day: rng.normal(24.0, ROOM_SD_C) for day in mine}
    days = {day: Day(room_c, weather.uniform(0, 2 * np.pi), chosen.chamber_c) for day, room_c in rooms.items()}
    runs, truths = list[Run](), list[RunTruth]()
    shared: dict[str, base.Values] = {}
    several = len({p.axis for p in runs_of}) > 1
    turn_on_dps = np.zeros(3)
    for i, planned in enumerate(runs_of):
        if _begins_cycle(runs_of, i, days):
            turn_on_dps = np.array([own.turn_on_bias.draw_dps(rng) for _ in AXES])
            if vary or campaign == "table2":  # the paper's scenarios differ by more than a turn-on (its Fig. 4)
                scale, bias_dps = own.draw(rng)
        truth = RunTruth(f"{before + i:03d}_{planned.face}.csv", scale.tolist(), (bias_dps + turn_on_dps).tolist())
        acting = [*planted, *(table2_draw(rng) if campaign == "table2" else [])]
        runs.append(simulate_run(before + i, planned, truth, acting, shared, own, days[planned.day], several, rng, runs))
        truths.append(truth)
        if progress is not None:
            progress(i + 1, len(runs_of))
    axis = "z" if several else runs_of[0].axis
    session = add_to or Session(RATE_HZ, (), axis, "LSM6DSO (simulated)", FULL_SCALE_DPS, LSB_DPS)
    session = session.with_runs([*session.runs, *runs])
    record = _record(campaign, seed, {i for i, _ in wanted}, own, truths)
    return (session if out is None else saved(session, out, record, parquet)), record


def _begins_cycle(plan: Sequence[Planned], i: int, days: Mapping[int, Day]) -> bool:
    """True if a run begins a power cycle; the part then was without power since the run before it."""
    if i and plan[i].scenario == plan[i - 1].scenario:
        return False
    if i and plan[i].day == plan[i - 1].day:
        day = days[plan[i].day]
        day.switch_off(plan[i - 1].power_on_s + plan[i - 1].seconds)
        cycles = len({p.scenario for p in plan[:i] if p.day == plan[i].day})
        day.off(PAUSE_S if cycles % PAUSE_EVERY == 0 else OFF_S)
    return True


def _by_hand(
    out: str | Path | None, wanted: Sequence[tuple[str, base.Values]], seed: int, number: int, plan: Sequence[Planned],
    parquet: bool,
) -> tuple[Session, dict[str, Any]]:  # fmt: skip
    """:func:`simulate` for the campaign ``hands``."""
    own, planted = Sensor.of(wanted, TURN_ON_SD_DPS, part(HANDS, number), np.random.default_rng(seed))
    scale, bias_dps = own.draw(np.random.default_rng((seed, 3)))
    by_hand = hands.simulate(planted, (scale, bias_dps), seed, round(plan[0].seconds))
    session = by_hand.session
    truth = RunTruth(session.runs[0].file, scale.tolist(), bias_dps.tolist(), by_hand.planted)
    record = {**_record(HANDS, seed, {i for i, _ in wanted}, own, [truth]), **by_hand.truth}
    record["noise"] = {
        "white_sd_dps": hands.WHITE_SD_DPS, "ou_sd_dps": hands.DRIFT.sd_dps, "ou_tau_s": hands.DRIFT.tau_s,
        "turn_on_sd_dps": 0.0,
    }  # fmt: skip
    return (session if out is None else saved(session, out, record, parquet)), record


def _check(campaign: str, seconds: float | None, plan: PlannedRuns | None, add_to: Session | None) -> None:
    if add_to is not None and (plan is None or add_to.sample_rate_hz != RATE_HZ):
        raise InputError(f"--add-to: needs --plan, and a session at {RATE_HZ:g} Hz")
    if campaign not in CAMPAIGNS:
        raise InputError(f"--campaign {campaign}: there are {', '.join(CAMPAIGNS)}{did_you_mean(campaign, CAMPAIGNS)}")
    if seconds is not None and not 2.0 / RATE_HZ <= seconds < np.inf:
        raise InputError(f"--seconds {seconds:g}: a run lasts two samples of 1/{RATE_HZ:g} s at least")


def _record(campaign: str, seed: int, wanted: set[str], sensor: Sensor, truths: Sequence[RunTruth]) -> dict[str, Any]:
    """The content of ``out.truth.json``."""
    return {
        "format": TRUTH_FORMAT, "campaign": campaign, "seed": seed,
        "effects": sorted({e["id"] for t in truths for e in t.effects} | wanted),
        "noise": {
            "white_sd_dps": WHITE_SD_DPS, "ou_sd_dps": sensor.drift.sd_dps, "ou_tau_s": sensor.drift.tau_s,
            "turn_on_sd_dps": sensor.turn_on_bias.sd_dps,
        },
        "runs": [asdict(t) for t in truths],
    }  # fmt: skip


def table2_draw(rng: np.random.Generator) -> list[tuple[str, dict[str, float]]]:
    """Ripple and transient of one run of the campaign ``table2``."""
    a, b = rng.normal(0.0, RIPPLE_SD_DPS / TABLE_RATE_DPS, 2)
    tau_s = float(np.exp(rng.uniform(*LOG_TAU)))
    return [
        (RIPPLE, {"amplitude_1": float(np.hypot(a, b)), "phase_1_deg": float(np.rad2deg(np.arctan2(-b, a)))}),
        (TRANSIENT, {"A": float(rng.normal(0.0, TRANSIENT_SD_DPS / TABLE_RATE_DPS)), "tau_s": tau_s}),
    ]


def simulate_run(
    index: int,
    planned: Planned,
    truth: RunTruth,
    effects: Sequence[tuple[str, Mapping[str, float]]],
    shared: dict[str, base.Values],
    sensor: Sensor,
    day: Day,
    several: bool,
    rng: np.random.Generator,
    earlier: Sequence[Run] = (),
) -> Run:
    """One run, after the ``earlier`` ones.

    The planted effects are added to ``truth.effects``, and those that are the same in all runs to ``shared``.
    An effect acts on all axes if the table turns about ``several``, otherwise only on the table's axis.
    """
    frame = _surroundings(planned, day, rng)
    n, axis = frame.height, AXES.index(planned.axis)

    def run_of(table: pl.DataFrame) -> Run:
        return Run(
            index, truth.file, planned.scenario, planned.face, planned.axis,
            planned.table_rate_dps if planned.swing is None else None, None, planned.day, planned.power_on_s, RATE_HZ,
            frame=table, lsb_dps=LSB_DPS, earlier=tuple(run for run in earlier if run.scenario == planned.scenario),
        )  # fmt: skip

    drawn: list[tuple[base.Effect, base.Values]] = []
    bare = run_of(frame)
    timing = bare.timing
    for effect_id, given in effects:
        kind = base.effect(effect_id)
        values = shared.get(effect_id) or kind.draw(given, rng)
        if kind.scope_in([bare]) == "session":
            shared[effect_id] = values
        drawn.append((kind, values))
        timing = kind.set(timing, values) if isinstance(kind, TimingEffect) else timing
    seen = bare.timed(timing)  # all other effects change the rate that is read
    rate_dps = np.zeros((n, 3))
    rate_dps[:, axis] = seen.rate_dps
    y_dps = (1 + np.array(truth.scale)) * rate_dps + np.array(truth.bias_dps)
    faults: list[tuple[Fault, base.Values]] = []
    for kind, values in drawn:
        fault = kind.fault_of(values)
        if fault is not None:
            faults.append((fault, values))
            truth.effects.append({"id": kind.id, "axis": "all", **values})
            continue
        axes = kind.axes(seen)
        for on in range(3) if several and axes == (axis,) else axes:
            term_dps = kind.term(seen, on, values)
            y_dps[:, on] += 0.0 if isinstance(kind, TimingEffect) else term_dps
            if on == axis or np.any(term_dps):
                truth.effects.append({"id": kind.id, "axis": AXES[on], **values})
    y_dps += rng.normal(0.0, WHITE_SD_DPS, (n, 3))
    y_dps += sensor.drift.samples(n, 1 / RATE_HZ, 3, rng)
    for fault, values in faults:
        y_dps = fault.distort(bare, y_dps, values, rng)
    y_dps = np.clip(np.round(y_dps / LSB_DPS), -32768, 32767) * LSB_DPS + 0.0  # no minus zero
    return run_of(frame.with_columns(pl.Series(f"g{a}_dps", np.round(y_dps[:, i], 6)) for i, a in enumerate(AXES)))


def _surroundings(planned: Planned, day: Day, rng: np.random.Generator) -> pl.DataFrame:
    """The table of a run with rates of zero: time, acceleration, temperature, and the encoder of a swinging table."""
    n = round(planned.seconds * RATE_HZ)
    t_s = np.round(np.arange(n) / RATE_HZ, 6)
    sign = 1.0 if planned.face == "up" else -1.0
    gravity = np.zeros((n, 3))
    gravity[:, AXES.index(planned.axis)] = sign
    shaken = gravity + rng.normal(0, planned.shake_g, (n, 3)) if planned.shake_g else gravity
    acc_g = np.round((shaken + rng.normal(0, 0.0012, (n, 3))) / 6.1e-5) * 6.1e-5
    temp_c = np.round((day.on(planned.power_on_s + t_s, planned.air_c) + rng.normal(0, 0.02, n) - 25.0) * 256.0) / 256.0 + 25.0
    still = {f"g{a}_dps": np.zeros(n) for a in AXES}
    frame = pl.DataFrame({"t_s": t_s, **still, **{f"a{a}_g": acc_g[:, i] for i, a in enumerate(AXES)}, "temp_c": temp_c})
    return frame if planned.swing is None else frame.with_columns(**swinging(t_s, planned.swing, sign))


def swinging(t_s: Array, swing: Swing, face_sign: float) -> dict[str, pl.Series]:
    """The encoder of a swinging table: ``rate_ref_dps`` in the sensor's sign and ``table_angle_deg``, [n] each."""
    sweep_hz_s = (swing.to_hz - swing.from_hz) / t_s[-1]
    rate_dps = swing.peak_dps * np.sin(2 * np.pi * (swing.from_hz + sweep_hz_s * t_s / 2) * t_s)
    steps = np.diff(t_s) * (rate_dps[1:] + rate_dps[:-1]) / 2
    angle_deg = np.concatenate([[0.0], np.cumsum(steps)])
    return {
        "rate_ref_dps": pl.Series(np.round(face_sign * rate_dps, 6) + 0.0),
        "table_angle_deg": pl.Series(np.round(angle_deg, 4) + 0.0),
    }


def paper_windows(
    n_scenarios: int, seed: int, seconds: float = 6.0, *, effects: float = 1.0, phase_deg: tuple[float, float] | None = None
) -> dict[str, Any]:
    """The first seconds of many scenarios of the campaign ``table2``, z axis, computed fast by the same equations.

    Ripple and transient are ``effects`` times the campaign's; the ripple's phase is drawn from ``phase_deg``, by default from a
    whole turn.
    Returns ``up`` and ``down``, float32 [n, round(seconds·145)], measured minus true rate (deg/s), the true rates, and the
    truth ``scale`` [n] and ``bias_dps`` [n].
    """
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE_HZ)
    t_s = np.round(np.arange(n) / RATE_HZ, 6)
    scale = rng.normal(SCALE_MEAN, SCALE_SD, n_scenarios)
    bias = rng.normal(BIAS_MEAN_DPS, BIAS_SD_DPS, n_scenarios) + rng.normal(0.0, TURN_ON_SD_DPS, n_scenarios)
    angle = np.deg2rad(TABLE_RATE_DPS * t_s)
    faces = {}
    for name, w_dps in (("up", TABLE_RATE_DPS), ("down", -TABLE_RATE_DPS)):
        ab = effects * rng.normal(0.0, RIPPLE_SD_DPS / TABLE_RATE_DPS, (2, n_scenarios, 1))
        if phase_deg is not None:
            phase = np.deg2rad(rng.uniform(*phase_deg, (n_scenarios, 1)))
            ab = np.hypot(*ab) * np.stack([np.cos(phase), -np.sin(phase)])
        size = effects * rng.normal(0.0, TRANSIENT_SD_DPS / TABLE_RATE_DPS, (n_scenarios, 1))
        tau_s = np.exp(rng.uniform(*LOG_TAU, (n_scenarios, 1)))
        y = (1 + scale[:, None]) * w_dps + bias[:, None]
        y = y + w_dps * (ab[0] * np.cos(angle) + ab[1] * np.sin(angle)) - w_dps * size * np.exp(-t_s / tau_s)
        y += rng.normal(0.0, WHITE_SD_DPS, y.shape) + ou_noise(n, 1 / RATE_HZ, OU_SD_DPS, OU_TAU_S, n_scenarios, rng).T
        y = np.clip(np.round(y / LSB_DPS), -32768, 32767) * LSB_DPS
        faces[name] = (y - w_dps).astype(np.float32)
    return {
        **faces, "w_up_dps": TABLE_RATE_DPS, "w_down_dps": -TABLE_RATE_DPS, "scale": scale, "bias_dps": bias,
        "rate_hz": RATE_HZ,
    }  # fmt: skip
