"""The spectra of every report begin at one period in the longest run, over time and over the turn of the table."""

from __future__ import annotations

import numpy as np
import pytest

from gyrocal.diagnosis.residual.comparison import Comparison, measure
from gyrocal.present import pictures
from gyrocal.simulation.simulate import simulate
from gyrocal.variables.order import Order

RATE_DPS, SECONDS = 78.0, 20.0


@pytest.fixture(scope="module")
def compared() -> Comparison:
    session, _ = simulate(None, "paper", [], 3, scenarios=2, seconds=SECONDS)
    return measure(session)


def test_the_spectrum_begins_at_the_lowest_frequency_that_a_run_holds(compared: Comparison) -> None:
    figure = pictures.of_comparison(compared)["spectrum"][1]
    longest_s = max(run.duration_s for run in compared.fit.session.runs)
    assert figure.axes[0].lines[0].get_xdata()[0] == pytest.approx(1 / longest_s, rel=0.01)


def test_the_spectrum_over_the_turn_begins_at_one_period_in_the_longest_run(compared: Comparison) -> None:
    figure = pictures.of_comparison(compared)["orders"][1]
    turns = SECONDS * RATE_DPS / 360
    lowest = figure.axes[0].lines[0].get_xdata()[0]
    assert 1 / turns <= lowest < 1.5 / turns  # its values are half a period apart
    assert np.isfinite(figure.axes[0].lines[0].get_ydata()).all()


def test_ticks_are_plain_numbers(compared: Comparison) -> None:
    for name in ("spectrum", "orders", "allan"):
        figure = pictures.of_comparison(compared)[name][1]
        figure.canvas.draw()
        (axes,) = figure.axes
        low, high = axes.get_ylim()
        told = [float(t.get_text()) for t in axes.get_yticklabels() if low <= t.get_position()[1] <= high]  # "10^0" is no float
        assert len(told) > 1


def test_runs_of_a_turn_or_so_have_no_spectrum_over_the_turn() -> None:
    session, _ = simulate(None, "paper", [], 3, scenarios=1, seconds=6.0)
    compared = measure(session)
    assert pictures.spectra(compared, Order.name) is None
    assert set(pictures.of_spectra(compared)) == {"spectrum"}
