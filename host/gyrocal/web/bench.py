"""The functions of the worker process: they call the engine and prepare its results for the page."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.api import Candidate, Comparison, Diagnosis, InputError, Model, Session, check, compare, diagnose, simulate
from gyrocal.api import add as add_effect
from gyrocal.calibration.calibrate import DEFAULT_SECONDS, Estimate, calibrate, pairs
from gyrocal.core import firmware_project
from gyrocal.core.verify import verify
from gyrocal.diagnosis.keep import keep
from gyrocal.effects import base
from gyrocal.inference import heldout
from gyrocal.inference.blocks import Blocks, known_dps
from gyrocal.noise.allan import allan_deviation, model_deviation
from gyrocal.present import report
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.web import by_gravity, intake
from gyrocal.web.against import panels
from gyrocal.web.decimate import Pyramid, thinned
from gyrocal.web.report import page
from gyrocal.web.views import (
    Bar,
    CalibrationView,
    Card,
    Curve,
    DiagnosisView,
    ExportView,
    ModelView,
    RunView,
    SessionView,
    Signature,
)

Progress = Callable[[str], None]

CURVE_POINTS = 1500
SIGNATURE_DOTS = 140


class Bench:
    """Holds the current session and its last comparison. Results that are too large to send are written to ``scratch``."""

    def __init__(self, scratch: Path) -> None:
        self._scratch = scratch
        self._session: Session | None = None
        self._compared: Comparison | None = None
        self._number = 0

    # jobs.Jobs.run calls these methods by name. Each begins by reading the session, because the worker may be a new one.

    def open(self, folder: Path, progress: Progress) -> SessionView:
        """Read and check a session, and write its traces."""
        progress("reading the recordings")
        session = Session.open(folder)
        self._session, self._compared = session, None
        progress("preparing the pictures")
        traces = self._room()
        firsts = np.cumsum([0, *(len(run) for run in session.runs)]).tolist()
        t_s = np.lib.format.open_memmap(traces / "t_s.npy", "w+", np.float64, (firsts[-1],))

        def fill(samples: Any) -> None:
            for run, first in zip(session.runs, firsts, strict=False):
                rows = slice(first, first + len(run))
                t_s[rows] = run.t_s - run.t_s[0]
                for axis in range(3):
                    samples[axis, rows] = run.gyro_dps[:, axis] - known_dps(run, axis)

        Pyramid.write(traces / "measured", 3, firsts[-1], fill)
        runs = [
            RunView(r.file, r.scenario, r.face, r.axis, r.table_rate_dps, r.day, first, len(r), r.duration_s)
            for r, first in zip(session.runs, firsts, strict=False)
        ]
        return SessionView(folder, session.sensor or "gyroscope", session.axis, session.sample_rate_hz, runs, traces)

    def simulate(
        self, out: Path, effects: Sequence[str], seed: int, scenarios: int, seconds: float, progress: Progress
    ) -> Path:
        """Simulate a campaign with planted effects, for trying out the workbench."""
        simulate(
            out, "paper", effects, seed, scenarios=scenarios, seconds=seconds,
            progress=lambda done, total: progress(f"run {done} of {total}"),
        )  # fmt: skip
        return out

    def compare(self, folder: Path, model: str, progress: Progress) -> ModelView:
        """Compare a model (TOML text, or the name of a built-in model) with the session."""
        return self._view(compare(self._opened(folder), self._model(model), progress=progress), progress)

    def look(self, file: Path, asked: intake.Asked, progress: Progress) -> intake.Looked:
        """Look at a file that may be imported."""
        return intake.look(file, asked)

    def look_by_gravity(self, folder: Path, progress: Progress) -> by_gravity.GravityView:
        """Compare the default model with a session by gravity."""
        return by_gravity.look(folder, progress)

    def missing_by_gravity(self, folder: Path, progress: Progress) -> tuple[str, list[list[str]]]:
        """Diagnose a session by gravity."""
        return by_gravity.missing(folder)

    def take(self, file: Path, asked: intake.Asked, out: Path, progress: Progress) -> Path:
        """Import a file as a new session."""
        intake.take(file, asked, out)
        return out

    def diagnose(self, folder: Path, model: str, progress: Progress) -> DiagnosisView:
        """Diagnose which effect is missing."""
        found = diagnose(self._opened(folder), self._model(model), progress=progress)
        self._compared = found.comparison
        return _diagnosis_view(found)

    def add(self, folder: Path, model: str, effect: str, progress: Progress) -> tuple[dict[str, Any], ModelView]:
        """Add an effect. Returns the comparison before it, over the richer model's floor, and the model with it."""
        before, after, _ = add_effect(self._opened(folder), self._model(model), effect, progress=progress)
        if before.note:
            raise InputError(before.note)
        return before.to_json(), self._view(after, progress)

    def keep(self, folder: Path, model: str, name: str, progress: Progress) -> tuple[str, ModelView]:
        """Find a formula for an unknown misfit. Returns the formula and the model with it."""
        proposed, _, after, _ = keep(self._opened(folder), self._model(model), name, progress=progress)
        return proposed.formula, self._view(after, progress)

    def without(self, folder: Path, model: str, effect: str, progress: Progress) -> ModelView:
        """Remove an effect, and return the model without it."""
        return self._view(compare(self._opened(folder), self._model(model).without(effect), progress=progress), progress)

    def calibrate(self, folder: Path, models: dict[str, str], progress: Progress) -> CalibrationView:
        """Scale and bias from the first seconds by baseline, network and each model (name: TOML); the last is the best."""
        session = self._opened(folder)
        progress("calibrating from the first seconds")
        longest_s = min(
            (min(a.duration_s, b.duration_s) for _, runs in session.by_scenario() for a, b in pairs(runs)), default=None
        )
        if longest_s is None:
            found = calibrate(session, None, None, self._model(list(models.values())[-1]))
            return CalibrationView(_estimates(found), {}, "No face-up and face-down pair: one answer from all recordings.")
        spans = [s for s in DEFAULT_SECONDS if s < 0.9 * longest_s]
        best = self._model(list(models.values())[-1])
        warnings = check(session, best)
        longest = calibrate(session, [np.floor(1e3 * longest_s) / 1e3], ["model"], best, warnings)
        whole = {(e.scenario, e.axis): e for e in longest}
        answers = calibrate(session, spans, None, best, warnings)
        by_method = {
            "baseline": [e for e in answers if e.method == "baseline"],
            "network": [e for e in answers if e.method == "cnn"],
        }
        for name, toml in models.items():
            by_method[name] = calibrate(session, spans, ["model"], self._model(toml), warnings)
        errors = {name: _errors(found, whole) for name, found in by_method.items() if found}
        return CalibrationView(_estimates(answers), errors)

    def verify(self, network: Path | None, progress: Progress) -> dict[str, Any]:
        """Verify the C network of an export's folder, or the shipped one, against onnxruntime."""
        progress("comparing the C network with onnxruntime")
        return verify() if network is None else verify(network / "model.int8.onnx", network / "weights.h")

    def export(self, folder: Path, model: str, axis: str, network: Path | None, progress: Progress) -> ExportView:
        """Write a firmware project with the model's header, the network (None for the shipped one) and the model file."""
        progress("writing headers")
        opened = self._model(model)
        path = self._room() / "model.toml"
        opened.save(path)
        firmware_project.create(folder, str(path), network, axis)
        shutil.copyfile(path, folder / "model.toml")
        return ExportView(folder, opened.effect_ids, self.verify(network, progress))

    def report(
        self, folder: Path, source: str, toml: str, bars: Sequence[Bar], floor_mdps: float,
        diagnosis: DiagnosisView | None, calibration: CalibrationView | None, progress: Progress,
    ) -> str:  # fmt: skip
        """Write everything on the screen as one HTML file."""
        session, found = self._opened(folder), self._compared
        if found is None or found.fit.model.toml() != toml:
            found = compare(session, self._model(source), progress=progress)
        progress("drawing")
        return page(folder.name, found, bars, floor_mdps, diagnosis, calibration)

    # Functions that several of these methods use.

    def _opened(self, folder: Path) -> Session:
        if self._session is None or self._session.path != folder:
            self._session, self._compared = Session.open(folder), None
        return self._session

    def _model(self, model: str) -> Model:
        if "\n" not in model:
            return Model.builtin(model)
        path = self._room() / "model.toml"
        path.write_text(model, encoding="utf-8")
        opened = Model.open(path)
        shutil.rmtree(path.parent)
        return opened

    def _room(self) -> Path:
        """A new folder in the scratch folder, which may already contain the folders of an earlier worker."""
        while True:
            self._number += 1
            room = self._scratch / f"{self._number:06d}"
            if not room.exists():
                room.mkdir(parents=True)
                return room

    def _view(self, found: Comparison, progress: Progress) -> ModelView:
        self._compared = found
        progress("preparing the pictures")
        traces = self._room()
        session = found.fit.session
        first = dict(
            zip((r.index for r in session.runs), np.cumsum([0, *(len(r) for r in session.runs)]).tolist(), strict=False)
        )
        n = sum(len(r) for r in session.runs)
        residuals: dict[str, list[Array]] = {axis: [] for axis in found.fit.axes}
        means: dict[tuple[int, int], Array] = {}
        blocks = {b.run.index: b for b in found.fit.blocks}

        def fill_modelled(modelled: Any) -> None:
            def fill_residual(residual: Any) -> None:
                for p in heldout.fitted(found.fit):
                    rows = slice(first[p.run.index], first[p.run.index] + len(p.run))
                    modelled[p.axis, rows] = p.modelled_dps - known_dps(p.run, p.axis)
                    residual[p.axis, rows] = p.residual_dps
                    residuals[AXES[p.axis]].append(p.residual_dps)
                    means[p.run.index, p.axis] = blocks[p.run.index].mean(p.residual_dps[:, None])[:, 0]

            Pyramid.write(traces / "residual", 3, n, fill_residual)

        Pyramid.write(traces / "modelled", 3, n, fill_modelled)
        points = _points(found.fit.blocks, means)
        np.savez(traces / "points.npz", **points)
        progress("Allan deviation")
        allan = {axis: _allan(found, axis, r) for axis, r in residuals.items() if r}
        spectra = {}
        for axis, s in found.spectra.items():
            x, y = thinned(s.frequency_hz, np.sqrt(s.power), CURVE_POINTS)
            level = np.interp(x, s.frequency_hz, np.sqrt(s.level)) if x.size else x
            spectra[axis] = Curve(x.tolist(), y.tolist(), level.tolist())
        against = [p.name for p in panels() if any(np.isfinite(points[p.key(axis)]).any() for axis in AXES)]
        return ModelView(
            found.fit.model.toml(), found.to_json(), report.headline(found), report.level_rows(found),
            _effects(found.fit.model), traces, against, spectra, allan,
        )  # fmt: skip


