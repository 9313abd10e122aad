"""The task of one session: read it, fit the model, and keep a summary in the results folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import gyrocal
from gyrocal.effects.base import Role
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.files import replace_text
from gyrocal.fleet.candidates import cycle_equations
from gyrocal.fleet.drift import FleetDrift, loglik_at, loglik_of
from gyrocal.fleet.listing import at_hand
from gyrocal.fleet.summary import AxisSummary, Summary
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import AxisFit, Fit
from gyrocal.plausibility import check
from gyrocal.plausibility.noise import own_sd_dps
from gyrocal.recording.session import AXES, Session
from gyrocal.warning import Warning

CODE = ("policy", "recording", "noise", "effects", "variables", "error_model", "inference", "plausibility", "fleet")
"""The folders on whose code a summary depends."""


@dataclass(frozen=True)
class Done:
    """The outcome of a task: the file of its summary, or the reason why there is none."""

    session: str
    key: str = ""
    reason: str = ""


def work(path: str, model: Model, drifts: Mapping[str, FleetDrift], results: str) -> Done:
    """Summarise one session, unless the results folder has its summary already. Every failure becomes a reason."""

    def summary(folder: Path, target: Path) -> None:
        summarise(folder, path, model, drifts).save(target)

    return _kept(path, summary, model, repr(sorted(drifts.items())), Path(results), ".npz")


def listen(path: str, model: Model, results: str) -> Done:
    """Store the likelihood of the drift from one session (:func:`gyrocal.fleet.drift.loglik_of`) unless it is stored."""

    def drift(folder: Path, target: Path) -> None:
        found = {axis: loglik_of(one) for axis, one in plain_fit(_opened(folder, model)[0], model).items()}
        replace_text(target, json.dumps(found), durable=False)

    return _kept(path, drift, model, "", Path(results), ".drift.json")


def _kept(path: str, make: Callable[[Path, Path], None], model: Model, given: str, results: Path, ending: str) -> Done:
    try:
        with at_hand(path) as folder:
            key = key_of(folder, model, given)
            if not (results / f"{key}{ending}").is_file():
                make(folder, results / f"{key}{ending}")
        return Done(path, key)
    except Exception as error:
        words = " ".join(str(error).split())
        return Done(path, reason=words if isinstance(error, InputError) else f"{type(error).__name__}: {words}")


def key_of(folder: Path, model: Model, given: str = "") -> str:
    """A name for everything that a summary depends on: the session's files, the model, ``given`` and the code."""
    digest = hashlib.blake2b(digest_size=16)
    for file in sorted(path for path in folder.rglob("*") if path.is_file()):
        digest.update(str(file.relative_to(folder)).encode() + b"\0" + file.read_bytes())
    digest.update(model.toml().encode() + given.encode() + code_digest())
    return digest.hexdigest()


def digest_of(model: Model) -> str:
    """A name for the model and the code, which the sessions of a fleet have in common."""
    return hashlib.blake2b(model.toml().encode() + code_digest(), digest_size=16).hexdigest()


@cache
def code_digest() -> bytes:
    """A digest of the program's version and of the code on which a summary depends."""
    root = Path(gyrocal.__file__).parent
    digest = hashlib.blake2b(gyrocal.__version__.encode(), digest_size=16)
    for layer in CODE:
        for file in sorted((root / layer).glob("*.py")):
            digest.update(file.read_bytes())
    return digest.digest()


def _opened(folder: Path, model: Model) -> tuple[Session, list[Warning]]:
    """A session and its warnings. Raises InputError if a warning blocks its own axis, because its figures are wrong then."""
    session = Session.open(folder)
    warnings = check(session, model)
    against = next((w for w in warnings if w.blocks(session.axis)), None)
    if against is not None:
        raise InputError(f"{against.code}: {against.text}")
    return session, warnings


