"""Comparison: an honest null, a hidden effect seen against the right variable, the levels' own arithmetic."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.residual.residual_table import residual_table
from gyrocal.error_model.model import Model
from gyrocal.recording.session import Run, Session
from gyrocal.simulation.simulate import simulate
from known import ON_Z


def session_with(effects: list[str], seed: int = 3, seconds: float = 20.0) -> Session:
    return simulate(None, "paper", effects, seed, scenarios=6, seconds=seconds)[0]


def altered(session: Session, **columns: object) -> Session:
    """The session with columns recomputed: name -> function of the run."""
    return session.with_runs(
        replace(r, frame=r.table.with_columns(pl.Series(name, f(r)) for name, f in columns.items())) for r in session.runs
    )


def test_a_face_is_told_by_its_name() -> None:
    """It was told as "from 0 and more" and "below 0"."""
    found = compare(simulate(None, "full", ["g_sensitivity"], 4, scenarios=2, seconds=5.0)[0])
    note = next(f.note for f in found.where if f.against == "face")
    assert note.endswith((", face up", ", face down"))


def test_a_session_without_effects_is_adequate() -> None:
    found = compare(session_with([]))
    assert found.verdict == "adequate"
    assert found.where == []
    assert found.held_out == "day"
    assert found.pooled.rms_dps == pytest.approx(0.0444, rel=0.02)


def test_levels_are_what_they_say() -> None:
    found = compare(session_with(["table_ripple"]))
    for level in (found.pooled, *found.per_axis.values()):
        assert level.excess_dps == pytest.approx(np.sqrt(max(0, level.rms_dps**2 - level.floor_dps**2)))
    pooled = np.sqrt(np.mean([v.rms_dps**2 for v in found.per_axis.values()]))
    assert found.pooled.rms_dps == pytest.approx(pooled, rel=1e-9)  # equally many samples an axis
    # a ripple of amplitude a leaves a/sqrt(2) of excess on the table's axis
    assert found.per_axis["z"].excess_dps == pytest.approx(0.0016 * 78 / np.sqrt(2), rel=0.05)


def test_residual_file_is_where_rms_is_from() -> None:
    found = compare(session_with(["table_ripple"], seconds=8.0))
    table = residual_table(found)
    assert table.columns == ["file", "t_s", "axis", "measured_dps", "modelled_dps"]
    residual = (table["measured_dps"] - table["modelled_dps"]).to_numpy()
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(found.pooled.rms_dps, rel=1e-9)
    assert table.height == 3 * sum(len(r) for r in found.fit.session.runs)


@pytest.mark.parametrize(
    ("effect", "against"), [("table_ripple:amplitude_1=0.0005", "table_angle"), ("spin_up:A=0.001,tau_s=2", "time")]
)
def test_where_names_the_variable(effect: str, against: str) -> None:
    found = compare(session_with([effect]))
    assert found.verdict == "misfit"
    assert found.where[0].axis == "z"
    assert found.where[0].against == against
    assert [f.strength for f in found.where] == sorted((f.strength for f in found.where), reverse=True)


def test_a_tone_is_seen_against_frequency() -> None:
    rng = np.random.default_rng(0)
    found = compare(
        altered(
            session_with([]),
            gx_dps=lambda r: r.gyro_dps[:, 0] + 0.01 * np.sin(2 * np.pi * 31.4 * r.t_s + rng.uniform(0, 6)),
        )
    )
    assert (found.where[0].axis, found.where[0].against) == ("x", "frequency")
    assert found.where[0].amplitude_dps == pytest.approx(0.01, rel=0.15)
    assert "31.4 Hz" in found.where[0].note


def test_a_stuck_bit_is_seen_against_the_reading() -> None:
    def stuck(r: Run) -> np.ndarray:
        codes = np.rint(r.gyro_dps[:, 1] / 0.00875).astype(int)
        return (codes & ~2) * 0.00875

    found = compare(altered(session_with([], seconds=8.0), gy_dps=stuck))
    assert ("y", "reading") in [(f.axis, f.against) for f in found.where]
    assert "bit 1" in next(f.note for f in found.where if f.against == "reading")


def test_drift_is_no_misfit_for_default_but_is_for_the_paper_s_white_noise() -> None:
    """An Ornstein-Uhlenbeck drift of 5 mdps: `default` expects drift, eq. (4) to the letter does not."""
    from gyrocal.noise.drift import ou_noise

    rng = np.random.default_rng(5)
    drifting = altered(
        session_with([], seconds=40.0),
        gz_dps=lambda r: r.gyro_dps[:, 2] + ou_noise(len(r), 1 / 145, 0.005, 20.0, 1, rng)[:, 0],
    )
    assert compare(drifting, ON_Z).verdict == "adequate"
    assert compare(drifting, Model.builtin("paper").about("z")).verdict == "misfit"
