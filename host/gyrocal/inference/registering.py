"""The frame and clock of a reference relative to the sensor's, estimated together with the model and the noise.

The readings of each axis are fitted with the model and, beside it, the true rates about the other axes and the derivatives by
the clock's offset and drift. The three fits are combined by their information: offset and drift are common, and the map
``I + D`` of the nine rates is a scale, a rotation by which the alignment moves, and, if the model has a misalignment, a
symmetric part. The step is repeated until nothing moves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from gyrocal.effects.base import Effect, Role, stack
from gyrocal.effects.misalignment import Misalignment
from gyrocal.effects.quantities import rate_noise, true_rate_dps
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.axis_fit import fit_axis
from gyrocal.inference.blocks import reduce_session
from gyrocal.inference.design import Design
from gyrocal.inference.fitted import AxisFit
from gyrocal.noise.axis import AxisNoise
from gyrocal.recording.register import FIRST_S, registered
from gyrocal.recording.registration import (
    UNKNOWN_ROTATION,
    ReferenceParameter,
    Registration,
    RegistrationFit,
    Structure,
    rotation_deg,
    structured,
)
from gyrocal.recording.session import AXES, Array, Run, Session

STEPS = 4
SETTLED = 0.05
"""The registration has settled if a step moves each of its parameters by less than this fraction of its standard error."""
DRIFT_SD = 1e-4
"""Standard deviation of the drift of two clocks before the data speak: crystals are within 20 to 100 ppm. It is the
size of the drift itself where that is larger, and counts in recordings of less than ``FIRST_S``."""
TIMES = ("offset_s", "e")
"""Names of the clock's parameters, which follow the nine elements of the map."""
ROTATION = ("rx_deg", "ry_deg", "rz_deg")
DIFFERENCE_DEG = 1e-4
"""Step of the derivative of the rotation vector, deg."""


class _Map(Effect):
    """The columns that correct a registration: the rates about the other axes, and derivatives by offset and drift."""

    id = "registration"
    title = equation = cause = looks_like = measure_next = ""
    parameters = ()
    linear = (*AXES, *TIMES)

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        measured = run.measured_rates
        if measured is None or not measured.motions:
            return np.zeros((len(run), len(self.coding.used(values))))
        slope = measured.slope_about(axis, run.registration)
        of_time = {"offset_s": -slope, "e": (run.sample_s - run.sample_s[0]) * slope}
        return stack(*(of_time[n] if n in of_time else true_rate_dps(run.about(n)) for n in self.coding.used(values)))

    def noise(self, run: Run, axis: int, values: Mapping[str, float], samples: float) -> tuple[Array, float] | None:
        found = [rate_noise(run.about(n), AXES.index(n), samples) if n in AXES else None for n in self.coding.used(values)]
        if all(f is None for f in found):
            return None
        return stack(*(np.zeros(len(run)) if f is None else f[0] for f in found)), max(f[1] for f in found if f is not None)


def refined(session: Session, model: Model) -> Session:
    """The session with its reference's registration estimated with the model; the session itself if it needs none."""
    session = registered(session)
    start = session.registration_fit
    if start is None:
        return session
    names = [name for effect, name, _, _ in start.parameters if effect != "alignment"]
    for _ in range(STEPS):
        step = _step(session, model, names)
        before = session.runs[0].registration
        turned = Registration(tuple(np.rad2deg(step.rotation))).matrix
        rotation = rotation_deg(turned @ before.matrix)
        after = Registration(rotation, before.offset_s + step.others[0], before.drift + step.others[1])
        session = session.with_runs(r.registered(after) for r in session.runs)
        moved = np.concatenate([step.rotation, step.others])
        if np.all(np.abs(moved) <= SETTLED * np.sqrt(np.diag(step.cov)) + 1e-15):
            break
    return replace(session, registration_fit=replace(start, registration=after, parameters=_parameters(after, step, start)))


def symmetric(terms: Mapping[tuple[str, str], Term]) -> dict[tuple[str, str], Term]:
    """The terms by effect and axis, with the misalignment made symmetric: m_y on x and m_x on y are their mean.

    The alignment is where the antisymmetric part is zero, so the two differ only by what the noise's weights make of it. Their
    errors are independent.
    """
    out = dict(terms)
    mine = {t.axis: (key, t) for key, t in terms.items() if isinstance(t.effect, Misalignment)}
    for a, b in combinations(sorted(mine), 2):
        (key_a, of_a), (key_b, of_b) = mine[a], mine[b]
        pair = ((of_a, f"m_{b}"), (of_b, f"m_{a}"))
        if any(name not in t.values or name not in t.se for t, name in pair):
            continue
        mean = sum(t.values[name] for t, name in pair) / 2
        se = sum(t.se[name] ** 2 for t, name in pair) ** 0.5 / 2
        for key, (_, name) in zip((key_a, key_b), pair, strict=True):
            out[key] = replace(out[key], values={**out[key].values, name: mean}, se={**out[key].se, name: se})
    return out


