"""The fit recovers what was planted, with honest errors; held-out judgement and its units."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gyrocal.error_model.model import Model, Term
from gyrocal.inference import heldout
from gyrocal.inference.axis_fit import fit_axis
from gyrocal.inference.blocks import reduce_run, reduce_session
from gyrocal.inference.fit import fit
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate


def planted(effects: list[str], seed: int = 1, scenarios: int = 6, seconds: float = 30.0) -> tuple[Session, dict]:
    return simulate(None, "paper", effects, seed, scenarios=scenarios, seconds=seconds)


def with_ripple(model: Model) -> Model:
    return model.with_term(Term("table_ripple", "z"))


def test_blocks_average_columns_as_they_average_readings() -> None:
    session, _ = planted([], seconds=5.0, scenarios=1)
    run = session.runs[0]
    t_s = np.delete(run.t_s, slice(200, 260))  # a gap
    frame = run.table.filter(~run.table["t_s"].is_in(run.t_s[200:260]))
    gapped = replace(run, frame=frame)
    b = reduce_run(gapped, 0)
    assert np.all(b.n == b.n[0])
    np.testing.assert_allclose(b.mean(t_s[:, None])[:, 0], b.t_s)
    np.testing.assert_allclose(b.mean(gapped.gyro_dps)[:, 0], b.y_dps[:, 0])
    spans = [gapped.t_s[int(s + k) - 1] - gapped.t_s[s] for s, k in zip(b.start, b.n, strict=True)]
    assert max(spans) < 0.11  # no block spans the gap


def test_likelihood_is_the_dense_mixed_model_s() -> None:
    """REML of one run against scipy's multivariate normal with every random term in a dense covariance."""
    session, _ = planted(["table_ripple"], scenarios=1, seconds=8.0)
    blocks = reduce_session(session)[:1]
    terms = [
        Term("bias", "z", {"bias_dps": 0.0}),
        Term("table_ripple", "z", {"amplitude_1": 0.0}),
    ]
    found = fit_axis(blocks, 2, terms, AxisNoise(drift=Drift()))
    b, noise = blocks[0], found.noise
    drift = noise.ou_sd_dps**2 * np.exp(-np.abs(b.t_s[:, None] - b.t_s) / noise.ou_tau_s)
    waves = b.mean(terms[1].effect.columns(b.run, 2, {"amplitude_1": 0.0}))
    v = np.diag(noise.white_sd_dps**2 / b.n) + drift + found.spreads.run[0] ** 2 * waves @ waves.T
    ones = np.ones(b.n.size)
    information = ones @ np.linalg.solve(v, ones)
    mean = ones @ np.linalg.solve(v, b.y_dps[:, 2]) / information
    dense = (
        multivariate_normal(mean * ones, v).logpdf(b.y_dps[:, 2]) - 0.5 * np.log(information) + 0.5 * np.log(2 * np.pi)
    )
    assert found.loglik == pytest.approx(dense, abs=1e-6)
    assert found.solution.beta[0] == pytest.approx(mean, rel=1e-6)


def test_planted_ripple_is_recovered() -> None:
    session, truth = planted(["table_ripple:amplitude_1=0.001"])
    found = fit(session, with_ripple(Model.builtin("default")), axes=["z"]).axes["z"]
    values = next(t for t in found.terms if t.effect_id == "table_ripple").values
    assert set(values) == {"amplitude_1"}
    assert values["amplitude_1"] == pytest.approx(0.001, rel=0.05)
    scale = next(t for t in found.terms if t.effect_id == "scale")
    assert scale.values["scale"] == pytest.approx(truth["runs"][0]["scale"][2], abs=4 * scale.se["scale"])


def test_planted_transient_is_recovered() -> None:
    session, _ = planted(["spin_up:A=0.002,tau_s=3"])
    found = fit(session, Model.builtin("default").with_term(Term("spin_up", "z")), axes=["z"]).axes["z"]
    term = next(t for t in found.terms if t.effect_id == "spin_up")
    assert abs(term.values["A"] - 0.002) < 4 * term.se["A"]
    assert abs(term.values["tau_s"] - 3.0) < 4 * term.se["tau_s"]
    assert term.se["A"] < 2e-4


def test_errors_are_honest() -> None:
    """68 % intervals of scale and bias cover the truth in 68 % of sessions, drift and turn-on bias and all."""
    inside = []
    for seed in range(60):
        session, truth = planted([], seed=100 + seed, scenarios=6, seconds=12.0)
        found = fit(session, Model.builtin("default"), axes=["z"]).axes["z"]
        scale = next(t for t in found.terms if t.effect_id == "scale")
        inside.append(abs(scale.values["scale"] - truth["runs"][0]["scale"][2]) < scale.se["scale"])
    assert 0.5 < np.mean(inside) < 0.85  # binomial spread of 60 trials is 6 %


def test_an_axis_about_which_nothing_turns_has_no_scale() -> None:
    session, _ = planted([], scenarios=3, seconds=8.0)
    found = fit(session, Model.builtin("default"), axes=["x"]).axes["x"]
    assert next(t for t in found.terms if t.effect_id == "scale").values == {}
    assert "bias_dps" in next(t for t in found.terms if t.effect_id == "bias").values


@pytest.mark.parametrize(
    ("scenarios", "kind"), [(6, "day"), (1, "time")],
)  # fmt: skip
def test_what_is_held_out(scenarios: int, kind: str) -> None:
    session, _ = planted([], scenarios=scenarios, seconds=30.0)
    folds = heldout.folds(fit(session, Model.builtin("default"), axes=["z"]))
    if kind == "day":
        assert [f.label for f in folds] == [str(d) for d in session.days]
        assert sorted(i for f in folds for i in f.runs) == list(range(12))
    else:
        assert all(f.time is not None for f in folds)


def test_without_days_scenarios_are_held_out_and_short_single_runs_nothing() -> None:
    session, _ = planted([], scenarios=4, seconds=8.0)
    undated = session.with_runs(replace(r, day=None) for r in session.runs)
    assert [f.label for f in heldout.folds(fit(undated, Model.builtin("default"), axes=["z"]))] == session.scenarios
    one = undated.with_runs(undated.runs[:2])
    assert heldout.folds(fit(one, Model.builtin("default"), axes=["z"])) == []


def test_held_out_predictions_never_saw_their_day() -> None:
    """Spoiling a day's readings changes what is predicted for the others, not for itself."""
    session, _ = planted([], scenarios=6, seconds=8.0)
    spoiled = session.with_runs(
        r if r.day != 1 else replace(r, frame=r.table.with_columns(r.table["gz_dps"] + 0.5)) for r in session.runs
    )
    predicted = []
    for s in (session, spoiled):
        # the same noise and spreads in both, so that only the parameters' data differ
        found = fit(s, Model.builtin("paper"), axes=["z"])
        predicted.append({p.run.file: p.modelled_dps[0] for p in heldout.predictions(found, heldout.folds(found))})
    for r in session.runs:
        change = abs(predicted[0][r.file] - predicted[1][r.file])
        assert (change < 1e-12) == (r.day == 1), r.file
