"""A rate that is the same all through a run: what the reference adds to it does not decide on the scale."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from encoders import FIXED_DPS, SCALE, encoder_session
from gyrocal.diagnosis.answer.compare import compare
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.plausibility import of_fit
from gyrocal.recording.session import Session
from known import ON_Z

pytestmark = pytest.mark.slow


def scale_of(session: Session) -> tuple[float, float, dict[str, Any]]:
    told = compare(session, ON_Z).to_json()
    (found,) = [p for p in told["parameters"] if p["effect"] == p["name"] == "scale" and p["axis"] == "z"]
    return found["value"], found["se"], told


@pytest.mark.parametrize(
    ("seed", "how"),
    [
        pytest.param(11, {"eccentric_deg": 0.05, "rate_hz": 200.0}, marks=pytest.mark.wide),
        pytest.param(12, {"eccentric_deg": 0.02, "step_deg": 0.02}, marks=pytest.mark.wide),
        pytest.param(13, {"eccentric_deg": 0.3, "step_deg": 0.01}, marks=pytest.mark.wide),
        (14, {"eccentric_deg": 0.05, "as_rate": True}),
    ],
)
def test_an_eccentric_encoder_leaves_the_scale_to_the_mean_rates(seed: int, how: dict[str, Any]) -> None:
    """The wave that the sensor does not show made the scale -0.99, with turn-on biases of 60 deg/s, and no warning."""
    scale, se, told = scale_of(encoder_session(seed, **how))
    assert abs(scale - SCALE) < 5 * se < 0.02
    assert told["verdict"] == "misfit"
    assert "once per turn" in told["where"][0]["note"]
    assert [w["code"] for w in told["warnings"]] == []


@pytest.mark.wide
@pytest.mark.parametrize(
    "how",
    [
        pytest.param({"wobble": 0.005, "as_rate": True}, marks=pytest.mark.wide),
        {"step_deg": 0.02, "seconds": 37.3},
        {"wobble": 0.03, "as_rate": True},
    ],
)
def test_a_true_wobble_and_an_even_encoder_stay_adequate(how: dict[str, Any]) -> None:
    for seed in (21, 22):
        scale, se, told = scale_of(encoder_session(seed, **how))
        assert abs(scale - SCALE) < 5 * se < 0.003
        assert told["verdict"] == "adequate"


@pytest.mark.wide
@pytest.mark.parametrize("rate_hz", [pytest.param(50.0, marks=pytest.mark.wide), 200.0])
def test_coarse_steps_of_a_fixed_rate_are_one_rate(rate_hz: float) -> None:
    """The slopes of steps of 0.36 deg vary by more than 1 % in some runs; the readings do not."""
    session = encoder_session(31, rate_hz, step_deg=0.36)
    for run, fixed_dps in zip(session.runs, FIXED_DPS, strict=True):
        assert run.reference_dps is not None
        assert run.one_rate_dps == pytest.approx(fixed_dps, rel=1e-3)
    assert max(float(np.nanstd(run.reference_dps)) for run in session.runs if run.reference_dps is not None) > 0.9
    scale, se, told = scale_of(session)
    assert abs(scale - SCALE) < 5 * se < 0.003
    assert told["warnings"] == []


def test_a_swing_is_not_one_rate() -> None:
    assert all(run.one_rate_dps is None for run in encoder_session(41, swing_dps=20.0).runs)
    assert all(run.one_rate_dps is None for run in encoder_session(42, wobble=0.03).runs)


@pytest.mark.parametrize(
    ("scale", "se", "told"), [(-0.5, 0.01, True), (0.2, 0.005, True), (0.03, 0.001, False), (-0.5, 0.1, False)]
)
def test_a_fitted_scale_that_no_gyroscope_has_is_told(scale: float, se: float, told: bool) -> None:
    fitted = fit(encoder_session(51, as_rate=True, seconds=20.0), Model.builtin("default"))
    of_z = fitted.model.term("scale", "z")
    assert of_z is not None
    wrong = replace(of_z, values={**of_z.values, "scale": scale}, se={**of_z.se, "scale": se})
    terms = tuple(wrong if t is of_z else t for t in fitted.model.terms)
    found = of_fit(replace(fitted, model=replace(fitted.model, terms=terms)), [])
    assert [(w.code, w.axis, w.blocking) for w in found] == [("scale_implausible", "z", True)] * told
    assert of_fit(fitted, []) == []
