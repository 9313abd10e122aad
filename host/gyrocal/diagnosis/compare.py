"""The model held against the measurements: how much error is left beyond the noise, and where it shows.

``rms`` is of held-out samples. ``floor`` is what noise alone would leave: white noise and quantisation as the scatter within a
tenth of a second shows them (lines taken out), drift, and the turn-on bias, which no model can know beforehand. ``excess`` is
what is left over: ``sqrt(max(0, rms^2 - floor^2))``; it is what a missing effect adds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal import plausibility
from gyrocal.diagnosis.probes import Finding, beside, probe, slow_probes, too_much_power
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.files import replacing
from gyrocal.inference import heldout
from gyrocal.inference.blocks import residual_dps
from gyrocal.inference.fit import LEAST_WHITE_DPS, Fit, fit
from gyrocal.inference.heldout import Prediction
from gyrocal.noise.spectrum import Spectrum, spectrum
from gyrocal.recording.outliers import outliers
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.threads import each, one_thread
from gyrocal.warning import Warning

ALARM = 0.01
"""Chance of crying misfit on a session that holds none, all tests together (the contract allows 0.02)."""

SHEPPARD = 1 / 12
"""Variance, counts^2, that rounding to whole counts adds."""

LEAST_BLOCKS = 40
"""With fewer tenths of a second there is nothing to judge a model by."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Level:
    """rms of held-out residuals, what noise alone leaves of it, and the excess; deg/s. None where nothing can be held out."""

    rms_dps: float | None
    floor_dps: float
    excess_dps: float | None

    def to_json(self) -> dict[str, Any]:
        return {"rms_dps": self.rms_dps, "floor_dps": self.floor_dps, "excess_dps": self.excess_dps}


@dataclass(frozen=True)
class Comparison:
    """What ``compare`` found. ``fit`` holds the model fitted on all data."""

    fit: Fit
    pooled: Level
    per_axis: dict[str, Level]
    where: list[Finding]
    held_out: str
    """What was left out in turn: ``day``, ``scenario``, ``run``, ``time`` or, where nothing could be, ``none``."""
    spectra: dict[str, Spectrum] = field(repr=False)
    white_power: dict[str, float] = field(repr=False)
    """Mean square of white noise and quantisation, dps^2, by axis: the floor's fast part."""

    note: str = ""
    """What a person should know of how it came about."""
    warnings: list[Warning] = field(default_factory=list)

    @property
    def floors(self) -> dict[str, float]:
        """The floor of each axis, deg/s."""
        return {axis: level.floor_dps for axis, level in self.per_axis.items()}

    @property
    def judged(self) -> list[str]:
        """The axes that can be judged: no blocking warning stands against them."""
        blocked = plausibility.blocked(self.warnings, AXES)
        return [axis for axis in self.per_axis if axis not in blocked]

    @property
    def implausible(self) -> bool:
        """Does a blocking warning stand against the session's own axis?"""
        return any(w.blocks(self.fit.session.axis) for w in self.warnings)

    @property
    def verdict(self) -> str:
        if self.implausible:
            return "implausible"
        return "misfit" if self.where else "adequate"

    def to_json(self) -> dict[str, Any]:
        return {
            "model": self.fit.model.ids,
            **self.pooled.to_json(),
            "per_axis": {axis: level.to_json() for axis, level in self.per_axis.items()},
            "verdict": self.verdict,
            "where": [
                {"axis": f.axis, "against": f.against, "strength": round(f.strength, 3), "note": f.note}
                for f in self.where
            ],
            "held_out": self.held_out,
            "note": self.note,
            "parameters": [
                {"effect": line.id, "axis": line.axis, "name": name, "value": value, "se": line.se.get(name)}
                for line in self.fit.model.lines()
                for name, value in line.values.items()
            ],
            "warnings": [w.to_json() for w in self.warnings],
        }


