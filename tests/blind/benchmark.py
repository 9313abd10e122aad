"""The blind benchmark: is the missing effect named, is nothing named where nothing is missing, and does the error fall?

The tool sees the session's folder alone. Beside it, on the same sessions: forward selection by the ordinary F-test
(`stepwise`), and the oracle, which fits the structure that was planted. docs/blind.md defines every figure.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from gyrocal.diagnosis.add import add
from gyrocal.diagnosis.candidate import Candidate
from gyrocal.diagnosis.diagnose import Diagnosis, diagnose
from gyrocal.effects import base
from gyrocal.error_model.model import Model, Term
from gyrocal.inference import heldout
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import Fit
from gyrocal.inference.likelihood_ratio import likelihood_ratio
from gyrocal.recording.session import AXES, Session

from . import stepwise
from .generator.case import Case, Effect, Truth
from .generator.chip import DIGITAL
from .generator.detectability import detectability
from .generator.session import make

LEAST_DETECTABILITY = 8.0
"""In standard errors: the aims hold for what the data can tell."""
ORACLE_ALARM = 0.01
MOST_STEPS = 3
PROCESSES = 2
NAMEABLE = ("effect", "pair")
"""Kinds of cases whose effects can be named, and added one by one."""

Name = tuple[str, str]  # effect and axis
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Answer:
    """What one method said of a session.

    `named` in the order found, `group` what is shown with the first, `decisions` on each planted effect where it sits,
    `error_dps` what is left when all that was named has been added (the function below), None where it was not asked.
    """

    verdict: str
    named: tuple[Name, ...] = ()
    group: tuple[str, ...] = ()
    decisions: tuple[str, ...] = ()
    error_dps: float | None = None


@dataclass(frozen=True)
class Outcome:
    """One case: what each method answered, and in words what the tool saw."""

    case: Case
    detectability: float
    answers: dict[str, Answer]
    note: str = ""

    @property
    def counts(self) -> bool:
        """Can the data tell? What is confounded is hidden by design, and a null has nothing to detect."""
        return self.case.kind in ("null", "confounded") or self.detectability >= LEAST_DETECTABILITY

    @property
    def planted(self) -> set[Name]:
        """Every right name; what sits on several axes may be named on any of them."""
        return {(e.id, axis) for e in self.case.effects for axis in e.axes if e.id in self.case.expected}

    def right(self, method: str) -> bool:
        """Was the first answer the right one for this kind of case?"""
        answer = self.answers[method]
        if self.case.kind == "null":
            return answer.verdict == "adequate"
        if self.case.kind == "unknown":
            return answer.verdict == "unknown"
        if self.case.kind == "confounded":
            return self._declared(answer)
        return bool(answer.named) and answer.named[0] in self.planted

    def in_group(self, method: str) -> bool:
        """Is a planted effect among those shown, on an axis that shows it?"""
        answer = self.answers[method]
        return bool(answer.named) and any((id_, answer.named[0][1]) in self.planted for id_ in answer.group)

    def misnamed(self, method: str) -> bool:
        """One cause was stated, and it is not there."""
        answer = self.answers[method]
        return answer.verdict == "add" and answer.named[0] not in self.planted

    def completed(self, method: str) -> bool:
        """All that was planted was found one by one, and nothing more."""
        each_once = product(*([(e.id, axis) for axis in e.axes] for e in self.case.effects))
        return sorted(self.answers[method].named) in [sorted(names) for names in each_once]

    @property
    def fitted(self) -> bool:
        """Has the oracle an error, to hold the others against?"""
        return self.answers["oracle"].error_dps is not None

    def _declared(self, answer: Answer) -> bool:
        """Said to be not measurable here, or shown in a group with what looks alike."""
        if answer.verdict == "add":
            return False
        with_rival = set(answer.group) >= set(self.case.expected) and bool(set(answer.group) & set(self.case.rivals))
        return with_rival or set(answer.decisions) == {"not_measurable"}

    @property
    def fault(self) -> str | None:
        """What is wrong with the tool's answer; None if nothing."""
        if not self.right("gyrocal"):
            return "misnamed" if self.misnamed("gyrocal") else "wrong"
        if self.case.kind in NAMEABLE and not self.completed("gyrocal"):
            return "not completed"
        return None

    def line(self) -> str:
        """One line for a list of failures."""
        case, said = self.case, self.answers["gyrocal"]
        planted = ", ".join(f"{e.id} on {e.axes}" for e in case.effects) or "nothing"
        named = ", then ".join(f"{id_} on {axis}" for id_, axis in said.named) or "nothing"
        group = f" in group {'/'.join(said.group)}" if len(said.group) > 1 else ""
        return (
            f"{case.name}: planted {planted}; verdict {said.verdict}, named {named}{group} "
            f"({case.protocol}, table {case.table_axis}, detectability {self.detectability:.1f}; {self.note})"
        )


# --- one case ------------------------------------------------------------------------------------------------------


