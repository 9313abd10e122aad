"""Every variable is whole, and one that is added in a file of its own is seen by everything that lists the folder."""

import dataclasses
from pathlib import Path
from typing import ClassVar

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray

import gyrocal.variables
from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.formula_search import keep
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.present.pictures import residual_against
from gyrocal.recording.session import AXES, Run, Session
from gyrocal.simulation.simulate import simulate
from gyrocal.variables.base import Symbol, Variable, quantile_edges, symbols, variables
from gyrocal.variables.shapes import Shape, Waves
from gyrocal.web.values.residual_plots import Panel, opened_by, panels
from known import ON_X
from make_runs import make_run

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[2]
PERIOD_S = 7.0


def rich(session: Session) -> Session:
    """The session with every optional column."""
    columns = {"temp_c": 25.0, "ax_g": 0.0, "ay_g": 0.0, "az_g": 1.0}
    runs = (
        dataclasses.replace(r, frame=r.table.with_columns(**{k: pl.lit(v) + 0.1 * pl.col("t_s") for k, v in columns.items()}))
        for r in session.runs
    )
    return session.with_runs(runs)


@pytest.fixture(scope="module")
def session() -> Session:
    return rich(simulate(None, "full", ["scale_asymmetry:k=0.002"], 3, scenarios=1, seconds=8)[0])


@pytest.mark.parametrize("name", variables())
def test_a_variable_is_whole(name: str, session: Session) -> None:
    variable = variables()[name](session.runs)
    assert variable.title
    assert variable.label() == (variable.quantity if variable.marks else f"{variable.quantity}, {variable.unit}")
    assert set(variable.searched) <= variable.symbols.keys()
    assert variable.searched or variable.no_formula != Variable.no_formula
    for run in session.runs:
        values = variable.values(run, 2)
        if values is not None:
            assert values.shape == ((len(run), len(variable.components)) if variable.components else (len(run),))
        for symbol in variable.symbols.values():
            found = symbol.values(run, 2)
            assert found is not None
            assert found.shape == (len(run),)
    for axis in range(3):
        for shape in variable.shapes(axis):
            assert shape.columns(session.runs[0], axis, {}).shape == (len(session.runs[0]), len(shape.linear))


def test_orders_and_symbols_are_each_taken_once() -> None:
    assert len({v.order for v in variables().values()}) == len(variables())
    assert len(symbols()) == sum(len(v.symbols) for v in variables().values())


def test_a_file_holds_one_variable_and_has_its_name() -> None:
    folder = Path(gyrocal.variables.__file__).parent
    helpers = {"__init__", "base", "shapes", "terms"}
    assert {p.stem for p in folder.glob("*.py")} - helpers == set(variables())


def test_every_finding_opens_a_picture() -> None:
    there = {panel.name for panel in panels()}
    for name, variable in variables().items():
        assert opened_by(name) in there or variable.picture == "spectrum"


def test_no_name_of_a_variable_is_written_outside_its_file() -> None:
    """Elsewhere a variable is asked for by its class. Names of one word are left out: they mean other things too."""
    distinct = [name for name in variables() if "_" in name]
    assert distinct
    for path in (ROOT / "host/gyrocal").rglob("*.py"):
        if path.parent.name != "variables":
            text = path.read_text(encoding="utf-8")
            assert not [name for name in distinct if f'"{name}"' in text], path


class Beat(Variable):
    """The time within each stretch of seven seconds, say of a fan's control."""

    name, title, quantity, unit, order = "beat", "Beat", "time in the fan's cycle", "s", 99
    period = PERIOD_S
    symbols: ClassVar = {"beat": Symbol("time in the fan's cycle, s", lambda run, axis: (run.t_s - run.t_s[0]) % PERIOD_S)}
    searched = ("beat",)

    def values(self, run: Run, axis: int) -> Array:
        return (run.t_s - run.t_s[0]) % PERIOD_S

    def shapes(self, axis: int) -> list[Shape]:
        return self.steps(axis, np.arange(1.0, PERIOD_S))


