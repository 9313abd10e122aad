"""Parameters that a fit leaves at their values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gyrocal.api import InputError, Model, Session, compare
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.inference.fit import fit
from gyrocal.simulation.simulate import simulate
from known import ON_Z


def test_a_held_time_constant_stays_and_sharpens_the_amplitude(tmp_path: Path) -> None:
    session, _ = simulate(None, "paper", ["warmup:A_dps=0.3,tau_s=20"], 1, scenarios=2, seconds=30.0)
    free = fit(session, Model.open().add("warmup", "z")).model
    held = fit(session, free.holding("warmup", "z", "tau_s", 20.0)).model
    free_line, held_line = free.line("warmup", "z"), held.line("warmup", "z")
    assert free_line is not None
    assert held_line is not None
    assert held_line.values["tau_s"] == 20.0
    assert "tau_s" not in held_line.se
    assert held_line.se["A_dps"] < free_line.se["A_dps"]
    assert abs(held_line.values["A_dps"] - 0.3) < 4 * held_line.se["A_dps"]
    held.save(tmp_path / "m.toml")
    again = Model.open(tmp_path / "m.toml")
    assert again.line("warmup", "z").held == ("tau_s",)  # type: ignore[union-attr]
    freed = fit(session, again.holding("warmup", "z", "tau_s", None)).model
    assert freed.value("warmup", "z", "tau_s") == pytest.approx(free_line.values["tau_s"], rel=0.02)


@pytest.mark.wide
def test_a_held_coefficient_is_subtracted_and_at_zero_is_as_if_it_were_not_there() -> None:
    session, _ = simulate(None, "full", ["scale_nonlinearity:k3=3e-8"], 1, scenarios=1, seconds=8.0)
    with_it = measure(session, ON_Z.add("scale_nonlinearity", "z")).fit.model
    without = measure(session, ON_Z)  # compare would name the effect where the model lacks it, and draw the noise beside it
    at_zero = measure(session, with_it.holding("scale_nonlinearity", "z", "k3", 0.0))
    assert at_zero.pooled.rms_dps == pytest.approx(without.pooled.rms_dps, rel=1e-6)
    assert at_zero.fit.loglik == pytest.approx(without.fit.loglik, abs=1e-3)
    planted = compare(session, with_it.holding("scale_nonlinearity", "z", "k3", 3e-8))
    assert planted.fit.model.value("scale_nonlinearity", "z", "k3") == 3e-8
    assert planted.fit.loglik > without.fit.loglik + 10
    assert not any(f.against == "rate" for f in planted.where)
    told = [p for p in planted.to_json()["parameters"] if p["effect"] == "scale_nonlinearity"]
    assert told == [{"effect": "scale_nonlinearity", "axis": "z", "name": "k3", "value": 3e-8, "se": None}]


@pytest.mark.parametrize(
    ("entry", "word"),
    [
        ('{ id = "warmup", axis = "z", A_dps = 0.1, tau_s = 9.0, held = ["tau"] }', "held names 'tau'; .* may name tau_s"),
        ('{ id = "warmup", axis = "z", A_dps = 0.1, held = ["tau_s"] }', "may name none"),
        ('{ id = "bias", axis = "z", bias_dps = 0.1, held = ["bias_dps"] }', "may name none"),
        ('{ id = "warmup", axis = "z", A_dps = 0.1, tau_s = 9.0, held = "tau_s" }', "held names 'tau_s'"),
    ],
)
def test_a_file_that_holds_what_cannot_be_held_says_what_can(tmp_path: Path, entry: str, word: str) -> None:
    (tmp_path / "m.toml").write_text(f'format = "gyrocal-model/1"\neffects = [ {entry} ]\n')
    with pytest.raises(InputError, match=word):
        Model.open(tmp_path / "m.toml")


def test_a_value_out_of_bounds_or_an_effect_that_is_not_there_is_refused() -> None:
    model = Model.open()
    with pytest.raises(InputError, match="add it first"):
        model.holding("warmup", "z", "tau_s", 1.0)
    session, _ = simulate(None, "paper", ["warmup"], 1, scenarios=1, seconds=6.0)
    fitted = fit(Session(session.sample_rate_hz, session.runs), model.add("warmup", "z")).model
    with pytest.raises(InputError, match="must be positive"):
        fitted.holding("warmup", "z", "tau_s", -1.0)
    with pytest.raises(InputError, match="cannot be held"):
        fitted.holding("warmup", "z", "A", 1.0)
    assert np.isfinite(fitted.value("warmup", "z", "tau_s"))
