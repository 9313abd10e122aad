"""One day's model held against another day's session: does it still hold, and what has moved?

The model keeps its parameters. The session's own estimates, the noise and the ordinary tests come from a fit of the same model
to this session. Each parameter is then compared with its own estimate by their combined standard error. So are all parameters
of an axis together, which also shows a change that the session cannot assign to one of them. Frame and clock of a reference
(alignment, time offset, clock drift) are properties of a recording and are those of this session.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.naming import candidates as naming
from gyrocal.diagnosis.residual.angles import Angles
from gyrocal.diagnosis.residual.beyond_errors import beyond_errors
from gyrocal.diagnosis.residual.comparison import Comparison, measure
from gyrocal.diagnosis.residual.drawn_size import most_visible_of
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.levels import Floor, Level, MeanSquares, floor_of, pooled
from gyrocal.diagnosis.residual.parameter_moved import Moved, parameters_moved, strongest_first
from gyrocal.diagnosis.residual.probes import of_session
from gyrocal.effects.base import Role
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.inference import heldout
from gyrocal.inference.excess_error import of_skewed
from gyrocal.inference.expected import of_cycle
from gyrocal.inference.fitted import AxisFit, Fit
from gyrocal.inference.kept import Kept, kept
from gyrocal.plausibility import absent
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.units import to_read

Progress = Callable[[str], None]

ROLES = {Role.BIAS: "level", Role.SCALE: "rate"}
"""The variable against which a change of bias or scale shows."""


def with_values(model: Model | str | Path | None) -> Model:
    """A model that has parameters of its own. Raises InputError for a built-in model or a file without values."""
    opened = Model.open(model)
    if not any(t.values for t in opened.terms):
        raise InputError(
            f"--as-is: the model {opened.name} has no parameters yet; give the file that `gyrocal add` or `gyrocal explain` "
            "fitted to an earlier session, as --model M.toml"
        )
    return opened


def compare_as_is(session: Session, model: Model | str | Path | None, *, progress: Progress | None = None) -> Comparison:
    """Hold a model against a session without fitting its parameters.

    Raises InputError if the model has no parameters of its own, and where an ordinary comparison does.
    """
    opened = with_values(model)
    own = measure(session, opened, about=True, progress=progress)
    held = kept(own.fit, opened)
    if not held.fit.axes:
        raise InputError("--as-is: the model has no values on any axis; give a file that was fitted to an earlier session")
    moved = _moved(own.fit, opened, held)
    found = _as_it_is(own, held)
    where = [*_findings(moved, held, own.judged), *own.where]
    rest = [axis for axis in own.judged if axis in found.per_axis and axis not in {f.axis for f in where}]
    where += beyond_errors(session, found.per_axis, found.angles, own.nearest, rest)
    if not where and not own.implausible:
        judged = naming.candidates(own, unless=POLICY.name_alarm, progress=progress)
        where = naming.findings(own, judged)
    return replace(found, where=where, moved=strongest_first(moved), note=remark(opened, held.unknown_offset))


def _moved(own: Fit, model: Model, held: Kept) -> list[Moved]:
    """Every parameter of the model. Bias and scale of few power cycles differ from those of all by the model's spread too."""
    out = []
    for axis in held.fit.axes:
        estimated = {t.effect_id: t for t in own.axes[axis].terms}
        for term in model.on(axis):
            own_term = estimated.get(term.effect_id) if term.fault is None else None
            out += parameters_moved(term, own_term, held.of_cycles(axis, own.axes[axis], term.effect.role))
    return out


def _as_it_is(own: Comparison, held: Kept) -> Comparison:
    """The comparison's levels with the model's own parameters: all of the session is held out from them."""
    folds = [heldout.whole(held.fit)]
    squares, floors, axes = {}, {}, {}
    for axis, fitted in held.fit.axes.items():
        squares[axis] = MeanSquares.of(heldout.predictions(held.fit.on(axis), folds))
        floor = floor_of(fitted, folds, own.scatter[axis], own.fit.axes[axis])
        floors[axis] = _with_model_error(floor, fitted, held.of_model[axis])
        axes[axis] = fitted
    per_axis = {axis: Level.of(squares[axis], floors[axis]) for axis in axes}
    angles = None if own.angles is None else Angles.of(held.fit, folds, held.of_model)
    return replace(
        own, fit=held.fit, pooled=pooled(squares, floors, absent(own.warnings)), per_axis=per_axis,
        held_out=heldout.SESSION, squares=squares, floors=floors, angles=angles,
    )  # fmt: skip


def _columns(fitted: AxisFit, i: int) -> Array:
    """The shared columns [m, p] of a run in blocks."""
    return np.asarray(fitted.design.columns(i)[1 : 1 + len(fitted.design.layout.fixed)].T)


