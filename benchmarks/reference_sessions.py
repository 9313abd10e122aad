"""Sessions with each kind of reference and a known truth, whose motion and frames share nothing with the library.

A kind is a function of a seed's random numbers that returns a session and what is planted in it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from gyrocal.recording.header import Reference
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import read_recording
from gyrocal.recording.second_file import SecondFile
from gyrocal.recording.session import Run, Session

Array = NDArray[Any]
AXES = "xyz"
SINES = 12
FINER = 8
"""Steps of an orientation's integration from sample to sample."""


@dataclass(frozen=True)
class Planted:
    """What a session with a reference about three axes is made with.

    ``rotation_deg`` is the alignment, ``matrix`` the symmetric scale and misalignment.
    """

    rotation_deg: Array
    offset_s: float
    drift: float
    matrix: Array
    bias_dps: Array
    motion_dps: float
    noise_dps: float
    ref_noise_dps: float
    rate_hz: float
    seconds: float = 60.0

    @staticmethod
    def draw(rng: np.random.Generator) -> Planted:
        axis = rng.normal(size=3)
        across = rng.normal(0.0, 0.004, 3)
        matrix = np.eye(3) + np.diag(rng.normal(0.0, 0.01, 3))
        for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
            matrix[i, j] = matrix[j, i] = across[k]
        return Planted(
            axis / np.linalg.norm(axis) * rng.uniform(0, 180), rng.uniform(-2, 2), rng.normal(0, 3e-5), matrix,
            rng.normal(0, 1, 3), rng.choice([20.0, 60.0, 150.0]), rng.choice([0.02, 0.05, 0.1]), rng.choice([0.02, 0.05, 0.2]),
            rng.choice([50.0, 100.0, 200.0]),
        )  # fmt: skip


def turned(rotation_deg: Array, rates_dps: Array) -> Array:
    """Rates [n, 3] rotated by a rotation vector (Rodrigues), written out so that it shares nothing with the library."""
    angle = np.deg2rad(np.linalg.norm(rotation_deg))
    k = rotation_deg / max(float(np.linalg.norm(rotation_deg)), 1e-300)
    along = np.outer(rates_dps @ k, k)
    across = np.cross(np.broadcast_to(k, rates_dps.shape), rates_dps)
    return np.asarray(along + (rates_dps - along) * np.cos(angle) + across * np.sin(angle))


def waves(rng: np.random.Generator, size_dps: float, columns: int) -> Callable[[Array], Array]:
    """A smooth random motion up to 2 Hz: rates [n, columns], deg/s, at times [n], s."""
    f_hz, phase = rng.uniform(0.1, 2.0, (SINES, columns)), rng.uniform(0, 2 * np.pi, (SINES, columns))
    size = rng.normal(0, size_dps / np.sqrt(SINES / 2), (SINES, columns))

    def motion(at_s: Array) -> Array:
        parts = (a * np.sin(2 * np.pi * f * at_s[:, None] + p) for a, f, p in zip(size, f_hz, phase, strict=True))
        return np.asarray(sum(parts))

    return motion


def session(planted: Planted, rng: np.random.Generator, orientation_deg: float | None = None) -> Session:
    """A session of one run with ``clock = "own"`` and the reference's rates about three axes.

    With ``orientation_deg``, the noise of an orientation about each axis in deg, the reference gives orientations instead.
    """
    t_s = np.arange(int(planted.seconds * planted.rate_hz)) / planted.rate_hz
    motion = waves(rng, planted.motion_dps, 3)
    true = turned(planted.rotation_deg, motion((1 + planted.drift) * t_s - planted.offset_s))
    gyro = true @ planted.matrix.T + planted.bias_dps + rng.normal(0, planted.noise_dps, true.shape)
    if orientation_deg is None:
        ref = motion(t_s) + rng.normal(0, planted.ref_noise_dps, true.shape)
        columns = {f"ref_{a}_dps": ref[:, i] for i, a in enumerate("xyz")}
    else:
        noise = exponential(np.deg2rad(rng.normal(0, orientation_deg, true.shape)))
        q = product(orientations(motion, t_s), noise)
        columns = {f"ref_q{a}": q[:, i] for i, a in enumerate("wxyz")}
    return of_runs([run_of(t_s, gyro, reference=Reference(clock="own"), **columns)])


def run_of(t_s: Array, gyro: Array, *, cycle: int = 0, reference: Reference | None = None, **more: Any) -> Run:
    """A run of readings [n, 3]; ``more`` are the columns beside them, and ``axis``, ``turn_deg`` and ``table_rate_dps``."""
    facts = {key: more.pop(key, None) for key in ("axis", "turn_deg", "table_rate_dps")}
    frame = pl.DataFrame({"t_s": t_s, **{f"g{a}_dps": gyro[:, i] for i, a in enumerate("xyz")}, **more})
    return Run(
        0, "", f"s{cycle:03d}", "up", facts["axis"] or "z", facts["table_rate_dps"], facts["turn_deg"], None, None,
        round((t_s.size - 1) / (t_s[-1] - t_s[0]), 6), frame=frame, reference=reference or Reference(),
    )  # fmt: skip