def _effects(model: Model) -> list[tuple[str, str, bool]]:
    own = {t.effect_id for t in model.terms if t.own}  # a formula's name is its id
    listed = {line.id: (line.id, line.id if line.id in own else line.kind.title, not line.inherent) for line in model.lines()}
    return list(listed.values())


def _points(blocks: Sequence[Blocks], means: dict[tuple[int, int], Array]) -> dict[str, Any]:
    """Block means of the residual of each axis and of every variable for its plots; shape [blocks] each."""

    def stacked(of: Callable[[Run], Array | None]) -> Any:
        parts = []
        for b in blocks:
            values = None if b.run.rate_is_mean else of(b.run)
            parts.append(np.full(b.t_s.size, np.nan) if values is None else b.mean(values[:, None])[:, 0])
        return np.concatenate(parts).astype(np.float32)

    out: dict[str, Any] = {"run": np.concatenate([np.full(b.t_s.size, b.run.index, np.int32) for b in blocks])}
    for axis, name in enumerate(AXES):
        parts = [means.get((b.run.index, axis), np.full(b.t_s.size, np.nan)) for b in blocks]
        out[name] = np.concatenate(parts).astype(np.float32)
    runs = [b.run for b in blocks]
    for panel in panels():
        variable = panel.variable(runs)
        for axis, name in enumerate(AXES if variable.of_axis else AXES[:1]):
            values = stacked(lambda run, p=panel, v=variable, i=axis: p.values(v, run, i))  # type: ignore[misc]
            out[panel.key(name)] = values if variable.period is None else values % variable.period
    return out


