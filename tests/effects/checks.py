"""What every effect is held to, whoever wrote it: its law, and the cases of its file."""

from dataclasses import replace

import numpy as np

from gyrocal.effects.base import Case, Effect
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Run
from gyrocal.simulation.simulate import simulate

from .conftest import Array, MakeRun

CAMPAIGN_SIZES = {"paper": (9, 30.0), "full": (3, 15.0), "swing": (2, 30.0), "shaker": (3, 15.0), "chamber": (2, 700.0)}
"""Scenarios and seconds a run."""


def showing(kind: Effect, measured: Run, table_rate_dps: float = 78.0) -> Run:
    """A run with a measured rate, or the same at a stated one if only that shows the effect: an error of the stated rate."""
    stated = replace(measured, table_rate_dps=table_rate_dps, frame=measured.frame.drop("rate_ref_dps"))
    hidden = kind.missing([measured], 2) is not None and kind.missing([stated], 2) is None
    return stated if hidden else measured


def check_law(kind: Effect, rich_run: Run) -> None:
    """The term on the table's axis is what the file's formula says, computed by the parser of formulas."""
    assert kind.law is not None
    assert kind.law.reads is not None
    run = showing(kind, rich_run)
    reads = FormulaEffect(f"k*({kind.law.reads})").columns(run, run.axis_index, {})[:, 0]
    term = kind.term(run, run.axis_index, kind.law.values)
    assert np.max(np.abs(term - reads)) <= 1e-12 * np.max(np.abs(reads))


def check_degree(kind: Effect, make_run: MakeRun) -> None:
    """Twice the rate gives twice, four or eight times the term; turned round, the rate turns odd terms round."""
    assert kind.law is not None
    t_s = np.arange(1500) / 100
    values = kind.draw({}, np.random.default_rng(2))

    def term(factor: float) -> Array:
        run = make_run(
            t_s, power_on_s=2.0, temp_c=20 + t_s, ax_g=0.1, ay_g=0.0, az_g=1.0, table_angle_deg=40 * t_s,
            rate_ref_dps=factor * (60 + 30 * np.sin(t_s)),
        )  # fmt: skip
        return kind.term(showing(kind, run, factor * 60.0), 2, values)

    one = term(1.0)
    assert np.any(one)
    np.testing.assert_allclose(term(2.0), one * 2.0**kind.law.degree, rtol=1e-9, atol=1e-12)
    sign = -1.0 if kind.law.degree % 2 and not kind.law.even else 1.0
    np.testing.assert_allclose(term(-1.0), sign * one, rtol=1e-9, atol=1e-12)


def check_case(kind: Effect, case: Case) -> None:
    """What was planted is found within 3.5 standard errors, and these are a quarter of the value at most."""
    scenarios, seconds = CAMPAIGN_SIZES[case.campaign]
    session, _ = simulate(None, case.campaign, [(kind.id, case.values)], seed=11, scenarios=scenarios, seconds=seconds)
    model = Model.builtin("default").with_term(Term(kind.id, case.axis))
    found = fit(session, model, axes=case.axis).model.term(kind.id, case.axis)
    assert found is not None
    for name in case.recovers:
        truth, value, se = case.values[name], found.values[name], found.se[name]
        assert abs(value - truth) < 3.5 * se, f"{name}: {value:.4g} +- {se:.2g}, planted {truth:.4g}"
        assert se < abs(truth) / 4
