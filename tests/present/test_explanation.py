"""What the page of an explanation draws for a step."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import Diagnosis
from gyrocal.diagnosis.answer.explain import Step
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects.base import effects
from gyrocal.error_model.model import Model
from gyrocal.present.explanation import counted, evidence, removed, shown
from gyrocal.present.pictures import waterfall
from gyrocal.present.report import verdict_text
from make_runs import make_run, make_session


def test_a_step_is_drawn_against_what_it_removed_also_if_its_delay_moves_the_blocks() -> None:
    """A delay of a swing in proportion to the change of the rate, which leaves the first samples without a reference."""
    rng = np.random.default_rng(3)
    t_s = np.arange(0, 20, 0.02)
    runs = []
    for k in range(2):
        rate_dps, late_dps = (60 * np.sin(2 * np.pi * 0.6 * (t_s - delay_s) + k) for delay_s in (0.0, 0.03))
        gyro = rng.normal(0, 0.02, (t_s.size, 3)) + np.outer(late_dps, [0, 0, 1])
        runs.append(make_run(t_s, gyro, rate_ref_dps=rate_dps, scenario=f"s{k}"))
    session = make_session(*runs)
    model = Model.builtin("default")
    step = Step(("lag",), ("z",), (), measure(session, model), measure(session, model.add("lag", "z")))
    finding = removed(step)
    assert finding is not None
    assert (finding.axis, finding.against) == ("z", "rate")
    assert "in proportion to the change of the rate" in shown(finding)
    assert finding.amplitude_dps == pytest.approx(60 * 2 * np.pi * 0.6 * 0.03, rel=0.2)
    figure = evidence(step)
    assert figure is not None
    assert figure.axes[0].get_xlabel() == "change of the rate, dps/s"


def test_a_page_says_over_which_floor_its_errors_are_counted() -> None:
    """The excess of the same model was 50.90 mdps by `compare` and 51.01 mdps on this page, which did not say why."""

    def side(floor_dps: float) -> SimpleNamespace:
        return SimpleNamespace(angles=None, pooled=SimpleNamespace(floor_dps=floor_dps, excess_dps=0.05))

    step = Step(("table_ripple",), ("z",), (), side(0.04473), side(0.04473))  # type: ignore[arg-type]
    assert "beyond the noise floor of the final model, 44.73 mdps" in counted([step])
    assert counted([]) == ""
    assert counted([step, replace(step, after=side(0.05))]) == ""
    assert counted([replace(step, within=True)]) == ""


def test_a_variable_is_called_by_its_quantity() -> None:
    told = shown(Finding("z", "power_on_time", 5.0, 1e-6, 0.005, "rms 3.52 mdps"))
    assert told == "The residual on z shows it against time since power-on: rms 3.52 mdps."


def test_the_bars_of_a_step_say_from_where_to_where_the_error_fell() -> None:
    (axes,) = waterfall(["given model", "+ table_ripple"], [0.05101, 0.0015], 0.04473).axes
    assert [text.get_text().strip() for text in axes.texts] == ["51.01", "51.01 → 1.50"]
    assert {text.get_text() for text in axes.get_legend().get_texts()} >= {"left over", "removed by the step"}


def test_the_verdict_names_every_axis_of_the_missing_effect() -> None:
    kind = effects()["g_sensitivity"]
    found = [Candidate(kind, "z", "add"), Candidate(kind, "x", "add"), Candidate(kind, "y", "suggest")]
    compared = SimpleNamespace(fit=SimpleNamespace(session=SimpleNamespace(runs=())))
    diagnosis = Diagnosis("add", found, None, compared)  # type: ignore[arg-type]
    assert verdict_text(diagnosis).startswith("Missing: sensitivity to gravity and acceleration on x, z. ")
