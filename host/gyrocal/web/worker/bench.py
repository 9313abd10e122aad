"""The functions of the worker process: they call the engine and prepare its results for the page."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.api import Candidate, Comparison, Diagnosis, InputError, Model, Session, check, compare, diagnose, simulate
from gyrocal.calibration.calibrate import DEFAULT_SECONDS, POOLED, Estimate, calibrate
from gyrocal.calibration.pairs import pairs
from gyrocal.core import firmware_project
from gyrocal.core.verify import verify
from gyrocal.diagnosis.answer.add import attempt, proven_on
from gyrocal.diagnosis.answer.explain import explain
from gyrocal.diagnosis.answer.formula_search import keep
from gyrocal.effects.base import title_of
from gyrocal.extras import lacking
from gyrocal.inference import heldout
from gyrocal.inference.fitted import Fit
from gyrocal.plausibility import absent
from gyrocal.policy import POLICY
from gyrocal.present import probability, report
from gyrocal.present.limits import limits
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.units import to_read
from gyrocal.web.values.budget import of_answers
from gyrocal.web.values.excess_by_step import Fall, Levels
from gyrocal.web.values.residual_plots import panels
from gyrocal.web.values.story import Change
from gyrocal.web.values.views import (
    Attempt,
    CalibrationView,
    Card,
    DiagnosisView,
    ExplainedView,
    ExportView,
    Holdable,
    Made,
    ModelView,
    Picture,
    Recording,
)
from gyrocal.web.worker import by_gravity, intake
from gyrocal.web.worker.beside_named import as_shown, sure_ones
from gyrocal.web.worker.doubt import doubts, faster
from gyrocal.web.worker.effect_picture import picture
from gyrocal.web.worker.mend import Mend, apply
from gyrocal.web.worker.opened import Opened
from gyrocal.web.worker.prepare import Residuals, points
from gyrocal.web.worker.report import page
from gyrocal.web.worker.size_in_parts import halves
from gyrocal.web.worker.tested_again import proven_now

Progress = Callable[[str], None]
Doubted = Mapping[str, Sequence[str]]
"""Ids of effects in the model that are not proven, with those that the session could not tell from them."""


class Bench:
    """The methods that need the engine. Holds the last comparison; large results are written to the scratch folder."""

    def __init__(self, opened: Opened) -> None:
        self.opened = opened
        self._last: tuple[Session, Comparison] | None = None
        """The last comparison, with the session that it was made of."""

    # jobs.Jobs.run calls these methods by name. Each begins by asking for the session, because the worker may be a new one.

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
        self.opened.forget()
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
        return self._view(recording, compare(self.opened.session(recording), self._model(model), progress=progress), progress)

    def diagnose(self, recording: Recording, model: str, progress: Progress) -> DiagnosisView:
        """Diagnose which effect is missing."""
        session = self.opened.session(recording)
        found = diagnose(session, self._model(model), progress=progress)
        self._last = (session, found.comparison)
        return _diagnosis_view(found)

    def add(
        self, recording: Recording, model: str, effect: str, title: str, doubted: Doubted, progress: Progress
    ) -> Attempt:
        """Add an effect, which is called ``title`` where it is refused, and test again what is ``doubted``."""
        (before, after, _), judged = attempt(self.opened.session(recording), self._model(model), effect, progress=progress)
        proven = proven_on(judged)
        excluded = [f"on {a}, {told}" for a, c in judged.items() if a not in proven and (told := limits(c))]
        if before.note:
            reason = before.note.partition(" was not added: ")[2]
            return Attempt(before.to_json(), None, f"{title} was not added: {reason}.", excluded)
        progress("testing again what was not proven")
        proves = tuple(proven_now(after, doubted))
        return Attempt(before.to_json(), self._view(recording, after, progress), "", excluded, proves)

    def explain(self, recording: Recording, model: str, doubted: Doubted, progress: Progress) -> ExplainedView:
        """Add every missing effect that is certain, step by step, diagnose what is left, and test again what is ``doubted``."""
        session = self.opened.session(recording)
        found = explain(session, self._model(model), progress=progress)
        made = []
        for step in found.steps:
            named = [c for c in (step.found.candidates if step.found else ()) if c.effect.id in step.effects]
            cards = _cards(step.found, [c for c in named if c.axis in step.axes]) if step.found else []
            title = " and ".join(title_of(i) for i in step.effects)
            made.append(Made(step.effects, title, tuple(cards), self._view(recording, step.after, progress)))
        self._last = (session, found.last.comparison)
        return ExplainedView(made, _diagnosis_view(found.last), tuple(proven_now(found.last.comparison, doubted)))

    def keep(self, recording: Recording, model: str, name: str, progress: Progress) -> tuple[str, ModelView]:
        """Find a formula for an unknown misfit. Returns the formula and the model with it."""
        proposed, _, after, _ = keep(self.opened.session(recording), self._model(model), name, progress=progress)
        return proposed.formula, self._view(recording, after, progress)

    def without(self, recording: Recording, model: str, effect: str, progress: Progress) -> ModelView:
        """Remove an effect, and return the model without it."""
        without = self._model(model).without(effect)
        return self._view(recording, compare(self.opened.session(recording), without, progress=progress), progress)

    def hold(
        self, recording: Recording, model: str, effect: str, axis: str, name: str, value: float | None, progress: Progress
    ) -> ModelView:
        """Hold a parameter of an effect at a value, or fit it again if ``value`` is None."""
        other = self._model(model).holding(effect, axis, name, value)
        return self._view(recording, compare(self.opened.session(recording), other, progress=progress), progress)

    def calibrate(self, recording: Recording, models: dict[str, str], progress: Progress) -> CalibrationView:
        """Scale and bias from the first seconds by average, network and each model (name: TOML); the last is the best."""
        session = self.opened.session(recording)
        progress("calibrating from the first seconds")
        longest_s = min(
            (min(a.duration_s, b.duration_s) for _, runs in session.by_scenario() for a, b in pairs(runs)), default=None
        )
        if longest_s is None:
            try:
                found = calibrate(session, None, None, self._model(list(models.values())[-1]))
            except InputError as error:
                return CalibrationView([], {}, f"No answer: {str(error).removeprefix(f'{session.path}: ')}.")
            return CalibrationView(_estimates(found), {}, _unpaired(found, session.runs), of_answers(found))
        spans = [s for s in DEFAULT_SECONDS if s < 0.9 * longest_s]
        best = self._model(list(models.values())[-1])
        warnings = check(session, best)
        longest = calibrate(session, [np.floor(1e3 * longest_s) / 1e3], ["model"], best, warnings)
        whole = {(e.scenario, e.axis): e for e in longest}
        answers = calibrate(session, spans, None, best, warnings)
        by_method = {
            "plain average": [e for e in answers if e.method == "baseline"],
            "network": [e for e in answers if e.method == "cnn"],
        }
        for name, toml in models.items():
            by_method[name] = calibrate(session, spans, ["model"], self._model(toml), warnings)
        errors = {name: _errors(found, whole) for name, found in by_method.items() if found}
        return CalibrationView(_estimates(answers), errors, budget=of_answers(answers))

    def verify(self, network: Path | None, progress: Progress) -> dict[str, Any] | None:
        """Verify the C network of an export's folder, or the shipped one; None if onnxruntime is not installed."""
        if lacking("net"):
            return None
        progress("comparing the C network with onnxruntime")
        return verify() if network is None else verify(network / "model.int8.onnx", network / "weights.h")

    def export(self, folder: Path, model: str, axis: str, network: Path | None, progress: Progress) -> ExportView:
        """Write a firmware project with the model's header, the network (None for the shipped one) and the model file."""
        progress("writing headers")
        opened = self._model(model)
        path = self.opened.room() / "model.toml"
        opened.save(path)
        firmware_project.create(folder, str(path), network, axis)
        shutil.copyfile(path, folder / "model.toml")
        return ExportView(folder, opened.effect_ids, self.verify(network, progress))

    def report(
        self, recording: Recording, source: str, toml: str, fall: Fall | None, story: Sequence[Change],
        diagnosis: DiagnosisView | None, calibration: CalibrationView | None, progress: Progress,
    ) -> str:  # fmt: skip
        """Write everything on the screen as one HTML file."""
        session = self.opened.session(recording)
        if self._last is None or self._last[0] is not session or self._last[1].fit.model.toml() != toml:
            self._last = (session, compare(session, self._model(source), progress=progress))
        found = self._last[1]
        progress("drawing")
        return page(recording.path.name, found, fall, story, diagnosis, calibration, sorted(recording.excluded))

    # Functions that several of these methods use.

    def _model(self, model: str) -> Model:
        if "\n" not in model:
            return Model.builtin(model)
        path = self.opened.room() / "model.toml"
        path.write_text(model, encoding="utf-8")
        opened = Model.open(path)
        shutil.rmtree(path.parent)
        return opened

    def _view(self, recording: Recording, found: Comparison, progress: Progress) -> ModelView:
        self._last = (self.opened.session(recording), found)
        progress("preparing the pictures")
        traces = self.opened.room()
        residuals = Residuals(found, traces, self.opened.first_rows(), self.opened.rows)
        np.savez(traces / "points.npz", **residuals.points)
        progress("spectra")
        against = [p.name for p in panels() if any(np.isfinite(residuals.points[p.key(axis)]).any() for axis in AXES)]
        compared = found.to_json()
        levels = None
        if found.angles is None:
            squares = {axis: s for axis, s in found.squares.items() if axis not in absent(found.warnings)}
            levels = Levels(squares, found.floors, found.cycles, len(compared["parameters"]))
        model = found.fit.model
        return ModelView(
            model.toml(), compared, report.headline(found), report.level_rows(found),
            report.level_unit_name(found), _effects(model), _holdable(model), _sizes(model), traces, against, levels,
            residuals.places(), residuals.left(), residuals.spectra(), residuals.orders(),
            residuals.allan(),
        )  # fmt: skip


