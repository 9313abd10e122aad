"""One sensor over months: its sessions, joined by serial number into one model, and how its parameters age.

Each session is fitted by itself. A parameter is then a straight line over the dates, by generalised least squares: its errors
are those of the sessions and a scatter between them, which is estimated by the weighted scatter about the line (the moment
estimator of a random-effects regression), with the quantiles of Student's distribution, because few sessions tell it. Where the
slope is beyond its errors, the model has the line's value at the latest date, and else the mean of the sessions.
What the biases scatter by is the model's turn-on bias, where the sessions are of one power cycle each.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gyrocal.effects.base import Role, with_role
from gyrocal.error_model.fitted_on import together
from gyrocal.error_model.model import Model
from gyrocal.error_model.term import Term
from gyrocal.errors import InputError
from gyrocal.fleet.listing import sessions
from gyrocal.gravity.fit import fit as fit_by_gravity
from gyrocal.gravity.fit import full
from gyrocal.gravity.scene import Scene
from gyrocal.inference.fit import fit
from gyrocal.noise.axis import AxisNoise
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array, Session

DAYS_A_YEAR = 365.25
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Aging:
    """A parameter over the sessions: its value at the latest date, and its change a year; None with fewer than two dates.

    ``scatter`` is what the sessions differ by beyond their errors and the line.
    """

    effect: str
    axis: str
    name: str
    unit: str
    sessions: int
    value: float
    se: float
    per_year: float | None
    per_year_se: float | None
    scatter: float
    ages: bool


@dataclass(frozen=True)
class History:
    """One sensor's sessions by date, what its parameters do over them, and the model of the latest date."""

    board: str
    dates: tuple[str, ...]
    folders: tuple[str, ...]
    aging: tuple[Aging, ...]
    model: Model

    def to_json(self) -> dict[str, Any]:
        """The sessions and the parameters."""
        listed = [{"session": folder, "made_on": date} for folder, date in zip(self.folders, self.dates, strict=True)]
        return {"board": self.board, "sessions": listed, "parameters": [asdict(a) for a in self.aging]}


def histories(source: str | Path, model: Model | str | Path | None = None, progress: Progress | None = None) -> list[History]:
    """The history of each sensor whose sessions lie in a folder, by the keys ``board`` and ``made_on`` of session.toml.

    Raises InputError for a folder without sessions, one without a board or an ISO date, and a sensor with a single session.
    """
    by_board: dict[str, list[tuple[datetime.date, Session, str]]] = {}
    for folder in sessions(str(source)):
        session = Session.open(folder)
        if not session.board:
            raise InputError(f"{folder}/session.toml: no board; write the sensor's serial number, board = \"SN123\"")
        by_board.setdefault(session.board, []).append((_date(session, folder), session, folder))
    single = next((board for board, found in by_board.items() if len(found) < 2), None)
    if single is not None:
        raise InputError(f"{source}: one session of the board {single}; a history has two or more")
    opened = Model.open(model)
    ordered = {board: sorted(found, key=lambda each: each[0]) for board, found in sorted(by_board.items())}
    return [_history(board, found, opened, progress) for board, found in ordered.items()]


def _date(session: Session, folder: str) -> datetime.date:
    try:
        return datetime.date.fromisoformat(session.made_on or "")
    except ValueError:
        text = f"made_on is {session.made_on!r}" if session.made_on else "no made_on"
        raise InputError(f"{folder}/session.toml: {text}; write the day of the recording, made_on = 2026-03-14") from None


def _history(
    board: str, found: Sequence[tuple[datetime.date, Session, str]], model: Model, progress: Progress | None
) -> History:
    fitted = []
    for date, session, _ in found:
        if progress is not None:
            progress(f"fitting {board} of {date}")
        by_hand = session.reference.kind == "gravity"
        fitted.append(fit_by_gravity(Scene.of(session), full(model)).model if by_hand else fit(session, model).model)
    last = fitted[-1]
    years = np.array([(date - found[-1][0]).days / DAYS_A_YEAR for date, *_ in found])
    aging, terms = [], []
    for term in last.terms:
        units = {p.name: p.unit for p in term.effect.parameters}
        values, se = dict(term.values), dict(term.se)
        for name in term.values:
            same = [m.term(term.effect_id, term.axis) for m in fitted]
            known = [k for k, t in enumerate(same) if t is not None and name in t.values and t.se.get(name)]
            if len(known) < 2 or name.startswith("phase"):
                continue
            one = line(
                years[known], np.array([m.value(term.effect_id, term.axis, name) for m in map(fitted.__getitem__, known)]),
                np.array([t.se[name] for t in map(same.__getitem__, known) if t is not None]),
            )  # fmt: skip
            values[name], se[name] = one.value, one.se
            aging.append(Aging(term.effect_id, term.axis, name, units.get(name, ""), len(known), *one))
        terms.append(replace(term, values=values, se=se))
    noise = dict(last.noise)
    for a in aging:
        if a.effect == with_role(Role.BIAS).id:
            noise[a.axis] = _with_turn_on(last.noise_on(a.axis), a, [m.term(a.effect, a.axis) for m in fitted])
    joined = replace(last, name=board, terms=tuple(terms), noise=noise, fitted_on=together(m.fitted_on for m in fitted))
    dates = tuple(str(date) for date, *_ in found)
    return History(board, dates, tuple(folder for *_, folder in found), tuple(aging), joined)