def with_beat(seconds: float) -> Session:
    """Six scenarios with 30 mdps for three of every seven seconds, on x."""
    plain = simulate(None, "paper", [], 5, scenarios=6, seconds=seconds)[0]

    def disturbed(run: Run) -> pl.DataFrame:
        on = (run.t_s - run.t_s[0]) % PERIOD_S < 3
        return run.table.with_columns(gx_dps=run.gyro_dps[:, 0] + 0.03 * on)

    return plain.with_runs(dataclasses.replace(run, frame=disturbed(run)) for run in plain.runs)


@pytest.mark.slow
def test_a_new_variable_is_probed_kept_and_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    session = with_beat(21)
    monkeypatch.setitem(variables(), Beat.name, Beat)
    found = compare(session, ON_X)
    first = found.where[0]
    assert (first.axis, first.against) == ("x", Beat.name)
    assert residual_against(found, first) is not None
    assert Panel(Beat) in panels()
    assert FormulaEffect("k*(beat - 3)").variables == ["beat"]
    proposal, before, after, _ = keep(session, ON_X)
    assert proposal.against == Beat.name
    assert "beat" in proposal.formula
    kept = after.per_axis["x"].excess_dps
    assert kept is not None
    assert kept < 0.5 * (before.per_axis["x"].excess_dps or 0.0)


def test_a_rate_that_shows_on_another_axis_is_drawn_against_that_rate(session: Session) -> None:
    one_axis = variables()["rate"](session.runs)
    turning = next(r for r in session.runs if r.rate_dps.any())
    assert np.array_equal(one_axis.values(turning, AXES.index("x")), turning.rate_dps)
    about_x = dataclasses.replace(turning, axis="x")
    two_axes = variables()["rate"]([*session.runs, about_x])
    assert not two_axes.values(turning, AXES.index("x")).any()
    assert np.array_equal(two_axes.values(about_x, AXES.index("x")), turning.rate_dps)


def test_no_edge_divides_a_plateau_although_ramps_lead_to_it() -> None:
    """Only the noise of the values would decide their side, and a residual holds that noise with the opposite sign."""
    rng = np.random.default_rng(0)
    plateaus = {0.0: 1300, 50.0: 300, 100.0: 3300, 150.0: 400}
    values = [level + rng.normal(0, 0.01, number) for level, number in plateaus.items()]
    (edge,) = quantile_edges(np.concatenate([*values, np.linspace(50, 100, 390)]), 3.0, 2)
    assert min(abs(edge - level) for level in plateaus) > 1.0


def test_a_constant_that_is_not_exact_in_binary_has_no_steps() -> None:
    """Block means of 23.4 degC differ in the last digit."""
    assert quantile_edges(np.array([0.1 * 234 * np.ones(k).mean() + (k % 2) * 4e-15 for k in range(1, 40)]), 0.0, 4).size == 0


@pytest.mark.parametrize(("swing_deg", "orders"), [(6.0, []), (130.0, [3, 4, 5, 6]), (400.0, [1, 2, 3, 4, 5, 6])])
@pytest.mark.parametrize("encoder", [True, False])
def test_a_wave_is_looked_for_where_the_table_turns_through_a_period_of_it(
    swing_deg: float, orders: list[int], encoder: bool
) -> None:
    """A shaft that swings by 6 degrees had 136 dps once per turn."""
    t_s = np.arange(0, 20, 0.02)
    angle = swing_deg / 2 * np.sin(2 * np.pi * 0.25 * t_s)
    rate = np.gradient(angle, t_s)
    known = {"table_angle_deg": angle} if encoder else {}
    run = make_run(t_s, np.stack([0 * t_s, 0 * t_s, rate], axis=1), rate_ref_dps=rate, **known)
    shapes = variables()["table_angle"]([run]).shapes(2)
    found = [k for shape in shapes for k in (shape.orders if isinstance(shape, Waves) else [shape.order])]
    assert found == orders
    assert all(shape.columns(run, 2, {}).shape == (t_s.size, 2 * len(orders)) for shape in shapes if isinstance(shape, Waves))
