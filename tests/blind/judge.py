"""One case: make its session, let the tool at it, and hold what is left against the oracle's fit."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from gyrocal.diagnosis.answer.diagnose import Diagnosis, diagnose
from gyrocal.diagnosis.answer.explain import explain
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.effects import base
from gyrocal.error_model.model import Model, Term
from gyrocal.inference import heldout
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import Fit
from gyrocal.inference.likelihood_ratio import likelihood_ratio
from gyrocal.recording.session import AXES, Session
from known import add_measured

from . import stepwise
from .drawn import Draw
from .generator.case import Case, Effect, Truth
from .generator.chip import DIGITAL
from .generator.detectability import detectability
from .generator.session import make
from .outcome import NAMEABLE, Answer, Name, Outcome

ORACLE_ALARM = 0.01
MOST_STEPS = 3


def judge(planned: Case | Draw) -> Outcome:
    """Make the session and let each method at it; a drawn case has no stepwise F-test, whose cost is the tool's."""
    case = planned.case() if isinstance(planned, Draw) else planned
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "session"
        truth = make(case, folder)
        session = Session.open(folder)
        # readings lost on the digital side do not come back: there is no error for a model to lower
        fits = case.kind in NAMEABLE and not any(e.id in DIGITAL for e in case.effects)
        try:
            if case.kind == "set":
                tool, note = _explained(session, truth)
            else:
                found = diagnose(session)
                most = MOST_STEPS if isinstance(planned, Case) else 1
                tool, note = _walk(session, found, truth, most), _note(found, case)
        except Exception as error:
            tool, note = Answer("failed"), f"{type(error).__name__}: {error}"
        answers = {"gyrocal": tool, "oracle": _oracle(session, truth) if fits else Answer("-")}
        if isinstance(planned, Case):
            answers["stepwise"] = _stepwise(session, truth, fits)
    faintest = min((detectability(truth, e.id) for e in case.effects), default=0.0)
    return Outcome(case, faintest, answers, note)


def _stepwise(session: Session, truth: Truth, fits: bool) -> Answer:
    names = tuple(stepwise.select(session))
    left = error_dps(fit(session, _with(names)), truth) if fits else None
    return Answer("add" if names else "adequate", names, tuple(id_ for id_, _ in names[:1]), error_dps=left)


def _walk(session: Session, found: Diagnosis, truth: Truth, most_steps: int) -> Answer:
    """Add what is named first and ask again, until nothing is named."""
    best, after, model = found.best, found.comparison, None
    named: list[Name] = []
    while best is not None and len(named) < most_steps:
        named.append((best.effect.id, best.axis))
        if truth.case.kind not in NAMEABLE:
            break
        _, after, model = add_measured(session, model, best.effect.id)
        best = diagnose(session, model).best if len(named) < most_steps else None
    group = found.best.group if found.best is not None else next((c.group for c in found.candidates if c.group), ())
    decisions = tuple(c.decision for c in _on_truth(found, truth.case))
    return Answer(found.verdict, tuple(named), group, decisions, error_dps(after.fit, truth))


def _explained(session: Session, truth: Truth) -> tuple[Answer, str]:
    """What `explain` names to its end; `group` is what it leaves open, for a set may be named in part."""
    found = explain(session)
    said = found.to_json()
    named: list[Name] = []
    for step in said["steps"]:
        ids, axes = step["effects"], step["axes"]
        named = [(id_, axis) for id_, axis in named if id_ not in step["removed"] or axis not in axes]
        named += zip(ids, axes, strict=True) if len(ids) == len(axes) else product(ids, axes)
    left = "; ".join(f"{'/'.join(open_['group'])} on {open_['axis']}" for open_ in said["left"])
    group = tuple(id_ for open_ in said["left"] for id_ in open_["group"]) or tuple(id_ for id_, _ in named[:1])
    error = error_dps(fit(session, found.model), truth)
    return Answer(said["verdict"], tuple(named), group, error_dps=error), f"left open: {left or 'nothing'}"