def _allan(found: Comparison, axis: str, residuals: list[Array]) -> Curve:
    rate_hz = found.fit.session.sample_rate_hz
    tau_s, deviation = allan_deviation(residuals, rate_hz)
    expected = model_deviation(tau_s, found.fit.axes[axis].noise, rate_hz)
    return Curve(tau_s.tolist(), deviation.tolist(), expected.tolist())


def _diagnosis_view(found: Diagnosis) -> DiagnosisView:
    residuals = {(p.run.index, AXES[p.axis]): p.residual_dps for p in heldout.fitted(found.comparison.fit)}
    cards = [
        Card(
            c.to_json(), c.effect.title, c.effect.cause, c.effect.equation,
            [_title(i) for i in c.group if i != c.effect.id], report.sizes(c),
            _signature(c, found.comparison, residuals) if c.decision in ("add", "suggest") else None,
        )
        for c in found.candidates
    ]  # fmt: skip
    return DiagnosisView(found.verdict, report.verdict_text(found), cards, found.unknown)


def _title(effect_id: str) -> str:
    kinds = base.effects()
    return kinds[effect_id].title if effect_id in kinds else effect_id


def _signature(c: Candidate, found: Comparison, residuals: dict[tuple[int, str], Array]) -> Signature | None:
    """The run in which the effect is largest: its residual without the effect, and the fitted effect."""
    blocks = found.fit.blocks
    if c.effect.fast:
        s = found.spectra[c.axis]
        x, y = thinned(s.frequency_hz, np.sqrt(s.power) * 1e3, SIGNATURE_DOTS)
        return Signature("spectrum of the residual", "Hz", [], list(zip(x.tolist(), y.tolist(), strict=True)))
    if c.signal is None or c.signal.size != sum(b.t_s.size for b in blocks):
        return None
    parts = np.split(c.signal, np.cumsum([b.t_s.size for b in blocks])[:-1])
    strongest = max(
        (i for i, b in enumerate(blocks) if (b.run.index, c.axis) in residuals),
        key=lambda i: float(np.sum(parts[i] ** 2)),
        default=None,
    )
    if strongest is None:
        return None
    b = blocks[strongest]
    left = b.mean(residuals[b.run.index, c.axis][:, None])[:, 0]
    line = parts[strongest] / np.sqrt(b.n)
    t_s = b.t_s - b.run.t_s[0]
    group = max(1, -(-t_s.size // SIGNATURE_DOTS))
    starts = np.arange(0, t_s.size, group)
    sizes = np.diff([*starts, t_s.size])

    def coarse(values: Array) -> list[float]:
        return (np.add.reduceat(values, starts) / sizes).tolist()

    times = coarse(t_s)
    return Signature(
        f"run {b.run.file}", "s",
        list(zip(times, coarse((left - left.mean()) * 1e3), strict=True)),
        list(zip(times, coarse((line - line.mean()) * 1e3), strict=True)),
    )  # fmt: skip


def _estimates(found: Sequence[Estimate]) -> list[dict[str, Any]]:
    return [e.to_json() for e in found]


def _errors(found: Sequence[Estimate], whole: dict[tuple[str, str], Estimate]) -> dict[float, tuple[float, float]]:
    """Mean absolute difference from the whole recording, by seconds."""
    apart: dict[float, list[tuple[float, float]]] = {}
    for e in found:
        if (e.scenario, e.axis) in whole:
            label = whole[e.scenario, e.axis]
            if e.scale is None or e.bias_dps is None or label.scale is None or label.bias_dps is None:
                continue
            apart.setdefault(e.seconds, []).append((abs(e.scale - label.scale), abs(e.bias_dps - label.bias_dps)))
    return {s: (float(np.mean([a for a, _ in v])), float(np.mean([b for _, b in v]))) for s, v in apart.items()}
