"""Diagnosis names what was planted, and nothing where nothing was; `add` makes the error fall only for the right effect."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.add import add
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from known import add_measured

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("known_answers")]


def session_with(effects: list[str], seed: int = 3, scenarios: int = 4) -> Session:
    return simulate(None, "paper", effects, seed, scenarios=scenarios, seconds=15.0)[0]


@pytest.mark.parametrize("effect", ["table_ripple", pytest.param("spin_up", marks=pytest.mark.wide)])
def test_the_planted_effect_is_named_and_added(effect: str) -> None:
    session = session_with([effect])
    found = diagnose(session)
    assert found.verdict == "add"
    assert found.best is not None
    assert (found.best.effect.id, found.best.axis, found.best.group) == (effect, "z", (effect,))
    assert found.best.explained == pytest.approx(1.0, abs=0.1)
    before, after, model = add(session, None, effect)
    assert after.pooled.excess_dps < 0.4 * before.pooled.excess_dps
    assert before.pooled.floor_dps == after.pooled.floor_dps
    assert after.verdict == "adequate"
    assert diagnose(session, model).verdict == "adequate"


def test_a_wrong_effect_does_not_make_the_error_fall() -> None:
    before, after, _ = add_measured(session_with(["table_ripple"]), None, "spin_up")
    assert after.pooled.excess_dps > 0.95 * before.pooled.excess_dps


def test_profile_likelihood_does_not_depend_on_the_columns_scale() -> None:
    """Unlike REML's: a parameter in percent or in fractions gives the same likelihood."""
    session = session_with([], scenarios=3)
    found = fit(session, Model.builtin("paper"), axes=["z"]).axes["z"]
    n = int(found.design.n_blocks.sum())
    b = np.concatenate([b.y_dps[:, 2] for b in found.design.blocks])
    w = np.concatenate([np.full(b.t_s.size, b.run.rate_dps[0]) for b in found.design.blocks])
    x = np.column_stack([w, np.ones(n)])
    residual = b - x @ np.linalg.lstsq(x, b, rcond=None)[0]
    variance = found.noise.white_sd_dps**2 / found.design.blocks[0].n[0]
    plain = -0.5 * (n * np.log(2 * np.pi * variance) + residual @ residual / variance)
    assert found.solution.profile_loglik == pytest.approx(plain, abs=1e-6)


def test_json_has_the_contract_s_keys() -> None:
    told = diagnose(session_with(["table_ripple"])).to_json()
    assert set(told) >= {"verdict", "candidates", "unknown"}
    assert set(told["candidates"][0]) >= {
        "effect", "axis", "parameters", "explained", "heldout_gain", "heldout_gain_se", "q_value", "group",
        "decision", "next_measurement",
    }  # fmt: skip
    assert set(told["candidates"][0]["parameters"]["amplitude_1"]) == {"value", "se", "unit"}


@pytest.mark.parametrize(("effect", "axes"), [("table_ripple", "z"), ("colored_noise", "x, y, z"), ("scale", "x, y, z")])
def test_an_effect_that_the_model_has_already_is_not_added_again(effect: str, axes: str) -> None:
    """It said that the session lacks what the axes without the effect would need, or nothing at all, and exit code 0."""
    model = Model.builtin("default").add("table_ripple", "z")
    with pytest.raises(InputError, match=f"{effect}: the model has it already, on {axes}; `gyrocal diagnose` with this model"):
        add(session_with([]), model, effect)


def test_a_model_survives_its_file(tmp_path) -> None:
    _, _, model = add_measured(session_with(["table_ripple"]), None, "table_ripple")
    model.save(tmp_path / "m.toml")
    again = Model.open(tmp_path / "m.toml")
    assert again.ids == model.ids
    for a, b in zip(again.terms, model.terms, strict=True):
        assert a.values == pytest.approx(b.values, rel=1e-8)
    text = (tmp_path / "m.toml").read_text()
    lines = [
        line
        for line in text.splitlines()
        if "table_ripple" not in line or line.startswith("#") or line.startswith("name")
    ]
    (tmp_path / "m.toml").write_text("\n".join(lines))  # undo is removing a line
    assert "table_ripple" not in Model.open(tmp_path / "m.toml").ids
