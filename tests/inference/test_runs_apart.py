"""A transient whose time constant is each run's own: the fit finds it out, and nothing is left to be explained."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.residual.comparison import Comparison, measure
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from known import ON_Z

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Session, Comparison, list[dict[str, float]]]:
    """A session whose runs' transients differ, compared with the model that has them; the transients planted."""
    folder = tmp_path_factory.mktemp("apart") / "session"
    simulate(folder, "table2", seed=5, scenarios=16, seconds=30.0, parquet=True)
    session = Session.open(folder)
    planted = json.loads(folder.with_suffix(".truth.json").read_text())["runs"]
    transients = [next(e for e in run["effects"] if e["id"] == "spin_up") for run in planted]
    return session, compare(session, ON_Z.add("table_ripple").add("spin_up")), transients


@pytest.mark.wide
def test_each_run_is_given_its_own_time_constant(told: tuple[Session, Comparison, list[dict[str, float]]]) -> None:
    _, comparison, planted = told
    term = comparison.fit.model.term("spin_up", "z")
    assert term is not None
    tau_s = np.array([e["tau_s"] for e in planted])
    size = np.abs([e["A"] for e in planted])
    found_s = np.array([term.of_run[i]["tau_s"] for i in range(len(planted))])
    large = size > np.median(size)
    spread = float(np.std(np.log(tau_s)))
    assert np.std(np.log(found_s / tau_s)[large]) < 0.5 * spread
    assert term.values["tau_s"] == pytest.approx(np.exp(np.log(tau_s).mean()), abs=3 * term.se["tau_s"])
    assert term.values["tau_s_sd"] / term.values["tau_s"] == pytest.approx(spread, rel=3 / np.sqrt(2 * tau_s.size))


def test_then_the_model_fits_and_nothing_is_missing(told: tuple[Session, Comparison, list[dict[str, float]]]) -> None:
    session, comparison, _ = told
    assert comparison.verdict == "adequate"
    assert diagnose(session, comparison.fit.model).verdict == "adequate"


def test_one_time_constant_for_all_runs_stays_one(tmp_path: Path) -> None:
    """The sizes differ from run to run, the time constant does not."""
    folder = tmp_path / "session"
    simulate(folder, "full", ["spin_up:tau_s=3"], seed=3, scenarios=2, seconds=30.0, parquet=True)
    comparison = measure(Session.open(folder), ON_Z.add("spin_up"))
    term = comparison.fit.model.term("spin_up", "z")
    assert term is not None
    assert not term.of_run
    assert "tau_s_sd" not in term.values
    assert term.values["tau_s"] == pytest.approx(3.0, abs=4 * term.se["tau_s"])