def summarise(folder: Path, name: str, model: Model, drifts: Mapping[str, FleetDrift]) -> Summary:
    """Fit the model to a session, with the fleet's drift of each axis, which one board hardly determines."""
    session, warnings = _opened(folder, model)
    whole = _plain(session, of_fleet(model, drifts))
    fitted, fitted_on = whole.axes, whole.model.fitted_on
    return Summary(
        name, session.board or name, session.rig, session.line, session.made_on, _codes(warnings),
        {axis: _summary_of(session, one, drifts.get(axis)) for axis, one in fitted.items() if one.design.layout.fixed},
        dict(fitted_on.ranges), fitted_on.corrected,
    )  # fmt: skip


def of_fleet(model: Model, drifts: Mapping[str, FleetDrift]) -> Model:
    """The model with a drift that is known, where it has a drift."""
    known = {
        axis: replace(noise, drift=replace(noise.drift, known=(drifts[axis].size, drifts[axis].tau_s)))
        for axis, noise in model.noise.items() if noise.drift is not None and axis in drifts
    }  # fmt: skip
    return replace(model, noise={**model.noise, **known})


def plain_fit(session: Session, model: Model) -> dict[str, AxisFit]:
    """The ordinary fit of each axis. A term with a single variant gets it at once, which saves the search for the structure."""
    return _plain(session, model).axes


def _plain(session: Session, model: Model) -> Fit:
    terms = tuple(_settled(term, session) for term in model.terms)
    return fit(session, replace(model, terms=terms))


def _settled(term: Term, session: Session) -> Term:
    kind = term.effect
    if term.values or kind.nonlinear or kind.fault is not None:
        return term
    variants = kind.variants(session.runs, AXES.index(term.axis))
    return replace(term, values=variants[0]) if len(variants) == 1 else term


def _codes(warnings: Sequence[Warning]) -> tuple[str, ...]:
    return tuple(sorted({f"{w.code}:{w.axis}" if w.axis else w.code for w in warnings}))


def _noise_of_samples(session: Session, axis: int) -> dict[str, float]:
    """The noise of one sample and its standard error, deg/s; nothing for an axis whose readings do not change.

    A mean square of n successive changes has the relative variance 3/n for white noise, and the median over runs 1.57 times
    that of the mean.
    """
    sd_dps, samples = own_sd_dps(session, axis), sum(map(len, session.runs))
    return {} if sd_dps is None else {"sample_sd_dps": sd_dps, "sample_sd_se_dps": sd_dps * (1.57 * 0.75 / samples) ** 0.5}


def _summary_of(session: Session, fitted: AxisFit, drift: FleetDrift | None) -> AxisSummary:
    layout, axis = fitted.design.layout, AXES[fitted.design.axis]
    terms = fitted.design.terms
    columns = tuple(f"{terms[i].effect_id}.{axis}.{terms[i].effect.coding.used(terms[i].values)[j]}" for i, j in layout.fixed)
    named = [(f"{t.effect_id}.{axis}.{n}", v, t.se.get(n)) for t in fitted.terms for n, v in t.values.items()]
    noises = [fitted.noise] if drift is None else [near.noise(fitted.noise) for near in drift.near]
    candidates, cycles = cycle_equations(fitted, noises)
    noise = {
        "white_sd_dps": fitted.noise.white_sd_dps, "drift_sd_dps": fitted.noise.ou_sd_dps,
        "drift_tau_s": fitted.noise.ou_tau_s,
    }  # fmt: skip
    noise |= _noise_of_samples(session, fitted.design.axis)
    if fitted.noise_model.turn_on_bias is not None:
        noise["turn_on_bias_dps"] = fitted.scenario_sd(fitted.spreads.scenario, Role.BIAS)
    return AxisSummary(
        columns, tuple(candidates), layout.scenario, tuple(map(float, fitted.spreads.scenario)),
        {n: float(v) for n, v, _ in named}, {n: float(se) for n, _, se in named if se is not None}, noise,
        fitted.solution.cov, cycles, () if drift is None else tuple(loglik_at(fitted, drift.near)),
    )  # fmt: skip
