"""Find a formula in the data for a misfit that no effect of the library explains.

Two kinds of formula are tried in the variable that the diagnosis calls unknown: a sum of a few smooth terms from a small
library, and a piecewise-linear curve (a linear spline). All terms are fitted together by generalised least squares, with the
noise that remains beside all of them. Stepwise selection by Schwarz's criterion (BIC) decides which terms stay. The held-out
likelihood decides which formula is kept, as it does for every other effect.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gyrocal.diagnosis.answer.add import add
from gyrocal.diagnosis.answer.diagnose import Diagnosis, diagnose
from gyrocal.diagnosis.naming.gains import held_out_gain, total
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects import base
from gyrocal.effects.quantities import turns
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.inference import heldout
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import carried, fit_noise
from gyrocal.inference.nonlinear import refine
from gyrocal.inference.standard_errors import finish
from gyrocal.inference.structure import choose_variant
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.threads import one_thread
from gyrocal.variables.base import symbols, variables
from gyrocal.variables.shapes import ShapeOfEachRun
from gyrocal.variables.terms import hinges

Progress = Callable[[str], None]

RATE_UNIT_DPS = 100.0
"""Products of terms with the rate are divided by this rate, so that their coefficients are in deg/s."""


@dataclass(frozen=True)
class Proposal:
    """A formula for an axis, with its held-out gain in log-likelihood (None if nothing could be left out)."""

    formula: str
    axis: str
    against: str
    terms: int
    gain: float | None
    gain_se: float | None
    unit_gains: Array = field(repr=False)

    def to_json(self) -> dict[str, Any]:
        return {
            "formula": self.formula, "axis": self.axis, "against": self.against, "heldout_gain": self.gain,
            "heldout_gain_se": self.gain_se,
        }  # fmt: skip


@one_thread
def propose(diagnosis: Diagnosis, name: str = "custom", progress: Progress | None = None) -> Proposal:
    """The formula that best explains what a diagnosis calls unknown.

    Raises InputError if the verdict is not ``unknown``, or if no formula improves the fit.
    """
    comparison = diagnosis.comparison
    if diagnosis.best is not None:
        named = diagnosis.best.effect.id
        raise InputError(f"{named} explains it: run `gyrocal add {named}` first, then `gyrocal keep` for what is still unknown")
    if not comparison.where:
        raise InputError("nothing to keep: the model is adequate")
    axis = comparison.where[0].axis
    findings = [f for f in comparison.where if f.axis == axis]
    tried = []
    for against in dict.fromkeys(f.against for f in findings):
        for formula in _formulas(comparison, axis, [f for f in findings if f.against == against], progress):
            if progress is not None:
                progress(f"trying {formula}")
            tried.append(_proposal(comparison, axis, against, FormulaEffect(formula, name)))
    if not tried:
        first = findings[0].against
        raise InputError(f"no formula for what shows on {axis} against {first}: {variables()[first].no_formula}")
    return _simplest_of_the_best(tried)


class Kept(NamedTuple):
    """The formula and the result of adding it: both comparisons, and the model with its parameters fitted to all data."""

    proposal: Proposal
    before: Comparison
    after: Comparison
    model: Model


def keep(
    session: Session, model: Model | str | Path | None = None, name: str = "custom", file: Path | None = None,
    progress: Progress | None = None,
) -> Kept:  # fmt: skip
    """Diagnose, propose a formula for what is unknown, and add it.

    With ``file``, the formula is written to a Python file as an effect that the user can edit, and the model refers to it by
    its id. Without ``file``, the formula is stored in the model. Raises InputError where :func:`propose` does, if the model
    already has an effect of this name, or if ``file`` cannot be created.
    """
    start = Model.open(model)
    FormulaEffect("k*t", name)  # raises if the name is not free
    if name in start.ids:
        raise InputError(f"the model has an effect {name!r} already; give this one another --name")
    if file is not None and (file.exists() or file.suffix != ".py" or not file.absolute().parent.is_dir()):
        raise InputError(f"--file {file}: must be a new .py in an existing folder")
    proposal = propose(diagnose(session, start, progress=progress), name, progress)
    text = proposal.formula
    if file is not None:
        file.write_text(effect_file(proposal, name), encoding="utf-8")
        base.load(file)
        text = name
    return Kept(proposal, *add(session, start, text, progress=progress))


def effect_file(proposal: Proposal, name: str) -> str:
    """The Python source of the proposal as an effect, for a folder given by ``--effects``."""
    title = "".join(part.capitalize() for part in name.split("_"))
    formula = proposal.formula.partition(":")[2].strip()
    against = proposal.against.replace("_", " ")
    return f'''"""Found by `gyrocal keep` on {proposal.axis}, against {against}. Change what you know better."""

from gyrocal.api import FormulaEffect


class {title}(FormulaEffect):
    id = "{name}"

    def __init__(self) -> None:
        super().__init__("{formula}", self.id)
        self.title = "{title}"
        self.cause = "Not known yet."
        self.looks_like = "Not known yet."
        self.measure_next = "Not known yet."
'''


def _formulas(
    comparison: Comparison, axis: str, findings: Sequence[Finding], progress: Progress | None
) -> list[str]:  # fmt: skip
    """Formulas in the variable that these findings depend on."""
    each_run = [f.shape for f in findings if isinstance(f.shape, ShapeOfEachRun)]
    if each_run:
        return type(each_run[0]).formula(each_run)
    variable = variables()[findings[0].against]
    session = comparison.fit.session
    current = comparison.likeliest.axes[axis]
    smooth: list[str] = []
    pieces: list[str] = []
    for symbol in variable.searched:
        values = _values(session, axis, symbol)
        smooth += variable(session.about(axis).runs).terms(symbol, values)
        pieces += hinges(symbol, values)
    if variable.times_rate and turns(session.about(axis).runs, AXES.index(axis)):
        smooth, pieces = ([*terms, *(f"(rate/{RATE_UNIT_DPS:g})*{t}" for t in terms)] for terms in (smooth, pieces))
    formulas = []
    for terms in filter(None, (smooth, pieces)):
        if progress is not None:
            progress(f"choosing among {len(terms)} terms in {', '.join(variable.searched)}")
        chosen = select(current, axis, terms)
        if chosen:
            formulas.append(" + ".join(f"k{i}*{t}" for i, t in enumerate(chosen, start=1)))
    return list(dict.fromkeys(formulas))


def _values(session: Session, axis: str, symbol: str) -> Array:
    """The values of a symbol [n] in all runs of a session that have it."""
    parts = [symbols()[symbol].values(r, AXES.index(axis)) for r in session.about(axis).runs]
    return np.concatenate([p for p in parts if p is not None])


def select(current: AxisFit, axis: str, terms: Sequence[str]) -> list[str]:
    """The terms that BIC keeps, in their order.

    The selection goes forward, and it removes an earlier term if a later one makes it unnecessary.
    """
    library = FormulaEffect(" + ".join(f"k{i}*{t}" for i, t in enumerate(terms)), "library")
    design = current.design.changed([*current.design.terms, Term.of(library, axis, dict.fromkeys(library.linear, 0.0))])
    rich = fit_noise(design, start=carried(current, design))
    layout = design.layout
    mine = {j: column for j, (i, column) in enumerate(layout.fixed) if i == len(design.terms) - 1}
    scale = np.sqrt(np.diag(rich.solution.cov))
    information = np.linalg.inv(rich.solution.cov / np.outer(scale, scale))
    pull = information @ (rich.solution.beta / scale)
    base = [j for j in range(len(layout.fixed)) if j not in mine]
    price = float(np.log(design.n_blocks.sum()))

    def score(chosen: Sequence[int]) -> float:
        """Twice the log-likelihood that these columns gain, minus the penalty of BIC."""
        index = [*base, *chosen]
        part = pull[index]
        return float(part @ np.linalg.lstsq(information[np.ix_(index, index)], part, rcond=None)[0]) - price * len(chosen)

    chosen: list[int] = []
    best = score(chosen)
    while True:
        steps = [[*chosen, j] for j in mine if j not in chosen and len(chosen) < POLICY.most_terms]
        steps += [[k for k in chosen if k != j] for j in chosen]
        scores = [score(s) for s in steps]
        if not scores or max(scores) <= best + 1e-6:
            return [terms[mine[j]] for j in sorted(chosen)]
        best = max(scores)
        chosen = steps[int(np.argmax(scores))]


def _proposal(comparison: Comparison, axis: str, against: str, effect: FormulaEffect) -> Proposal:
    """A formula fitted together with the model, with its held-out gain."""
    current = comparison.likeliest.axes[axis]
    fitted = finish(refine(choose_variant(current, Term.of(effect, axis))))
    gains = held_out_gain(current, fitted, heldout.folds(comparison.likeliest))
    gain, gain_se = total(gains)
    parameters = len(effect.linear) + len(effect.nonlinear)
    return Proposal(f"{effect.id}: {effect.equation}", axis, against, parameters, gain, gain_se, gains)


def _simplest_of_the_best(tried: Sequence[Proposal]) -> Proposal:
    """The proposal with the fewest parameters among those within one standard error of the best held-out gain."""
    best = max(tried, key=lambda p: -np.inf if p.gain is None else p.gain)

    def as_good(p: Proposal) -> bool:
        difference = best.unit_gains - p.unit_gains
        return float(difference.sum()) <= (total(difference)[1] or 0.0)

    return min(filter(as_good, tried), key=lambda p: p.terms)
