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
from gyrocal.inference.blocks import known_dps
from gyrocal.policy import POLICY
from gyrocal.present import report
from gyrocal.recording.session import AXES, Array
from gyrocal.web import by_gravity, intake
from gyrocal.web.against import panels
from gyrocal.web.budget import of_answers
from gyrocal.web.decimate import Pyramid
from gyrocal.web.doubt import doubts
from gyrocal.web.fall import Fall, Levels
from gyrocal.web.hero import picture
from gyrocal.web.mend import Mend, apply
from gyrocal.web.prepare import Residuals, points
from gyrocal.web.report import page
from gyrocal.web.told import Change
from gyrocal.web.views import (
    CalibrationView,
    Card,
    DiagnosisView,
    ExportView,
    ModelView,
    Picture,
    Recording,
    RunView,
    SessionView,
)

Progress = Callable[[str], None]
UNPAIRED = "No power cycle has both a face-up and a face-down run, so one answer comes from all recordings."

class Bench:
    """Holds the current session and its last comparison. Results that are too large to send are written to ``scratch``."""

    def __init__(self, scratch: Path) -> None:
        self._scratch = scratch
        self._whole: Session | None = None
        self._used: tuple[Recording, Session] | None = None
        """The session without the runs that are left out."""
        self._compared: Comparison | None = None
        self._number = 0

    # jobs.Jobs.run calls these methods by name. Each begins by reading the session, because the worker may be a new one.

    def open(self, folder: Path, progress: Progress) -> SessionView:
        """Read and check a session, and write its traces."""
        progress("reading the recordings")
        session = Session.open(folder)
        self._whole, self._used, self._compared = session, None, None
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

    def mend(self, folder: Path, mend: Mend, out: Path, progress: Progress) -> Path:
        """Mend a session, in place or as a new one at ``out``. Returns the folder to open."""
        mended = apply(folder, mend, lambda: out)
        self._whole = self._used = self._compared = None
        return mended

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

    def compare(self, recording: Recording, model: str, progress: Progress) -> ModelView:
        """Compare a model (TOML text, or the name of a built-in model) with the session."""
        return self._view(compare(self._opened(recording), self._model(model), progress=progress), progress)

    def diagnose(self, recording: Recording, model: str, progress: Progress) -> DiagnosisView:
        """Diagnose which effect is missing."""
        found = diagnose(self._opened(recording), self._model(model), progress=progress)
        self._compared = found.comparison
        return _diagnosis_view(found)

    def add(self, recording: Recording, model: str, effect: str, progress: Progress) -> tuple[dict[str, Any], ModelView]:
        """Add an effect. Returns the comparison before it, over the richer model's floor, and the model with it."""
        before, after, _ = add_effect(self._opened(recording), self._model(model), effect, progress=progress)
        if before.note:
            raise InputError(before.note)
        return before.to_json(), self._view(after, progress)

    def keep(self, recording: Recording, model: str, name: str, progress: Progress) -> tuple[str, ModelView]:
        """Find a formula for an unknown misfit. Returns the formula and the model with it."""
        proposed, _, after, _ = keep(self._opened(recording), self._model(model), name, progress=progress)
        return proposed.formula, self._view(after, progress)

    def without(self, recording: Recording, model: str, effect: str, progress: Progress) -> ModelView:
        """Remove an effect, and return the model without it."""
        return self._view(compare(self._opened(recording), self._model(model).without(effect), progress=progress), progress)

    def calibrate(self, recording: Recording, models: dict[str, str], progress: Progress) -> CalibrationView:
        """Scale and bias from the first seconds by baseline, network and each model (name: TOML); the last is the best."""
        session = self._opened(recording)
        progress("calibrating from the first seconds")
        longest_s = min(
            (min(a.duration_s, b.duration_s) for _, runs in session.by_scenario() for a, b in pairs(runs)), default=None
        )
        if longest_s is None:
            found = calibrate(session, None, None, self._model(list(models.values())[-1]))
            return CalibrationView(_estimates(found), {}, UNPAIRED, of_answers(found))
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
        return CalibrationView(_estimates(answers), errors, budget=of_answers(answers))

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
        self, recording: Recording, source: str, toml: str, fall: Fall | None, story: Sequence[Change],
        diagnosis: DiagnosisView | None, calibration: CalibrationView | None, progress: Progress,
    ) -> str:  # fmt: skip
        """Write everything on the screen as one HTML file."""
        session, found = self._opened(recording), self._compared
        if found is None or found.fit.model.toml() != toml:
            found = compare(session, self._model(source), progress=progress)
        progress("drawing")
        return page(recording.path.name, found, fall, story, diagnosis, calibration, sorted(recording.excluded))

    # Functions that several of these methods use.

    def _opened(self, recording: Recording) -> Session:
        if self._whole is None or self._whole.path != recording.path:
            self._whole, self._used, self._compared = Session.open(recording.path), None, None
        if self._used is None or self._used[0] != recording:
            kept = [run for run in self._whole.runs if run.file not in recording.excluded]
            if not kept:
                raise InputError("every run is excluded; include one at least")
            session = self._whole.with_runs(kept) if recording.excluded else self._whole
            self._used, self._compared = (recording, session), None
        return self._used[1]

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
        assert self._whole is not None
        traces, runs = self._room(), self._whole.runs
        first = dict(zip((r.index for r in runs), np.cumsum([0, *map(len, runs)]).tolist(), strict=False))
        residuals = Residuals(found, traces, first, self._whole.rows)
        np.savez(traces / "points.npz", **residuals.points)
        progress("spectra")
        against = [p.name for p in panels() if any(np.isfinite(residuals.points[p.key(axis)]).any() for axis in AXES)]
        compared = found.to_json()
        levels = None
        if found.angles is None:
            levels = Levels(found.squares, found.floors, found.cycles, len(compared["parameters"]))
        return ModelView(
            found.fit.model.toml(), compared, report.headline(found), report.level_rows(found), _effects(found.fit.model),
            traces, against, levels, residuals.places(), residuals.left(), residuals.spectra(), residuals.orders(),
            residuals.allan(),
        )  # fmt: skip