def _with_turn_on(noise: AxisNoise, bias: Aging, sessions: Sequence[Term | None]) -> AxisNoise:
    """The noise of an axis with what the bias scatters by between sessions, if no session shows more than one power cycle.

    A scatter below two of its own errors is left out: the sessions' errors may be all of it.
    """
    turn_on, freedom = noise.turn_on_bias, bias.sessions - 1 - bias.ages
    if turn_on is None or turn_on.sd_dps is not None or bias.scatter == 0 or freedom < 1:
        return noise
    of_sessions = float(np.mean([t.se[bias.name] ** 2 for t in sessions if t is not None and t.se.get(bias.name)]))
    se = (bias.scatter + of_sessions / bias.scatter) / float(np.sqrt(2 * freedom))
    return noise.having(turn_on.with_values({"sd_dps": bias.scatter}, {"sd_dps": se})) if bias.scatter > 2 * se else noise


class Line(NamedTuple):
    """Value and error at the latest date, slope a year and its error, scatter, and whether the slope counts."""

    value: float
    se: float
    per_year: float | None
    per_year_se: float | None
    scatter: float
    ages: bool


def line(years: Array, y: Array, se: Array) -> Line:
    """A straight line through values [n] with errors [n] at times before the latest date, years (zero and less).

    Two sessions cannot tell ageing from scatter, so their slope never counts.
    """
    sloped = np.column_stack([np.ones_like(years), years])
    mean = _random_effects(sloped[:, :1], y, se)
    if np.ptp(years) == 0:
        return Line(mean.theta[0], mean.se(0), None, None, mean.scatter, False)
    found = _random_effects(sloped, y, se)
    ages = abs(found.theta[1]) > found.limit(POLICY.ages_errors) * np.sqrt(found.cov[1, 1])
    best = found if ages else mean
    return Line(best.theta[0], best.se(0), found.theta[1], found.se(1), best.scatter, bool(ages))


class _Fitted(NamedTuple):
    """Estimate [p], covariance [p, p] and scatter, and how many values more than parameters there are."""

    theta: list[float]
    cov: Array
    scatter: float
    freedom: int

    def limit(self, errors: float) -> float:
        """As many errors of Student's distribution as are as improbable as these of the normal one."""
        from scipy.stats import norm, t

        return float(t.isf(norm.sf(errors), self.freedom)) if self.freedom > 0 else float("inf")

    def se(self, k: int) -> float:
        """The standard error of a parameter, wider where few sessions tell the scatter."""
        wider = self.limit(1.0) if self.freedom > 0 else 1.0
        return wider * float(np.sqrt(self.cov[k, k]))


def _random_effects(x: Array, y: Array, se: Array) -> _Fitted:
    """Weighted least squares with a scatter between the values.

    The scatter is the moment estimator: it makes chi-square its expectation.
    """
    weight = 1 / se**2
    cov = np.linalg.inv(x.T @ (weight[:, None] * x))
    left = y - x @ (cov @ (x.T @ (weight * y)))
    freedom = len(y) - x.shape[1]
    spent = float(weight.sum() - np.trace(cov @ (x.T @ ((weight**2)[:, None] * x))))
    variance = max(0.0, (float(weight @ left**2) - freedom) / spent) if freedom > 0 and spent > 0 else 0.0
    weight = 1 / (se**2 + variance)
    cov = np.linalg.inv(x.T @ (weight[:, None] * x))
    theta = (cov @ (x.T @ (weight * y))).tolist()
    return _Fitted(theta, np.asarray(cov, dtype=np.float64), float(np.sqrt(variance)), freedom)