def _effects(model: Model) -> list[tuple[str, str, bool]]:
    own = {t.effect_id for t in model.terms if t.own}  # a formula's name is its id
    listed = {line.id: (line.id, line.id if line.id in own else line.kind.title, not line.inherent) for line in model.lines()}
    return list(listed.values())


def _holdable(model: Model) -> list[Holdable]:
    own = {t.effect_id for t in model.terms if t.own}
    return [
        Holdable(
            t.effect_id, t.effect_id if t.effect_id in own else t.effect.title, t.axis, name, t.values[name], t.se.get(name),
            to_read(t.effect.parameter(name).unit), name in t.held,
        )
        for t in model.terms for name in t.holdable
    ]  # fmt: skip


def _sizes(model: Model) -> dict[str, dict[str, str]]:
    """The fitted size of each effect in words, by its id and the axis."""
    out: dict[str, dict[str, str]] = {}
    for t in model.terms:
        out.setdefault(t.effect_id, {})[t.axis] = report.sized(t.effect, t.values, t.se)
    return out


def _diagnosis_view(found: Diagnosis) -> DiagnosisView:
    alternatives = [a.to_json() for a in found.alternatives]
    return DiagnosisView(
        found.verdict, report.verdict_text(found, _title), _cards(found, as_shown(found)), found.unknown,
        probability.set_rows(alternatives, _title), probability.left_over(alternatives),
    )  # fmt: skip