@one_thread
def compare(
    session: Session, model: Model | str | Path | None = None, *, floor_from: dict[str, float] | None = None,
    only_day: int | None = None,
    progress: Progress | None = None,
) -> Comparison:  # fmt: skip
    """Fit a model to a session, judge it on held-out data, and find where it fails.

    ``floor_from``: the richer model's floors by axis (``Comparison.floors``), for both when two models are compared.
    """
    opened = Model.open(model)
    warnings = plausibility.check(session, opened)
    fitted = fit(session, opened, progress=progress)
    if not fitted.axes:
        raise InputError("the model has no term on any axis; give it scale and bias at least")
    folds = heldout.folds(fitted, only_day)
    if only_day is not None and not folds:
        days = ", ".join(map(str, session.days)) or "none"
        raise InputError(f"--heldout-day {only_day}: no such day, or it cannot be left out; the session's days: {days}")
    if progress is not None:
        progress("judging on held-out data")

    def measured(axis: str) -> tuple[Array, Spectrum, float]:
        squares = squares_of(heldout.predictions(fitted.on(axis), folds))
        residuals = _residuals(fitted, axis)
        lines = spectrum(list(residuals.values()), session.sample_rate_hz)
        return squares, lines, _white_power(fitted, axis, residuals, lines)

    found = dict(zip(fitted.axes, each(measured, fitted.axes, session.rows), strict=True))
    squares = np.sum([of for of, _, _ in found.values()], axis=0)
    spectra = {axis: lines for axis, (_, lines, _) in found.items()}
    white = {axis: power for axis, (_, _, power) in found.items()}
    blocked = plausibility.blocked(warnings, AXES)
    where = find_misfit(session, fitted, spectra, [a for a in fitted.axes if a not in blocked], progress)
    floors = floor_from or {axis: _floor(fitted, axis, where, white[axis]) for axis in fitted.axes}
    per_axis = {axis: _level(squares[[AXES.index(axis)]], floors[axis]) for axis in fitted.axes}
    pooled = _level(squares, float(np.sqrt(np.mean([f**2 for f in floors.values()]))))
    return Comparison(fitted, pooled, per_axis, where, _kind(session, folds), spectra, white, warnings=warnings)


def _floor(fitted: Fit, axis: str, where: list[Finding], white_power: float) -> float:
    """The rms that white noise, quantisation, drift and turn-on bias predict, deg/s.

    Where probes found something, drift and turn-on bias are those that are left beside it: else they would swallow it.
    """
    found = fitted.axes[axis]
    kinds = [f.kind for f in where if f.axis == axis and f.kind is not None]
    if kinds:
        found = beside(found, axis, kinds)
    return float(np.sqrt(white_power + found.slow_power))


def _residuals(fitted: Fit, axis: str) -> dict[int, Array]:
    """Residuals in sample of each run [n], deg/s, single readings that stand out brought back."""
    out = {}
    for p in heldout.fitted(fitted.on(axis)):
        residual = p.residual_dps
        rows, apart_dps = outliers(residual, p.run.step_dps[p.axis])
        residual[rows] -= apart_dps
        out[p.run.index] = residual
    return out


def _white_power(fitted: Fit, axis: str, by_run: dict[int, Array], spectrum: Spectrum) -> float:
    """Mean square of one sample's noise, dps^2: the scatter of residuals within blocks, lines taken out."""
    total, count = 0.0, 0
    for b in fitted.blocks:
        if b.run.index not in by_run or b.within_n == 0:
            continue
        grouped = by_run[b.run.index][b.start[:, None] + np.arange(int(b.n[0]))]
        total += float(((grouped - grouped.mean(axis=1, keepdims=True)) ** 2).sum())
        count += b.within_n
    if count < 10:  # a sample a block: the fit's own white level
        return fitted.axes[axis].noise.white_sd_dps ** 2
    return max(total / count - spectrum.line_power(1e-3), LEAST_WHITE_DPS**2)


def squares_of(held: Iterable[Prediction]) -> Array:
    """Of each axis the sum of squared residuals, dps^2, and the number of samples, shape [3, 2]."""
    out = np.zeros((len(AXES), 2))
    for p in held:
        out[p.axis] += float(np.sum(p.residual_dps**2)), p.modelled_dps.size
    return out


def _level(squares: Array, floor: float) -> Level:
    total, samples = squares.sum(axis=0)
    if samples == 0:
        return Level(None, floor, None)
    rms = float(np.sqrt(total / samples))
    return Level(rms, floor, float(np.sqrt(max(0.0, rms**2 - floor**2))))