def _oracle(session: Session, truth: Truth) -> Answer:
    """The planted structure, fitted; "add" where a likelihood ratio of that alone says that it is there."""
    without = fit(session, Model.builtin("default"))
    terms = [Term(e.id, axis, _structure(e)) for e in truth.case.effects for axis in e.axes]
    model = Model.builtin("default")
    for term in terms:
        model = model.with_term(term)
    fitted = fit(session, model)
    gain, parameters = 0.0, 0
    for axis in {term.axis for term in terms}:
        before, after = without.axes[axis], fitted.axes[axis]
        gain += likelihood_ratio(before, after, 1)[0]
        old, new = before.design.layout, after.design.layout
        parameters += len(new.fixed) - len(old.fixed) + new.n_groups - old.n_groups
    parameters += sum(len(term.effect.nonlinear) for term in terms)
    there = chi2.sf(max(gain, 0.0), max(parameters, 1)) < ORACLE_ALARM
    names = tuple((e.id, e.axes[0]) for e in truth.case.effects) if there else ()
    group = tuple(id_ for id_, _ in names[:1])
    return Answer("add" if there else "adequate", names, group, error_dps=error_dps(fitted, truth))


def _structure(effect: Effect) -> base.Values:
    """Which linear parameters are in use, and the nonlinear ones to start from; empty where the effect has neither."""
    kind = base.effect(effect.id)
    given = {name: value for name, value in effect.parameters.items() if name in (*kind.linear, *kind.nonlinear)}
    return {name: value if name in kind.nonlinear else 0.0 for name, value in given.items()}


def _with(names: Iterable[Name]) -> Model:
    model = Model.builtin("default")
    for id_, axis in names:
        model = model.add(id_, axis)
    return model


def _on_truth(found: Diagnosis, case: Case) -> list[Candidate]:
    planted = {(e.id, axis) for e in case.effects for axis in e.axes}
    return [c for c in found.candidates if (c.effect.id, c.axis) in planted]


def _note(found: Diagnosis, case: Case) -> str:
    def said(c: Candidate) -> str:
        gain = "" if c.gain is None else f" gain {c.gain:.1f} ± {c.gain_se or np.nan:.1f}"
        chance = "" if c.q_value is None else f" q {c.q_value:.0e}"
        explained = "" if c.explained is None else f" explained {c.explained:.2f}"
        return f"{c.effect.id} on {c.axis} {c.decision}{gain}{chance}{explained}"

    best = [found.best] if found.best is not None else []
    on_truth = [c for c in _on_truth(found, case) if c not in best]
    seen = [f"{f.axis} against {f.against} {f.strength:.1f} sigma, {f.note}" for f in found.comparison.where[:2]]
    return "; ".join([*map(said, [*best, *on_truth]), *seen]) or "nothing seen"


def error_dps(fitted: Fit, truth: Truth) -> float:
    """What the held-out excess estimates, exactly: rms of model minus the noise-free reading, all axes pooled.

    A bias, and on the table's axis a scale, of each day are taken out: the turn-on bias makes them uncertain by more than
    the effects' sizes, and whatever the model, alike.
    """
    runs = {run.file: run for run in truth.runs}
    parts: dict[tuple[int, int], list[np.ndarray[Any, Any]]] = {}
    for p in heldout.predictions(fitted, heldout.folds(fitted)):
        run, rows = runs[p.run.file], p.rows
        rate = run.rate_dps[rows] * (AXES[p.axis] == truth.case.table_axis)
        added = sum(signal[p.axis, rows] for signal in run.injected_dps.values())
        noise_free = (1 + truth.scale[p.axis]) * rate + truth.bias_dps[p.axis] + added
        columns = np.column_stack([p.modelled_dps - noise_free, np.ones_like(rate), rate])
        parts.setdefault((run.day, p.axis), []).append(columns)
    total, count = 0.0, 0
    for pieces in parts.values():
        all_rows = np.concatenate(pieces)
        known = all_rows[:, 1:]
        left = all_rows[:, 0] - known @ np.linalg.lstsq(known, all_rows[:, 0], rcond=None)[0]
        total, count = total + float(left @ left), count + left.size
    return float(np.sqrt(total / count))
