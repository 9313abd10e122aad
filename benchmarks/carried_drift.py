"""The errors of slow effects where the bias goes on from run to run of a power cycle, and where it begins anew in each.

    python benchmarks/carried_drift.py                  # 120 sessions of each kind: two minutes of one core
    python benchmarks/carried_drift.py --sessions 30    # fewer

Each session has 2 to 6 power cycles of 6 to 12 runs of 8 to 25 s, at rates between -200 and 200 deg/s, warms up by 2 to 8 degC,
and has white noise of 10 to 100 mdps and a drift of 6 to 60 % of it over 20 to 630 s. It is fitted with the model that made it.
The table shows the root mean square of the distances between estimate and truth over the standard error, which is 1 where the
errors are right, without and with what a drift that goes on adds (docs/details/errors.md).
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Literal

import numpy as np
import polars as pl

from gyrocal.error_model.model import Model, Term
from gyrocal.inference.fit import fit
from gyrocal.inference.standard_errors import finish
from gyrocal.noise.drift import ou_noise
from gyrocal.recording.session import Run, Session

TRUE = {"bias_temperature": -0.02, "scale_temperature": 1e-4}
NAMES = {"bias_temperature": "k1_dps_per_c", "scale_temperature": "k_per_c"}
RATES_DPS = [0.0, 10.0, 20.0, 30.0, 45.0, 60.0, 78.0, 100.0, 120.0, 150.0, 200.0]


def session(seed: int, goes_on: bool) -> Session:
    """A session on a turntable; two kinds of one seed have the same protocol."""
    rng = np.random.default_rng((77, seed))
    cycles, rates = int(rng.integers(2, 7)), rng.choice(RATES_DPS, int(rng.integers(3, 7)), replace=False)
    rates *= rng.choice([-1, 1], rates.size)
    if np.ptp(rates) < 60:
        rates[:2] = 110.0, -80.0
    rate_hz, run_s, white_dps = float(rng.choice([20, 40])), float(rng.uniform(8, 25)), float(10 ** rng.uniform(-2, -1))
    sd_dps, tau_s = white_dps * float(10 ** rng.uniform(-1.2, -0.2)), float(10 ** rng.uniform(1.3, 2.8))
    heat_c, warm_s, sample = rng.uniform(2, 8), rng.uniform(80, 400), np.arange(round(run_s * rate_hz))
    runs: list[Run] = []
    for cycle in range(cycles):
        turns = [(sign, rate) for sign in (1, -1) for rate in rates.tolist()]
        place = np.cumsum(sample.size + rng.integers(round(2 * rate_hz), round(8 * rate_hz), len(turns)))[:, None] + sample
        if goes_on:
            own = ou_noise(place.max() + 1, 1 / rate_hz, sd_dps, tau_s, 1, rng)[place, 0]
        else:
            own = ou_noise(sample.size, 1 / rate_hz, sd_dps, tau_s, len(turns), rng).T
        offset_dps, ambient_c = rng.normal(0.4, 0.05), rng.uniform(19, 25)
        for (sign, rate), at_s, of_run in zip(turns, place / rate_hz, own, strict=True):
            warmer_c = ambient_c + heat_c * (1 - np.exp(-at_s / warm_s)) - 25
            slow = TRUE["bias_temperature"] * warmer_c + (1.01 + TRUE["scale_temperature"] * warmer_c) * sign * rate
            z = slow + offset_dps + of_run + rng.normal(0, white_dps, sample.size)
            columns = {"t_s": sample / rate_hz, "gx_dps": 0.0 * z, "gy_dps": 0.0 * z, "gz_dps": z, "temp_c": warmer_c + 25}
            face: Literal["up", "down"] = "up" if sign > 0 else "down"
            runs.append(Run(
                len(runs), f"{len(runs):03d}_{face}.csv", f"s{cycle:03d}", face, "z", rate, None, None, float(at_s[0]), rate_hz,
                frame=pl.DataFrame(columns),
            ))  # fmt: skip
    return Session(rate_hz, tuple(runs))


def distances(made: Session) -> Mapping[str, tuple[float, float]]:
    """The distance from the truth in standard errors, without and with what a drift that goes on adds, by effect."""
    model = Model.builtin("default")
    for effect in TRUE:
        model = model.with_term(Term(effect, "z", {}))
    told = fit(made, model, axes="z").axes["z"]
    plain = {term.effect_id: term for term in finish(told).terms}
    out = {}
    for term in told.terms:
        if term.effect_id in TRUE:
            name = NAMES[term.effect_id]
            off = term.values[name] - TRUE[term.effect_id]
            out[term.effect_id] = off / plain[term.effect_id].se[name], off / term.se[name]
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=120)
    count = parser.parse_args().sessions
    print("| bias | effect | sessions | without | beyond two errors | with | beyond two errors |\n" + "| --- " * 7 + "|")
    for goes_on in (True, False):
        found = [distances(session(seed, goes_on)) for seed in range(count)]
        for effect in TRUE:
            off = np.abs(np.array([one[effect] for one in found]))
            rms, beyond = np.sqrt(np.mean(off**2, axis=0)), 100 * np.mean(off > 2, axis=0)
            cells = " | ".join(f"{rms[k]:.2f} | {beyond[k]:.0f} %" for k in range(2))
            print(f"| {'goes on' if goes_on else 'begins anew'} | {effect} | {count} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