def _kind(session: Session, folds: list[heldout.Fold]) -> str:
    if not folds:
        return "none"
    if folds[0].time is not None:
        return "time"
    labels = {f.label for f in folds}
    if labels <= {str(r.day) for r in session.runs}:
        return "day"
    return "scenario" if labels <= set(session.scenarios) else "run"


def find_misfit(
    session: Session, fitted: Fit, spectra: dict[str, Spectrum], axes: Sequence[str], progress: Progress | None = None,
) -> list[Finding]:  # fmt: skip
    """Every probe on each of the ``axes``; those that noise explains with less than its share of ``ALARM``, strongest first."""
    if sum(b.t_s.size for b in fitted.blocks) < LEAST_BLOCKS:
        return []
    probes = {axis: slow_probes(session, AXES.index(axis)) for axis in axes}
    tests = sum(len(kinds) for on_axis in probes.values() for _, kinds in on_axis)
    share = ALARM / max(1, tests + 4 * len(axes))

    def on(axis: str) -> list[Finding]:
        found = []
        for against, kind in ((against, kind) for against, kinds in probes[axis] for kind in kinds):
            if progress is not None:
                progress(f"looking at {axis} against {against.replace('_', ' ')}")
            finding = probe(fitted.axes[axis], axis, against, kind, share)
            if finding is not None and finding.chance < share:
                found.append(finding)
        return found + _beyond_noise(session, fitted, axis, spectra[axis], share)

    return sorted(chain.from_iterable(each(on, axes, session.rows)), key=lambda f: -f.strength)


def _beyond_noise(session: Session, fitted: Fit, axis: str, lines: Spectrum, share: float) -> list[Finding]:
    """What no slow probe sees: lines and bumps of the spectrum, power beyond noise, faults of the reading."""
    found: list[Finding | None] = []
    peak = lines.peak()
    if peak is not None and peak[2] < share:
        frequency_hz, amplitude_dps, chance = peak
        strength = float(
            np.sqrt(lines.segments * lines.samples / 2)
            * amplitude_dps
            / np.sqrt(np.median(lines.level) * session.sample_rate_hz / 2)
        )
        note = f"a line of {amplitude_dps * 1e3:.3g} mdps at {frequency_hz:.4g} Hz"
        found.append(Finding(axis, "frequency", strength, chance, amplitude_dps, note))
    bump = lines.bump()
    if bump is not None and bump[4] < share:
        note = f"{bump[2] * 1e3:.3g} mdps that wander between {bump[0]:.3g} and {bump[1]:.3g} Hz"
        found.append(Finding(axis, "frequency", bump[3], bump[4], bump[2], note))
    found.append(too_much_power(fitted.axes[axis], axis, share))
    known = fitted.model.faults(axis)
    found.append(reading_fault(session, axis, share, max((f.step_dps(values) for f, values in known), default=0.0)))
    if not any(f.throws_out(values) for f, values in known):
        found.append(single_readings(session, axis))
    return [finding for finding in found if finding is not None]


def reading_fault(session: Session, axis: str, alarm: float, known_step_dps: float = 0.0) -> Finding | None:
    """Bits of the raw code that noise should toggle and that do not: a byte put together wrongly, a stuck bit.

    ``known_step_dps``: the step that the model knows of, below which nothing is looked for.
    """
    from scipy.stats import norm

    if session.lsb_dps is None:
        return None
    readings = [r.gyro_dps[:, AXES.index(axis)] for r in session.runs]
    codes = np.concatenate([np.rint(g / session.lsb_dps).astype(np.int64) for g in readings])
    noise = float(np.sqrt(np.mean(np.concatenate([np.diff(g) for g in readings]) ** 2) / 2)) / session.lsb_dps
    mean_codes = np.array([int(np.rint(np.mean(g) / session.lsb_dps)) for g in readings])
    worst: Finding | None = None
    for bit in range(16):
        if 2**bit * session.lsb_dps < 0.75 * known_step_dps:
            continue
        ones = float(np.mean((codes >> bit) & 1))
        if 2**bit <= noise:  # noise alone toggles it
            z = abs(ones - 0.5) * 2 * np.sqrt(codes.size) / 2**bit
            chance = min(1.0, 2 * float(norm.sf(z)) * 16) if abs(ones - 0.5) > 0.25 else 1.0
        else:  # runs at different rates should, as a coin falls
            places = np.unique(mean_codes >> bit).size
            stuck = ones in (0.0, 1.0)
            chance = min(1.0, 16 * min(0.5 ** (places - 1), _never(readings, session.lsb_dps, bit, ones))) if stuck else 1.0
            z = float(norm.isf(max(chance, 1e-300)))
        if chance < alarm and (worst is None or z > worst.strength):
            note = f"bit {bit} of the reading is {'1' if ones > 0.5 else '0'} in {max(ones, 1 - ones):.0%} of the samples"
            worst = Finding(axis, "reading", float(z), chance, 2**bit * session.lsb_dps, note)
    return worst


