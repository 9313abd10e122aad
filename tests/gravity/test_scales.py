"""Scales by gravity that no sensor has, or that the movements leave unsure, beside a verdict."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from by_hand import turned_by
from gyrocal.gravity import scales
from gyrocal.gravity.calibrate import calibrate
from gyrocal.gravity.compare import measure
from gyrocal.gravity.fit import GravityFit
from gyrocal.recording.session import Session

TURNS = [("y", 90.0), ("z", 90.0), ("x", 90.0), ("y", -90.0), ("x", -90.0), ("z", -90.0)] * 2


def with_factor(session: Session, axis: str, factor: float) -> Session:
    name = f"g{axis}_dps"
    return session.with_runs([replace(r, frame=r.table.with_columns(r.table[name] * factor)) for r in session.runs])


@pytest.mark.parametrize(("factor", "codes"), [(1.05, []), (1.4, [("scale_implausible", "y", True)])])
def test_a_scale_that_no_sensor_has_is_told(factor: float, codes: list[tuple[str, str, bool]]) -> None:
    """Of one axis alone: the rates of all by one factor are told before the fit."""
    found = measure(with_factor(turned_by(TURNS), "y", factor))
    assert [(w.code, w.axis, w.blocking) for w in found.warnings if w.code in ("scale_implausible", "no_answer")] == codes


def test_a_scale_that_the_movements_leave_unsure_is_no_scale() -> None:
    """Scales unsure by 29 % stood beside the verdict adequate."""
    found = measure(turned_by([("y", 90.0), ("y", -90.0)] * 4))
    assert {(w.code, w.axis) for w in found.warnings} >= {("no_answer", "x"), ("no_answer", "z")}


def test_too_few_turns_are_told_of_the_axes_alone_that_lack_them() -> None:
    """All axes of a noisy sensor were said to turn gravity too seldom, though one of them turned it eight times."""
    session = turned_by([("y", 90.0), ("y", -90.0)] * 4)
    noise_dps = np.random.default_rng(1).normal(0, 1.0, (len(session.runs[0]), 3))
    columns = [session.runs[0].table[f"g{a}_dps"] + noise_dps[:, i] for i, a in enumerate("xyz")]
    noisy = session.with_runs([replace(session.runs[0], frame=session.runs[0].table.with_columns(columns))])
    told = {w.axis: w.text for w in calibrate(noisy).warnings if w.code == "no_answer"}
    assert "because too few turn gravity about x" in told["x"]
    assert "because too few turn gravity about z" in told["z"]
    assert "although they turn gravity about y; most of that comes from the gyroscope noise: move quickly" in told["y"]


@pytest.mark.parametrize(
    ("stated", "told"), [((-0.25, 0.0055, 43.0), []), ((0.33, 0.005, 2.0), ["y"]), ((-0.25, 0.1, 43.0), ["y"])]
)
def test_a_scale_is_judged_as_calibrate_states_it(
    stated: tuple[float, float, float], told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """``compare`` said y +33 % and ``calibrate`` -25+-24 % of one session whose movements contradict each other."""
    fits = {1.0: (0.33, 0.005), stated[2]: stated[:2]}
    monkeypatch.setattr(scales, "_scale", lambda fitted, axis: fits[fitted.misfit] if axis == "y" else (0.0, 0.0))
    plain, full = (cast(GravityFit, SimpleNamespace(misfit=misfit)) for misfit in (1.0, stated[2]))
    assert [w.axis for w in scales.implausible(plain, full)] == told