def of_runs(runs: list[Run]) -> Session:
    """A session of these runs, numbered in their order."""
    numbered = (replace(run, index=i, file=f"{i:03d}_up.csv") for i, run in enumerate(runs))
    return Session(runs[0].sample_rate_hz, tuple(numbered), reference=runs[0].reference)


def exponential(turn_rad: Array) -> Array:
    """The unit quaternions [n, 4] of rotation vectors [n, 3], rad."""
    half = np.linalg.norm(turn_rad, axis=1, keepdims=True) / 2
    return np.hstack([np.cos(half), turn_rad / 2 * np.sinc(half / np.pi)])


def product(a: Array, b: Array) -> Array:
    """The products [n, 4] of two rows of quaternions."""
    v, w = a[:, 1:], b[:, 1:]
    scalar = a[:, :1] * b[:, :1] - np.sum(v * w, axis=1, keepdims=True)
    return np.hstack([scalar, a[:, :1] * w + b[:, :1] * v + np.cross(v, w)])


def orientations(motion: Callable[[Array], Array], t_s: Array) -> Array:
    """The orientations [n, 4] (body to fixed) of a body with these rates, at times [n], in ``FINER`` steps a sample."""
    step_s = (t_s[-1] - t_s[0]) / (t_s.size - 1) / FINER
    between = np.tile([1.0, 0.0, 0.0, 0.0], (t_s.size - 1, 1))
    for k in range(FINER):
        between = product(between, exponential(np.deg2rad(motion(t_s[:-1] + (k + 0.5) * step_s)) * step_s))
    out = [np.array([1.0, 0, 0, 0])]
    for step in between:
        out.append(product(out[-1][None], step[None])[0])
    return np.array(out)


Truth = dict[tuple[str, str | None, str], float]


@dataclass(frozen=True)
class Made:
    """A session, what is planted by (effect, axis, parameter), the effects that the model is given, and the one it lacks."""

    session: Session
    truth: Truth
    known: tuple[tuple[str, str], ...] = ()
    effect: tuple[str, str] | None = None


def _three_axes(rng: np.random.Generator, orientation_deg: float | None) -> Made:
    p = Planted.draw(rng)
    truth: Truth = {("time_offset", None, "offset_s"): p.offset_s}
    truth[("clock_drift", None, "e")] = p.drift
    truth |= {("alignment", None, f"r{a}_deg"): float(p.rotation_deg[i]) for i, a in enumerate(AXES)}
    for i, a in enumerate(AXES):
        truth[("scale", a, "scale")] = p.matrix[i, i] - 1
        for j, b in enumerate(AXES[i + 1 :], i + 1):
            truth[("misalignment", a, f"m_{b}")] = p.matrix[i, j]
    return Made(session(p, rng, orientation_deg), truth, tuple(("misalignment", a) for a in AXES))


def rates(rng: np.random.Generator) -> Made:
    """Rates about three axes."""
    return _three_axes(rng, None)


def quaternions(rng: np.random.Generator) -> Made:
    """Orientations, as motion capture gives them."""
    return _three_axes(rng, rng.choice([0.005, 0.02, 0.05]))


def second_file(rng: np.random.Generator) -> Made:
    """A reference about one axis that another logger wrote, at its own rate and by its own clock, added by the importer."""
    motion, scale, bias = waves(rng, rng.choice([20.0, 60.0]), 1), rng.normal(0, 0.01), rng.normal(0, 1)
    offset_s, noise_dps = rng.uniform(-1.5, 1.5), rng.choice([0.02, 0.05, 0.1])
    t_s = np.arange(6000) / 100
    u_s = np.arange(int(62 * (ref_hz := rng.choice([40.0, 73.0, 250.0])))) / ref_hz - 1
    gyro = rng.normal(0, noise_dps, (t_s.size, 3))
    gyro[:, 2] += (1 + scale) * motion(t_s - offset_s)[:, 0] + bias
    ref = motion(u_s)[:, 0] + rng.normal(0, rng.choice([0.02, 0.1]), u_s.size)
    with tempfile.TemporaryDirectory() as folder:
        ours, theirs = Path(folder) / "ours.csv", Path(folder) / "theirs.csv"
        pl.DataFrame({"t_s": t_s, **{f"g{a}_dps": gyro[:, i] for i, a in enumerate(AXES)}}).write_csv(ours)
        pl.DataFrame({"u": u_s, "w": ref}).write_csv(theirs)
        second = SecondFile(theirs, ["t_s=u", "rate_ref_dps=w"], "own")
        found = read_recording(ours, Options(second=second)).session
    truth: Truth = {("scale", "z", "scale"): scale, ("time_offset", None, "offset_s"): offset_s}
    return Made(found, truth)