def _step(session: Session, model: Model, names: Sequence[str]) -> Structure:
    reduced = reduce_session(session)
    information, score = np.zeros((11, 11)), np.zeros(11)
    for axis in AXES if session.three_axes else dict.fromkeys(r.axis for r in session.runs):
        i = AXES.index(axis)
        others = [name for name in AXES if name != axis] if session.three_axes else []
        kept = [t for t in model.on(axis) if not isinstance(t.effect, Misalignment)]
        term = Term.of(_Map(), axis, dict.fromkeys([*others, *names], 0.0))
        noise = model.noise_on(axis) if model.on(axis) else AxisNoise()
        current = fit_axis([b.about(axis) for b in reduced], i, [*kept, term], noise)
        own = _of_axis(current, i, axis)
        information[np.ix_(own.places, own.places)] += own.information
        score[own.places] += own.score
    if "e" in names and max(run.duration_s for run in session.runs) < FIRST_S:
        drift = session.runs[0].registration.drift
        sd = max(DRIFT_SD, abs(drift))
        information[-1, -1] += sd**-2
        score[-1] -= drift / sd**2
    return structured(information, score, _pairs(model))


def _pairs(model: Model) -> list[tuple[int, int]]:
    """The pairs of axes between which the model allows a misalignment."""
    mine = {AXES.index(t.axis) for t in model.terms if isinstance(t.effect, Misalignment)}
    return [pair for pair in combinations(range(3), 2) if mine & set(pair)]


class _AxisEstimate(NamedTuple):
    """What an axis shows of some of the eleven parameters: their places [p], and their information [p, p] and score [p]."""

    places: list[int]
    information: Array
    score: Array


def _of_axis(current: AxisFit, i: int, axis: str) -> _AxisEstimate:
    """What the fit of an axis shows. Where rates depend on each other, as where the reference turns about one axis only, the
    readings show sums of the map's elements alone.
    """
    design = current.design
    fixed, asked = enumerate(design.layout.fixed), enumerate(design.asked)
    kept = [(j, place) for j, column in fixed if (place := _place(design, column, i, axis)) is not None]
    columns, places = [j for j, _ in kept], [place for _, place in kept]
    weight: Array = np.asarray(np.linalg.inv(current.solution.cov[np.ix_(columns, columns)]), dtype=np.float64)
    values: Array = current.solution.beta[columns]
    own = 1 + sum(float(value) for place, value in zip(places, values, strict=True) if place == 4 * i)
    sums = np.eye(len(places))
    if design.sums is not None:
        whole = [(j, place) for j, column in asked if (place := _place(design, column, i, axis)) is not None]
        places = [place for _, place in whole]
        sums = design.sums[np.ix_(columns, [j for j, _ in whole])]
    sums = sums * [own if place >= 9 else 1.0 for place in places]  # what a later clock changes, the axis reads with its scale
    return _AxisEstimate(places, np.asarray(sums.T @ weight @ sums), np.asarray(sums.T @ weight @ values))


def _place(design: Design, column: tuple[int, int], i: int, axis: str) -> int | None:
    """The place of a column's coefficient among the eleven parameters; None if it is none of them."""
    term = design.terms[column[0]]
    name = axis if term.effect.role is Role.SCALE else ""
    if isinstance(term.effect, _Map):
        name = term.effect.coding.used(term.values)[column[1]]
    if not name:
        return None
    return 9 + TIMES.index(name) if name in TIMES else 3 * i + AXES.index(name)


def _parameters(found: Registration, step: Structure, start: RegistrationFit) -> tuple[ReferenceParameter, ...]:
    """The parameters by name, as those of the first estimate, with their standard errors (None if nothing shows one)."""
    names = {p.name for p in start.parameters}
    values = {"offset_s": (found.offset_s, np.sqrt(step.cov[3, 3])), "e": (found.drift, np.sqrt(step.cov[4, 4]))}
    if names & set(ROTATION):
        rotation_se = _rotation_se_deg(found, step)
        shown_se = np.where(rotation_se < np.rad2deg(UNKNOWN_ROTATION), rotation_se, np.inf)
        values |= dict(zip(ROTATION, zip(found.rotation_deg, shown_se, strict=True), strict=True))
    errors = {name: float(se) if np.isfinite(se) else None for name, (_, se) in values.items()}
    return tuple(ReferenceParameter(p.effect, p.name, float(values[p.name][0]), errors[p.name]) for p in start.parameters)


def _rotation_se_deg(found: Registration, step: Structure) -> Array:
    """Standard errors of the rotation vector [3], deg, from the covariance of a small rotation after it."""
    jacobian = np.zeros((3, 3))
    for k in range(3):
        turn = Registration(tuple(DIFFERENCE_DEG * np.eye(3)[k])).matrix
        ends = [np.array(rotation_deg(m @ found.matrix)) for m in (turn, turn.T)]
        jacobian[:, k] = (_nearest(ends[0], found) - _nearest(ends[1], found)) / (2 * np.deg2rad(DIFFERENCE_DEG))
    return np.asarray(np.sqrt(np.diag(jacobian @ step.cov[:3, :3] @ jacobian.T)))


def _nearest(vector_deg: Array, found: Registration) -> Array:
    """The rotation vector, of the two of one rotation near half a turn, that is nearer to the registration's."""
    size = float(np.linalg.norm(vector_deg))
    other = vector_deg * (1 - 360 / size) if size > 0 else vector_deg
    return min((vector_deg, other), key=lambda v: float(np.linalg.norm(v - np.array(found.rotation_deg))))