def _cards(found: Diagnosis, candidates: Sequence[Candidate]) -> list[Card]:
    """The cards of some candidates of a diagnosis, with pictures of what it names or suggests."""
    fit = found.comparison.fit
    means: dict[tuple[int, int], Array] = {}
    blocks = {b.run.index: b for b in fit.blocks}
    for p in heldout.fitted(fit):
        means[p.run.index, p.axis] = blocks[p.run.index].mean(p.residual_dps[:, None])[:, 0]
    drawn = points(fit.blocks, means)
    few = found.comparison.cycles < POLICY.few_cycles
    cards = []
    for c in candidates:
        signal = _signal(c, found.comparison, drawn) if c.decision in ("add", "suggest") else None
        others = sure_ones([o for o in candidates if o.axis == c.axis]) if c.decision == "suggest" else []
        left = _without(others, found.comparison, drawn, c.axis)
        cards.append(Card(
            c.to_json(), c.effect.title, c.effect.cause_in(fit.session.runs), c.effect.equation,
            [title_of(i) for i in c.group if i != c.effect.id], _size(c), doubts(c, found.comparison, candidates), few,
            None if signal is None else _picture(c, signal, fit, left, others),
            not c.effect.fast and faster(found.comparison, c.axis), limits(c) if c.decision == "reject" else "",
            [] if signal is None or c.effect.fast else halves(c.axis, signal, left),
        ))  # fmt: skip
    return cards


def _title(effect_id: str) -> str:
    return title_of(effect_id).lower()


def _size(c: Candidate) -> str:
    """The fitted parameters, and those of the equation that the session does not need."""
    law = re.split(r", | \(", c.effect.equation)[0]  # without other forms of it
    without = [p.name for p in c.effect.parameters if c.values and p.name not in c.values and p.name in law]
    size = report.sizes(c)
    return f"{size}; without {' and '.join(without)}" if without else size


def _signal(c: Candidate, found: Comparison, drawn: dict[str, Any]) -> Array | None:
    """The fitted effect in block means [blocks], deg/s; None if it has none, or if the axis has no residual."""
    samples = np.concatenate([b.n for b in found.fit.blocks])
    if c.signal is None or c.signal.size != samples.size or not np.isfinite(drawn[c.axis]).any():
        return None
    return np.asarray(c.signal / np.sqrt(samples))


def _without(named: Sequence[Candidate], found: Comparison, drawn: dict[str, Any], axis: str) -> dict[str, Any]:
    """The points of an axis without the signals of what is named there: the residual that a hint was judged on."""
    signals = [s for c in named if (s := _signal(c, found, drawn)) is not None]
    return {**drawn, axis: drawn[axis] - sum(map(np.nan_to_num, signals))} if signals else drawn


def _picture(
    c: Candidate, signal: Array, fit: Fit, drawn: dict[str, Any], named: Sequence[Candidate]
) -> Picture | None:  # fmt: skip
    files = {b.run.index: b.run.file for b in fit.blocks}
    shown = picture(c.axis, signal, drawn, files, c.effect.shown_against, c.effect.equation)
    return shown and replace(shown, beside=" and ".join(o.effect.title.lower() for o in named))


def _estimates(found: Sequence[Estimate]) -> list[dict[str, Any]]:
    return [{**e.to_json(), "taken": e.taken} for e in found]


def _unpaired(found: Sequence[Estimate], runs: Sequence[Run]) -> str:
    """Where the answers of a session come from in which no power cycle has two runs of opposite true rate."""
    faces = {(run.scenario, run.face) for run in runs}
    paired = len(faces) > len({run.scenario for run in runs})
    if any(e.scenario == POOLED for e in found):
        lacks = "shows scale and bias by itself" if paired else "has both a face-up and a face-down run"
        return f"No power cycle {lacks}, so one answer comes from all recordings."
    return "No power cycle has two recordings of opposite true rate, so each answer is the model's, from whole recordings."


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