@dataclass(frozen=True)
class Swing:
    """One power cycle on an encoder's shaft, which is horizontal: the true angle and rate, acceleration and temperature."""

    t_s: Array
    angle_deg: Array
    rate_dps: Array
    temp_c: Array
    acc_g: Array = field(init=False)

    def __post_init__(self) -> None:
        turn = np.deg2rad(self.angle_deg)
        object.__setattr__(self, "acc_g", np.column_stack([np.sin(turn), np.cos(turn), 0 * turn]))

    @staticmethod
    def draw(rng: np.random.Generator, cycle: int) -> Swing:
        t_s = np.arange(2000) / 100
        f_hz, size_deg, phase = rng.uniform(0.05, 0.5, 4), rng.normal(0, 30, 4), rng.uniform(0, 2 * np.pi, 4)
        turn = 2 * np.pi * f_hz * t_s[:, None] + phase
        rate_dps = np.sum(size_deg * 2 * np.pi * f_hz * np.cos(turn), axis=1)
        return Swing(t_s, np.sum(size_deg * np.sin(turn), axis=1), rate_dps, 25 + 5 * np.sin(t_s / 8 + cycle))


EFFECTS: dict[str, tuple[str, str, float, Callable[[Swing], Array]]] = {
    "bias_temperature": ("z", "k1_dps_per_c", 0.02, lambda s: s.temp_c - 25),
    "scale_temperature": ("z", "k_per_c", 4e-4, lambda s: (s.temp_c - 25) * s.rate_dps),
    "scale_nonlinearity": ("z", "k3", 2e-7, lambda s: s.rate_dps**3),
    "scale_asymmetry": ("z", "k", 2e-3, lambda s: np.abs(s.rate_dps)),
    "table_ripple": ("z", "amplitude_1", 4e-3, lambda s: s.rate_dps * np.cos(np.deg2rad(s.angle_deg) + 0.6)),
    "g_sensitivity": ("z", "gx_dps_per_g", 0.05, lambda s: s.acc_g[:, 0]),
    "misalignment": ("x", "m_z", 0.01, lambda s: s.rate_dps),
}
"""Effects that an encoder's angle shows: the axis that reads it, its parameter, its size, and its term."""


def encoder(steps_deg: tuple[float, ...], planted: bool, scale_sd: float = 0.0) -> Callable[[np.random.Generator], Made]:
    """A swing in four power cycles beside an encoder with steps of one of these sizes, with or without an effect.

    ``scale_sd`` is the spread of the scale over power cycles.
    """

    def kind(rng: np.random.Generator) -> Made:
        step_deg, scale, bias = rng.choice(steps_deg), rng.normal(0, 0.01), rng.normal(0, 1)
        effect = rng.choice(sorted(EFFECTS)) if planted else None
        truth: Truth = {("scale", "z", "scale"): scale}
        runs = []
        for cycle in range(4):
            s = Swing.draw(rng, cycle)
            gyro = rng.normal(0, 0.05, (s.t_s.size, 3))
            of_cycle = rng.normal(scale, scale_sd) if scale_sd else scale
            gyro[:, 2] += (1 + of_cycle) * s.rate_dps + bias + rng.normal(0, 0.01)
            if effect:
                axis, name, size, term = EFFECTS[effect]
                gyro[:, AXES.index(axis)] += size * term(s)
                truth[(effect, axis, name)] = size
            angle_deg = np.round(s.angle_deg / step_deg) * step_deg
            acc = {f"a{a}_g": s.acc_g[:, i] + rng.normal(0, 1e-3, s.t_s.size) for i, a in enumerate(AXES)}
            runs.append(run_of(s.t_s, gyro, cycle=cycle, ref_angle_deg=angle_deg, temp_c=s.temp_c, **acc))
        return Made(of_runs(runs), truth, effect=(effect, EFFECTS[effect][0]) if effect else None)

    return kind


def turns(rng: np.random.Generator) -> Made:
    """Turns of a known angle by hand, both ways about each axis, and rests, in three power cycles."""
    t_s, scale = np.arange(1200) / 100, rng.normal(0, 0.01, 3)
    offset_dps = rng.normal(0, 1, 3) + rng.normal(0, 0.01, (3, 3))

    def run(cycle: int, axis: int, sign: int) -> Run:
        hand = np.sin(np.pi * (t_s - 2) / 8) ** 2 * rng.uniform(0.8, 1.2) + 0.2 * np.sin(np.pi * (t_s - 2) / 2)
        rate_dps = np.where((t_s > 2) & (t_s < 10), sign * 90.0 * hand, 0.0)
        rate_dps *= sign * 360.0 / (np.sum(rate_dps) / 100) if sign else 0.0
        gyro = rng.normal(0, 0.05, (t_s.size, 3)) + offset_dps[cycle]
        gyro[:, axis] += (1 + scale[axis]) * rate_dps
        known = {"turn_deg": 360.0 * sign} if sign else {"table_rate_dps": 0.0}
        return run_of(t_s, gyro, cycle=cycle, axis=AXES[axis], **known)

    runs = [run(cycle, 2, 0) for cycle in range(3)]
    runs += [run(k % 3, axis, sign) for k, (axis, sign) in enumerate((a, s) for a in range(3) for s in (1, -1))]
    return Made(of_runs(runs), {("scale", a, "scale"): float(scale[i]) for i, a in enumerate(AXES)})