def _never(readings: list[Array], lsb_dps: float, bit: int, state: float) -> float:
    """The chance that a bit of the code keeps its state in all readings, by the noise about each run's mean.

    Of noise below a count the codes do not tell enough: such a run says nothing.
    """
    from scipy.stats import norm

    log_chance = 0.0
    for g in readings:
        mean, variance = float(g.mean()) / lsb_dps, float(np.mean(np.diff(g) ** 2)) / 2 / lsb_dps**2 - SHEPPARD
        if variance < 1.0:
            continue
        sd = float(np.sqrt(variance))
        cells = np.arange(np.floor((mean - 6 * sd) / 2**bit), np.ceil((mean + 6 * sd) / 2**bit) + 1)
        edges = norm.cdf((np.append(cells, cells[-1] + 1) * 2**bit - 0.5 - mean) / sd)
        kept = float(np.diff(edges)[cells.astype(np.int64) % 2 == int(state)].sum())
        log_chance += g.size * float(np.log(min(1.0, max(kept, 1e-300))))
    return float(np.exp(max(log_chance, -700.0)))


def single_readings(session: Session, axis: str) -> Finding | None:
    """Single readings that stand far out of their neighbours, where they add a hundredth to the noise's power."""
    i = AXES.index(axis)
    steady = [r for r in session.runs if not r.rate_is_mean]
    if not steady:
        return None
    readings = [residual_dps(r)[:, i] for r in steady]
    apart = np.concatenate([outliers(y, r.step_dps[i])[1] for y, r in zip(readings, steady, strict=True)])
    white = np.median(np.concatenate([np.abs(np.diff(y)) for y in readings])) / (0.6745 * np.sqrt(2))
    samples = sum(y.size for y in readings)
    if apart.size < 2 or float(apart @ apart) < 0.01 * white**2 * samples:
        return None
    size_dps = float(np.sqrt(np.mean(apart**2)))
    note = f"{apart.size} single readings stand out by {size_dps:.3g} dps"
    if session.lsb_dps is not None and np.mean(np.abs(np.abs(apart) - 256 * session.lsb_dps) < 6 * white) > 0.9:
        note += ", 256 counts: the two bytes of a reading are not of one sample"
    strength = float(np.sqrt(apart @ apart) / max(white, LEAST_WHITE_DPS))
    return Finding(axis, "reading", strength, 0.0, size_dps, note)


def residual_table(comparison: Comparison) -> pl.DataFrame:
    """Held-out predictions (in sample where nothing can be held out): file, t_s, axis, measured_dps, modelled_dps."""
    fitted = comparison.fit
    folds = heldout.folds(fitted) if comparison.held_out != "none" else []
    source = heldout.predictions(fitted, folds) if folds else heldout.fitted(fitted)
    parts = [
        pl.DataFrame({
            "file": pl.repeat(p.run.file, p.modelled_dps.size, eager=True),
            "t_s": p.run.t_s[p.rows],
            "axis": pl.repeat(AXES[p.axis], p.modelled_dps.size, eager=True),
            "measured_dps": p.measured_dps,
            "modelled_dps": p.modelled_dps,
        })
        for p in source
    ]  # fmt: skip
    return pl.concat(parts)


def write_residuals(comparison: Comparison, path: Path) -> None:
    """:func:`residual_table` as Parquet or CSV, by the name's ending, whole or not at all."""
    frame = residual_table(comparison)
    try:
        with replacing(path) as partial:
            frame.write_parquet(partial) if path.suffix == ".parquet" else frame.write_csv(partial)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