def judge(case: Case) -> Outcome:
    """Make the session and let each method at it."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "session"
        truth = make(case, folder)
        session = Session.open(folder)
        # readings lost on the digital side do not come back: there is no error for a model to lower
        fits = case.kind in NAMEABLE and not any(e.id in DIGITAL for e in case.effects)
        try:
            found = diagnose(session)
            tool, note = _walk(session, found, truth), _note(found, case)
        except Exception as error:
            tool, note = Answer("failed"), f"{type(error).__name__}: {error}"
        names = tuple(stepwise.select(session))
        left = error_dps(fit(session, _with(names)), truth) if fits else None
        plain = Answer("add" if names else "adequate", names, tuple(id_ for id_, _ in names[:1]), error_dps=left)
        oracle = _oracle(session, truth) if fits else Answer("-")
    faintest = min((detectability(truth, e.id) for e in case.effects), default=0.0)
    return Outcome(case, faintest, {"gyrocal": tool, "stepwise": plain, "oracle": oracle}, note)


def _walk(session: Session, found: Diagnosis, truth: Truth) -> Answer:
    """Add what is named first and ask again, until nothing is named."""
    best, after, model = found.best, found.comparison, None
    named: list[Name] = []
    while best is not None and len(named) < MOST_STEPS:
        named.append((best.effect.id, best.axis))
        if truth.case.kind not in NAMEABLE:
            break
        _, after, model = add(session, model, best.effect.id)
        best = diagnose(session, model).best
    group = found.best.group if found.best is not None else ()
    decisions = tuple(c.decision for c in _on_truth(found, truth.case))
    return Answer(found.verdict, tuple(named), group, decisions, error_dps(after.fit, truth))


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


# --- all cases -----------------------------------------------------------------------------------------------------


def run(cases: Sequence[Case], progress: Progress | None = None, processes: int = PROCESSES) -> list[Outcome]:
    """Every case, in the order given; `progress` hears how many are done, and of how many."""
    threads = ("OPENBLAS_NUM_THREADS", "POLARS_MAX_THREADS")
    before = {name: os.environ.get(name) for name in threads}
    os.environ.update(dict.fromkeys(threads, "1"))  # read by the processes as they start
    outcomes: dict[str, Outcome] = {}
    try:
        with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
            for done in as_completed([pool.submit(judge, case) for case in cases]):
                outcome = done.result()
                outcomes[outcome.case.name] = outcome
                if progress is not None:
                    progress(len(outcomes), len(cases))
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value
    return [outcomes[case.name] for case in cases]


def score(outcomes: Iterable[Outcome], method: str = "gyrocal") -> dict[str, float | None]:
    """The benchmark's figures (docs/blind.md), and `completed_rate`; None where no case bears on a figure."""
    kinds: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        kinds.setdefault(outcome.case.kind, []).append(outcome)
    named = [o for kind in NAMEABLE for o in kinds.get(kind, []) if o.counts]
    if method == "oracle":  # it knows the structure: what it can fit is all that is asked of it
        named = [o for o in named if o.fitted]
        kinds = {}
    elsewhere = [o for kind in ("confounded", "unknown") for o in kinds.get(kind, [])]
    fitted = [o for o in named if o.fitted]
    return {
        "false_alarm_rate": _mean(not o.right(method) for o in kinds.get("null", [])),
        "top1_rate": _mean(o.right(method) for o in named),
        "set_contains_rate": _mean(o.in_group(method) for o in named),
        "mean_set_size": _mean(len(o.answers[method].group) for o in named if o.answers[method].named),
        "confounded_declared_rate": _mean(o.right(method) for o in kinds.get("confounded", [])),
        "unknown_flagged_rate": _mean(o.right(method) for o in kinds.get("unknown", []) if o.counts),
        "misnamed_rate": _mean(o.misnamed(method) for o in [*named, *elsewhere]),
        "error_reduction_ratio": _median(_ratio(o, method) for o in fitted if o.case.kind == "effect"),
        "completed_rate": _mean(o.completed(method) for o in named),
    }


def _ratio(outcome: Outcome, method: str) -> float:
    mine, best = outcome.answers[method].error_dps, outcome.answers["oracle"].error_dps
    assert best is not None
    return float("inf") if mine is None else mine / best


def _mean(values: Iterable[float]) -> float | None:
    listed = list(values)
    return float(np.mean(listed)) if listed else None


def _median(values: Iterable[float]) -> float | None:
    listed = list(values)
    return float(np.median(listed)) if listed else None


def report(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The JSON object of `gyrocal benchmark blind`: the tool's figures, then the others' beside them."""
    kinds = dict.fromkeys(o.case.kind for o in outcomes)
    counts = {kind: sum(o.case.kind == kind and o.counts for o in outcomes) for kind in kinds}
    return {
        **score(outcomes),
        "stepwise_f_test": score(outcomes, "stepwise"),
        "oracle": score(outcomes, "oracle"),
        "cases": counts,
        "too_faint": [o.case.name for o in outcomes if not o.counts],
        "failures": [{"case": o.case.name, "fault": o.fault, "what": o.line()} for o in outcomes if o.fault is not None],
    }
