"""Users' own effects: a formula is parsed, never run; it and a file in a folder are equal to the built-in ones."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyrocal.cli import main
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.effects import base
from gyrocal.error_model.formula import FormulaEffect, effect_or_formula
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from known import ON_Z, add_measured

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")


@pytest.fixture(scope="module")
def session() -> Session:
    return simulate(None, "paper", [], 4, scenarios=6, seconds=20.0)[0]


def with_signal(session: Session, signal) -> Session:
    return session.with_runs(replace(r, frame=r.table.with_columns(gz_dps=r.gyro_dps[:, 2] + signal(r))) for r in session.runs)


def test_columns_are_the_formula_s_value(session: Session) -> None:
    run = session.runs[1].as_measured()
    kind = FormulaEffect("k1*sin(3*theta) - k2*temp_c*rate/2 + k3*exp(-t/tau); tau=5")
    assert (kind.linear, kind.nonlinear) == (("k1", "k2", "k3"), ("tau",))
    columns = kind.columns(run, 2, {"tau": 4.0})
    theta = np.deg2rad(run.table_rate_dps * (run.t_s - run.t_s[0]))
    expected = [np.sin(3 * theta), -run.temp_c * run.rate_dps / 2, np.exp(-(run.t_s - run.t_s[0]) / 4.0)]
    np.testing.assert_allclose(columns, np.column_stack(expected), rtol=1e-12)


def test_kinks_and_turns(session: Session) -> None:
    run = session.runs[1].as_measured()
    kind = FormulaEffect("a*max(temp_c - 25.5, 0) + b*min(2*pi*turn, 3) + c*(turn - 0.5)")
    turn = (78.0 * (run.t_s - run.t_s[0]) / 360) % 1
    assert turn.max() > 0.99
    expected = [np.clip(run.temp_c - 25.5, 0, None), np.clip(2 * np.pi * turn, None, 3), turn - 0.5]
    np.testing.assert_allclose(kind.columns(run, 2, {}), np.column_stack(expected), atol=1e-9)


@pytest.mark.slow
def test_a_size_of_its_own_in_each_run(session: Session) -> None:
    """`; each run`: the value is the size's root mean square over the runs."""
    rng = np.random.default_rng(0)
    sizes = rng.normal(0, 0.05, len(session.runs))
    planted = with_signal(session, lambda r: sizes[r.index] * np.sin(0.7 * (r.t_s - r.t_s[0])))
    before, after, model = add_measured(planted, ON_Z, "wobble: k*sin(0.7*t); each run")
    assert after.pooled.excess_dps < 0.2 * before.pooled.excess_dps
    term = model.term("wobble", "z")
    assert term is not None
    assert term.values["k"] == pytest.approx(np.sqrt(np.mean(sizes**2)), abs=3 * term.se["k"])
    assert "each run" in model.toml()


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')", "k*open('x')", "k*rate.real", "k*[1][0]", "k*(lambda: 1)()", "k*sin", "k*sin(t, t)",
        "k if t else 0", "k*'a'", "k*True", "t", "k*m*t", "k*t + k*rate", "A*exp(-t/tau)", "k*t; tau=x", "k*(", "", "k*t**",
        "k*t@t", "k*max(t)", "k*max(t, 1, 2)", "k*pi; pi=3",
    ],
)  # fmt: skip
def test_what_is_no_formula_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(InputError) as caught:
        FormulaEffect(text)
    assert "\n" not in str(caught.value)


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet="k1tsin(3*theta)+- /.rate_=;,[]{}'\"λ\x00", max_size=40))
def test_no_text_does_anything_but_parse(text: str) -> None:
    message = ""
    try:
        FormulaEffect(text)
    except InputError as error:
        message = str(error)
    assert "\n" not in message


@pytest.mark.slow
def test_a_formula_is_found_added_and_kept(session: Session, tmp_path: Path) -> None:
    planted = with_signal(session, lambda r: 0.02 * np.sin(0.7 * (r.t_s - r.t_s[0])))
    found = diagnose(planted, ON_Z, formulas=["wobble: k*sin(0.7*t)"])
    assert found.best is not None
    assert found.best.effect.id == "wobble"
    assert found.best.values["k"] == pytest.approx(0.02, rel=0.05)
    before, after, model = add_measured(planted, ON_Z, "wobble: k*sin(0.7*t)")
    assert after.pooled.excess_dps < 0.4 * before.pooled.excess_dps
    model.save(tmp_path / "m.toml")
    again = Model.open(tmp_path / "m.toml")
    assert again.value("wobble", "z", "k") == pytest.approx(0.02, rel=0.05)
    assert diagnose(planted, again).verdict == "adequate"


@pytest.mark.wide
@pytest.mark.slow
def test_a_nonlinear_parameter_is_refined(session: Session) -> None:
    planted = with_signal(session, lambda r: 0.05 * np.exp(-(r.t_s - r.t_s[0]) / 3.0))
    _, after, model = add_measured(planted, ON_Z, "A*exp(-t/tau); tau=8")
    assert model.value("formula", "z", "tau") == pytest.approx(3.0, rel=0.1)
    assert after.fit.model.value("formula", "z", "A") == pytest.approx(0.05, rel=0.1)


OWN = """
import numpy as np
from gyrocal.effects.base import Effect, Parameter

class Wobble(Effect):
    id, title, cause, equation = "own_wobble", "A wobble", "A test.", "k*sin(0.7 t)"
    looks_like = measure_next = ""
    parameters = (Parameter("k", "dps", (0.001, 0.1), "a test", 0.02),)
    linear = ("k",)

    def columns(self, run, axis, values):
        return np.sin(0.7 * (run.t_s - run.t_s[0]))[:, None]
"""


@pytest.mark.wide
@pytest.mark.slow
def test_a_file_in_a_folder_is_equal_to_the_built_in_ones(session: Session, tmp_path: Path) -> None:
    (tmp_path / "own_wobble.py").write_text(OWN)
    try:
        assert base.load(tmp_path) == ["own_wobble"]
        planted, truth = simulate(None, "paper", ["own_wobble:k=0.02"], 4, scenarios=6, seconds=20.0)
        assert truth["effects"] == ["own_wobble"]
        assert diagnose(planted, ON_Z).candidates[0].effect.id == "own_wobble"
        base.effects().pop("own_wobble")
        words = ["simulate", str(tmp_path / "s"), "--scenarios", "1", "--seconds", "2", "--effect", "own_wobble"]
        assert main(words) == 2  # code: only when asked for
        assert main([*words, "--effects", str(tmp_path)]) == 0
        assert main(["compare", str(tmp_path / "s"), "--effects", str(tmp_path)]) == 0
    finally:
        base.effects().pop("own_wobble", None)
    with pytest.raises(InputError, match="no effect in it"):
        base.load(tmp_path / "..")


def test_an_id_stays_an_id() -> None:
    assert effect_or_formula("table_ripple") is base.effect("table_ripple")
    with pytest.raises(InputError, match="no effect"):
        effect_or_formula("nothing")
    with pytest.raises(InputError, match="cannot be its name"):
        effect_or_formula("scale: k*t")
