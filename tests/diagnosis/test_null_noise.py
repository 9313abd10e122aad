"""Noise as sensors have it raises no alarm, and effects in such noise are still found (`benchmarks/null_noise.py`)."""

from dataclasses import replace
from functools import partial
from types import ModuleType

import numpy as np
import pytest

from gyrocal.diagnosis.naming.judge import judge
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.diagnosis.residual.whiteness import too_much_power
from gyrocal.effects.base import effect
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Run, Session
from gyrocal.simulation.simulate import simulate
from study import study

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("tests_alone")]


@pytest.fixture(scope="module")
def null() -> ModuleType:
    return study("null_noise")


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("low-pass, static", 0), ("correlated, coarse counts", 0),
        *(
            pytest.param(kind, seed, marks=pytest.mark.wide)
            for kind, seed in (
                ("level changes in a run", 2), ("t3", 0),
                ("level differs between runs", 0), ("low-pass 5-42 Hz", 22), ("bursts", 1), ("10 Hz, flicker, static", 4),
                ("flicker, low-pass", 0), ("flicker, static", 1), ("level changes, static", 2), ("bursts, static", 1)
            )
        ),
    ],
)  # fmt: skip
def test_noise_of_sensors_is_adequate(null: ModuleType, kind: str, seed: int) -> None:
    """Each of these sessions had a false name or a false alarm when noise was taken for white and one slow drift."""
    found = null.judge(kind, seed)
    assert (found["verdict"], found["names"], found["where"]) == ("adequate", [], [])


def with_fault(session: Session, distorted: list[np.ndarray]) -> Session:
    def changed(run: Run, gyro_dps: np.ndarray) -> Run:
        x, y, z = gyro_dps.T
        return replace(run, frame=run.table.with_columns(gx_dps=x, gy_dps=y, gz_dps=z))

    return session.with_runs(changed(r, g) for r, g in zip(session.runs, distorted, strict=True))


@pytest.mark.parametrize(
    ("fault", "kind", "values"),
    [
        ("sampling_fault", "correlated, coarse counts", {"fraction": 0.03}),
        ("sampling_fault", "low-pass 5-42 Hz", {"fraction": 0.01}),
        ("bias_jumps", "low-pass 5-42 Hz", {"outliers": 1e-3, "size_dps": 1.0}),
        ("bias_jumps", "level differs between runs", {"outliers": 1e-3, "size_dps": 1.5}),
    ],
)
def test_faults_of_the_reading_show_in_such_noise(null: ModuleType, fault: str, kind: str, values: dict[str, float]) -> None:
    session = null.KINDS[kind](np.random.default_rng(5), 3)
    kind_of_fault = effect(fault).fault
    assert kind_of_fault is not None
    assert kind_of_fault.detect(session.runs, 2) is None
    rng = np.random.default_rng(6)
    faulty = with_fault(session, [kind_of_fault.distort(r, r.gyro_dps, values, rng) for r in session.runs])
    found = kind_of_fault.detect(faulty.runs, 2)
    assert found is not None
    assert found.chance < 1e-6


@pytest.mark.parametrize("cutoff_hz", [2.0, 5.0])
def test_slow_noise_is_no_clipping_and_a_cut_of_its_peaks_is(null: ModuleType, cutoff_hz: float) -> None:
    saturation = effect("saturation").fault
    assert saturation is not None
    for seed in range(4):
        rng = np.random.default_rng(seed)
        draw = partial(null.low_passed, cutoff_hz=cutoff_hz)
        session = null.campaign(rng, 208.0, draw, lsb_dps=0.0175, rest=True)
        assert saturation.detect(session.runs, 2) is None
        tops = [np.quantile(np.abs(r.gyro_dps[:, 2]), 0.5) for r in session.runs]
        limit_dps = round(float(max(tops)) / 0.0175) * 0.0175
        cut = with_fault(session, [np.clip(r.gyro_dps, -limit_dps, limit_dps) for r in session.runs])
        found = saturation.detect(cut.runs, 2)
        assert found is not None
        assert found.values["full_scale_dps"] == pytest.approx(limit_dps)


def test_a_fault_s_gain_is_that_of_the_power_it_removes() -> None:
    """Where lines of the spectrum are all of the scatter, no white noise is left to divide by."""
    session = simulate(None, "paper", [], 1, scenarios=3, seconds=20)[0]
    rng, runs = np.random.default_rng(2), []
    for r in session.runs:
        gx_dps = 0.3 * np.sin(2 * np.pi * 31.3 * r.t_s)
        gx_dps[rng.choice(len(r), 5, replace=False)] += 8.0
        runs.append(replace(r, frame=r.table.with_columns(gx_dps=gx_dps), lsb_dps=None))
    current = Current.of(measure(replace(session.with_runs(runs), lsb_dps=None), Model.builtin("default")), "x")
    found = judge(current, effect("bias_jumps"))
    samples = sum(map(len, runs))
    assert found.gain is not None
    assert 0 < found.gain < samples


@pytest.mark.parametrize(("rate_hz", "part"), [pytest.param(25.0, 0.15, marks=pytest.mark.wide), (50.0, 0.08)])
def test_noise_behind_a_low_corner_leaves_its_floor(null: ModuleType, rate_hz: float, part: float) -> None:
    """A second-order low-pass at a small part of the sample rate: its spectrum is not that of an autoregression."""
    rng = np.random.default_rng((5, int(rate_hz)))
    session = null.static(rng, rate_hz, partial(null.low_passed, cutoff_hz=part * rate_hz), seconds=600.0)
    for level in measure(session, Model.builtin("default")).per_axis.values():
        assert level.rms_dps is not None
        assert level.excess_se_dps is not None
        assert abs(level.rms_dps**2 - level.floor_dps**2) < (3 * level.excess_se_dps) ** 2


def test_whiteness_finds_a_rumble_behind_a_low_pass(null: ModuleType) -> None:
    """Noise behind a 5 Hz filter falls within the tested bands; a rumble rises above both sides."""
    rng = np.random.default_rng(3)
    session = null.campaign(rng, 50.0, lambda g, n, f: null.low_passed(g, n, f, 5.0))
    fitted = fit(session, Model.builtin("default"), axes=["z"]).axes["z"]
    assert fitted.design.color.neighbours > 0.05
    assert too_much_power(fitted, "z", alarm=1e-3) is None
    signals = []
    for r in session.runs:
        gyro_dps = r.gyro_dps.copy()
        phase = np.cumsum(2 * np.pi * rng.uniform(1.3, 1.8, len(r)) / 50.0) + rng.uniform(0, 6)
        gyro_dps[:, 2] += 0.04 * np.sin(phase)
        signals.append(gyro_dps)
    loud = fit(with_fault(session, signals), Model.builtin("default"), axes=["z"]).axes["z"]
    found = too_much_power(loud, "z", alarm=1e-3)
    assert found is not None
    assert found.amplitude_dps == pytest.approx(0.04, rel=0.5)