def _effects(model: Model) -> list[tuple[str, str, bool]]:
    own = {t.effect_id for t in model.terms if t.own}  # a formula's name is its id
    listed = {line.id: (line.id, line.id if line.id in own else line.kind.title, not line.inherent) for line in model.lines()}
    return list(listed.values())


def _diagnosis_view(found: Diagnosis) -> DiagnosisView:
    fit = found.comparison.fit
    means: dict[tuple[int, int], Array] = {}
    blocks = {b.run.index: b for b in fit.blocks}
    for p in heldout.fitted(fit):
        means[p.run.index, p.axis] = blocks[p.run.index].mean(p.residual_dps[:, None])[:, 0]
    drawn = points(fit.blocks, means)
    few = found.comparison.cycles < POLICY.few_cycles
    cards = [
        Card(
            c.to_json(), c.effect.title, c.effect.cause, c.effect.equation,
            [_title(i) for i in c.group if i != c.effect.id], report.sizes(c), doubts(c, found.comparison), few,
            _picture(c, found.comparison, drawn) if c.decision in ("add", "suggest") else None,
        )
        for c in found.candidates
    ]  # fmt: skip
    return DiagnosisView(found.verdict, report.verdict_text(found), cards, found.unknown)


def _title(effect_id: str) -> str:
    kinds = base.effects()
    return kinds[effect_id].title if effect_id in kinds else effect_id


def _picture(c: Candidate, found: Comparison, drawn: dict[str, Any]) -> Picture | None:
    blocks = found.fit.blocks
    samples = np.concatenate([b.n for b in blocks])
    if c.signal is None or c.signal.size != samples.size or not np.isfinite(drawn[c.axis]).any():
        return None
    files = {b.run.index: b.run.file for b in blocks}
    return picture(c.axis, np.asarray(c.signal / np.sqrt(samples)), drawn, files)


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
