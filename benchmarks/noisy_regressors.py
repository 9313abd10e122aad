"""Noise of references and thermometers in a diagnosis and in estimates. python benchmarks/noisy_regressors.py [sessions]

Sessions without an effect whose table goes over plateaus, with an encoder's noise and counts: how many are not adequate.
Estimates against planted values, over their standard errors: the scale of a weak swing, the temperature coefficient in
chambers between 25 and 70 degC, with a thermometer's noise of 0.03 degC.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.diagnosis.test_noisy_reference import staircases
from tests.diagnosis.test_thermal_sessions import K1, SECONDS, thermal, with_temperature
from tests.inference.test_noisy_columns import SCALE, scale_of, weak_swing

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.inference.fit import fit

NOISES = ((0.02, 0.0), (0.02, 0.05), (0.03, 0.0), (0.05, 0.01))
LEVELS_DPS = ((0.0, 30.0, -30.0, 60.0, -60.0), (0.0, 40.0, 80.0), (5.0, 10.0, 20.0, 40.0, 80.0, 160.0))


def not_adequate(sessions: int) -> list[str]:
    """Verdicts other than adequate on staircases without an effect."""
    out = []
    for seed in range(sessions):
        levels = LEVELS_DPS[seed % len(LEVELS_DPS)]
        found = diagnose(staircases(1000 + seed, *NOISES[seed % len(NOISES)], levels=levels, seconds=48))
        if found.verdict != "adequate":
            named = found.best.effect.id if found.best else found.comparison.where[0].against
            out.append(f"seed {1000 + seed}: {found.verdict}, {named}")
    return out


def cycled(p_s: np.ndarray, t_s: np.ndarray, cycle: int, face: int, mean_c: float) -> np.ndarray:
    """The chamber warms and cools by 3 degC within each run, so that few power cycles do not limit what is known."""
    return np.asarray(mean_c + 1.5 * np.sin(2 * np.pi * (t_s / SECONDS + cycle / 4 + face / 8)))


def coefficient_z(seed: int) -> float:
    """The error of the temperature coefficient in standard errors, in a chamber whose mean differs from seed to seed."""
    session = thermal(2000 + seed, cycled, mean_c=(25.0, 45.0, 70.0)[seed % 3])
    fitted = fit(session, with_temperature(), axes="z").model
    line = next(line for line in fitted.lines() if line.axis == "z" and line.id == "bias_temperature")
    return (line.values["k1_dps_per_c"] - K1) / line.se["k1_dps_per_c"]


def scale_z(seed: int) -> float:
    """The error of the scale of a weak swing in standard errors."""
    value, se = scale_of(weak_swing(3000 + seed))
    return (value - SCALE) / se


def main() -> None:
    sessions = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    for what, z in (("scale of a weak swing", scale_z), ("temperature coefficient", coefficient_z)):
        errors = np.array([z(seed) for seed in range(sessions)])
        print(f"{what}: {sessions} sessions, z mean {errors.mean():+.2f}, sd {errors.std():.2f}", flush=True)
    wrong = not_adequate(sessions)
    print(f"staircases without an effect: {len(wrong)} of {sessions} not adequate; {'; '.join(wrong)}")


if __name__ == "__main__":
    main()
