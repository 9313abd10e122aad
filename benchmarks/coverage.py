"""Do 68 % intervals cover the truth in 68 % of sessions? python benchmarks/coverage.py [sessions]

Short simulated campaigns with a bias that moves with temperature and a ripple of the table of another size and phase in each
run. Each parameter's interval, value +- standard error, is compared with the planted value.
"""

from __future__ import annotations

import sys

import numpy as np

from gyrocal.effects.base import effect
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Run, Session
from gyrocal.simulation.simulate import simulate

SESSIONS = 400
SCENARIOS, SECONDS = 12, 10.0
TRUTH = {
    ("scale", "scale"): 0.004, ("bias", "bias_dps"): -0.05, ("bias_temperature", "k1_dps_per_c"): 0.01,
    ("table_ripple", "amplitude_1"): 0.0016, ("turn_on_bias", "sd_dps"): 0.005,
}  # fmt: skip
AIM = (0.63, 0.73)

Key = tuple[str, str]


def recording(seed: int) -> Session:
    """One campaign with :data:`TRUTH` planted on z."""
    planted = [f"{e}:{name}={value}" for (e, name), value in TRUTH.items() if e != "table_ripple"]
    session, _ = simulate(None, "paper", planted, seed, scenarios=SCENARIOS, seconds=SECONDS)
    rng = np.random.default_rng((seed, 2))
    ripple = effect("table_ripple")
    runs = []
    for r in session.runs:
        size = TRUTH["table_ripple", "amplitude_1"] / np.sqrt(2) * rng.normal(size=2)
        gz_dps = r.gyro_dps[:, 2] + ripple.columns(r, 2, {"amplitude_1": 1.0}) @ size
        runs.append(
            Run(
                r.index, r.file, r.scenario, r.face, r.axis, r.table_rate_dps, None, r.day, r.power_on_s, r.sample_rate_hz,
                frame=r.table.with_columns(gz_dps=gz_dps), lsb_dps=r.lsb_dps,
            )
        )  # fmt: skip
    return session.with_runs(runs)


def pulls(seed: int) -> dict[Key, float]:
    """(value - truth) / standard error of each parameter, from one campaign."""
    model = Model.builtin("default")
    model = model.with_term(Term("bias_temperature", "z", {"k1_dps_per_c": 0.0}))
    model = model.with_term(Term("table_ripple", "z", {"amplitude_1": 0.0}))
    fitted = fit(recording(seed), model, axes="z").model
    found: dict[Key, float] = {}
    for (effect_id, name), truth in TRUTH.items():
        line = fitted.line(effect_id, "z")
        assert line is not None
        found[effect_id, name] = (line.values[name] - truth) / line.se[name]
    return found


def main() -> int:
    sessions = int(sys.argv[1]) if len(sys.argv) > 1 else SESSIONS
    all_pulls = [pulls(seed) for seed in range(sessions)]
    print(f"{sessions} campaigns of {SCENARIOS} scenarios, {SECONDS:g} s a run; 68 % intervals should cover 68 +- 5 %")
    print("parameter                        covers      mean pull   sd of pulls")
    met = True
    for key in TRUTH:
        z = np.array([p[key] for p in all_pulls])
        covers = float(np.mean(np.abs(z) < 1.0))
        met &= AIM[0] <= covers <= AIM[1]
        error = np.sqrt(covers * (1 - covers) / sessions)
        print(f"{'.'.join(key):30s} {covers:6.1%} ± {error:4.1%} {z.mean():+11.2f} {z.std():13.2f}")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