def _with_model_error(floor: Floor, fitted: AxisFit, cov: Array) -> Floor:
    """The floor with what the errors of the model's own parameters, with covariance [p, p], leave in this session."""
    p = len(cov)
    everything, taken, samples = np.zeros((p, p)), np.zeros((p, p)), 0.0
    cycles: dict[int, list[tuple[Array, Array, Array]]] = {}
    for i, b in enumerate(fitted.design.blocks):
        if b.run.rate_is_mean or not b.t_s.size:
            continue
        x = _columns(fitted, i)
        rate = b.mean(b.run.rate_dps[:, None])[:, 0] if b.run.axis_index == fitted.design.axis else np.zeros(b.t_s.size)
        everything += (x * b.n[:, None]).T @ x
        samples += float(b.n.sum())
        cycles.setdefault(b.scenario, []).append((x, of_cycle(rate), b.n))
    for parts in cycles.values():
        x, o, n = (np.concatenate([part[k] for part in parts]) for k in range(3))
        o = o / np.sqrt(np.maximum(np.mean(o**2, axis=0), 1e-300))
        across = (o * n[:, None]).T @ x
        taken += across.T @ np.linalg.pinv((o * n[:, None]).T @ o, rcond=1e-9, hermitian=True) @ across
    samples = max(samples, 1.0)
    of_all, of_within = everything @ cov / samples, (everything - taken) @ cov / samples
    error, error_within = (_of_squares(m) for m in (of_all, of_within))
    return Floor(
        floor.all + float(np.trace(of_all)), floor.within + max(float(np.trace(of_within)), 0.0),
        float(np.hypot(floor.error, error)), float(np.hypot(floor.error_within, error_within)), floor.white,
    )  # fmt: skip


def _of_squares(form: Array) -> float:
    """The standard error of a sum of as few squares as there are parameters, with the expectation ``trace(form)``, [p, p]."""
    square, cube = (max(0.0, float(np.trace(np.linalg.matrix_power(form, k)))) for k in (2, 3))
    return float(np.sqrt(2 * square)) * of_skewed(2 * square, 8 * cube)


def _findings(moved: Sequence[Moved], held: Kept, judged: Sequence[str]) -> list[Finding]:
    """The parameters that have moved by more than chance, or else all parameters of an axis together; strongest first."""
    moved = [m for m in moved if m.z is not None and m.axis in judged]
    share = POLICY.moved_alarm / max(1, len(moved) + len(judged))
    out = []
    for axis in (a for a in held.fit.axes if a in judged):
        mine = [m for m in moved if m.axis == axis and m.chance < share]
        change = held.change[axis]
        total = held.of_session[axis] + held.of_model[axis]
        square = float(change @ np.linalg.pinv(total, hermitian=True) @ change) if change.size else 0.0
        together = float(tails.chi_square(square, max(change.size, 1)))
        if not mine and together < share:
            names = ", ".join(dict.fromkeys(m.effect for m in strongest_first([m for m in moved if m.axis == axis])))
            note = f"{names or 'the parameters'} together have moved; this session cannot say which"
            out.append(_finding(held, axis, None, float(np.sqrt(max(square - change.size, 0.0))), together, note))
        out += [_finding(held, axis, m, abs(m.z or 0.0), m.chance, words(m)) for m in mine]
    return sorted(out, key=lambda f: -f.strength)


def words(m: Moved) -> str:
    """What has become of a parameter, in words."""
    assert m.session is not None
    unit = "" if m.unit == "fraction" else f" {to_read(m.unit)}"
    return f"{m.effect}: {m.name} is {m.session:.5g}, not {m.file:.5g}{unit} (moved by {m.session - m.file:+.3g} ± {m.se:.2g})"


def _finding(held: Kept, axis: str, moved: Moved | None, strength: float, chance: float, note: str) -> Finding:
    """A change as a finding, with the variable that it follows and the amplitude of the sine with its power."""
    fitted = held.fit.axes[axis]
    change = held.change[axis].copy()
    role = None if moved is None else moved.role
    if moved is not None:
        mine = [fitted.design.terms[i].effect_id == moved.effect for i, _ in fitted.design.layout.fixed]
        change[~np.array(mine, dtype=bool)] = 0.0
    signal = np.concatenate([_columns(fitted, i) @ change for i in range(len(fitted.design.blocks))])
    shapes = [(against, s) for against, some in of_session(held.fit.session, AXES.index(axis)) for s in some]
    followed = most_visible_of(fitted, signal, shapes)
    against = ROLES.get(role) if role is not None else None
    against = against or (followed[0] if followed else ROLES[Role.BIAS])
    return Finding(axis, against, strength, chance, float(np.sqrt(2 * np.mean(signal**2))), note)


def unvalued(model: Model) -> str:
    """A sentence on the effects for which a file has no values; empty if there are none."""
    without = [f"{t.effect_id} on {t.axis}" for t in model.terms if not t.values]
    return f"The file has no value for {', '.join(without)}; these are left out." if without else ""


def remark(model: Model, unknown_offset: Sequence[str]) -> str:
    """What the model does not say, and what this session cannot say on some axes, for the user."""
    axes = ", ".join(unknown_offset)
    offset = (
        f"This is one power cycle, and the file does not say how much the bias of {axes} changes from one to the next: a "
        "change of the bias counts as such an offset."
    )
    return " ".join(part for part in (unvalued(model), offset if axes else "") if part)
