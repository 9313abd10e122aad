"""What a population is worth to a new board: errors after 2, 4 and 6 s with factory priors, with populations, and the limit.

    python benchmarks/fleet_prior.py

The boards warm up after power-on by an amount that differs from board to board, which a few seconds on the table do not show.
A population of n boards is pooled from n estimates. These are drawn from the likelihood: the truth of each board plus an error
with the standard error that the fit of a few simulated boards has. The new boards are drawn from the true population, and none
of them is in a fit. The limit knows the true population.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from typing import Any

import numpy as np

from gyrocal.calibration.estimator import calibration_of
from gyrocal.calibration.scenarios import Protocol, Simulation, answers
from gyrocal.effects.base import effect
from gyrocal.error_model.model import Model
from gyrocal.fleet.pooling import pool
from gyrocal.inference.fit import fit
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale
from gyrocal.present.output import table
from gyrocal.simulation.production import BIAS_DPS, BIAS_SD_DPS, SCALE, SCALE_SD, Planted, Production
from gyrocal.simulation.simulate import OU_SD_DPS, OU_TAU_S, TURN_ON_SD_DPS, WHITE_SD_DPS

WARMUP_DPS, WARMUP_SD_DPS, TAU_S = 0.06, 0.02, 40.0
TRUTH = {"scale": (SCALE, SCALE_SD), "bias_dps": (BIAS_DPS, BIAS_SD_DPS), "A_dps": (WARMUP_DPS, WARMUP_SD_DPS)}
FACTORY = {"scale": (0.0, 0.01), "bias_dps": (0.0, 1.0), "A_dps": (0.0, effect("warmup").parameter("A_dps").typical[1])}
"""Means and standard deviations that datasheets give: LSM6DSO, table 2; the largest typical warm-up."""
SECONDS, BOARDS = (2.0, 4.0, 6.0), (10, 100, 1000)

Population = dict[str, tuple[float, float, float, float]]
"""Mean, its standard error, spread and its standard error of each parameter."""


def model_of(population: Population) -> Model:
    """The model that `population.toml` would be."""
    model = Model.open().add("warmup", "z")
    terms = []
    for term in model.on("z"):
        name = term.effect.linear[0]
        mean, se, sd, sd_se = population[name]
        values, errors = {name: mean}, {name: se}
        if name != "scale":
            values[f"{name}_sd"], errors[f"{name}_sd"] = sd, sd_se
        if term.effect_id == "warmup":
            values["tau_s"] = TAU_S
        terms.append(replace(term, values=values, se=errors))
    noise = AxisNoise(WHITE_SD_DPS, Drift(OU_SD_DPS, OU_TAU_S), TurnOnBias(TURN_ON_SD_DPS))
    noise = replace(noise, turn_on_scale=TurnOnScale(population["scale"][2], population["scale"][3]))
    return replace(model, terms=tuple(terms), noise={"z": noise})


def errors_of_one_board(boards: int) -> dict[str, float]:
    """The median standard error of each parameter in the fit of a simulated board."""
    made = Production([Planted("warmup", "A_dps", WARMUP_DPS, WARMUP_SD_DPS, nonlinear={"tau_s": TAU_S})], seed=31)
    known = model_of({name: (mean, 0.0, sd, 0.0) for name, (mean, sd) in TRUTH.items()})
    wanted = replace(known, noise=Model.open().noise)
    found = [fit(made.board(n), wanted, axes=("z",)).axes["z"] for n in range(boards)]
    return {name: float(np.median([t.se[name] for f in found for t in f.terms if name in t.se])) for name in TRUTH}


def population_of(n: int, se: dict[str, float], rng: np.random.Generator) -> Population:
    """The population that n boards' estimates have."""
    out = {}
    for name, (mean, sd) in TRUTH.items():
        found = pool(rng.normal(mean, sd, n) + rng.normal(0.0, se[name], n), np.full(n, se[name]))
        assert found is not None
        out[name] = found.mean, found.se, found.sd, found.sd_se
    return out


def table_of(new: int, repeated: int, fits: int) -> list[dict[str, Any]]:
    """Root mean square errors of scale and bias for each prior and time."""
    rng, protocol, se = np.random.default_rng(7), Protocol(), errors_of_one_board(fits)
    exact = {name: (mean, 0.0, sd, 0.0) for name, (mean, sd) in TRUTH.items()}
    drawn = Simulation(calibration_of(model_of(exact), "z"), protocol, SECONDS[-1], by_sample=True).draw(new, rng)
    priors: list[tuple[str, list[Population]]] = [
        ("factory", [{name: (mean, 0.0, sd, 0.0) for name, (mean, sd) in FACTORY.items()}]),
        *((f"{n} boards", [population_of(n, se, rng) for _ in range(repeated)]) for n in BOARDS),
        ("limit", [exact]),
    ]
    rows = []
    for name, populations in priors:
        for seconds in SECONDS:
            squares = []
            for population in populations:
                found = answers(calibration_of(model_of(population), "z"), drawn.up, drawn.down, seconds, protocol)
                off = found.scale - drawn.scale, found.bias_dps - drawn.bias_dps
                squares.append([np.mean(o**2) for o in off] + [np.mean((o / s) ** 2) for o, s in zip(
                    off, (found.scale_se, found.bias_se_dps), strict=True)])  # fmt: skip
            scale, bias_dps, z_scale, z_bias = np.sqrt(np.mean(squares, axis=0))
            rows.append({
                "prior": name, "seconds": seconds, "scale_rms": scale, "bias_rms_dps": bias_dps,
                "scale_rms_over_se": z_scale, "bias_rms_over_se": z_bias,
            })  # fmt: skip
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--new", type=int, default=1000, help="boards that are in no fit")
    parser.add_argument("--repeated", type=int, default=10, help="populations of each size")
    parser.add_argument("--fits", type=int, default=8, help="simulated boards whose standard errors are taken")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    rows = table_of(given.new, given.repeated, given.fits)
    if given.json:
        print(json.dumps(rows))
        return
    columns = ["prior:", "first s", "scale rms", "bias rms, dps", "scale: error/se", "bias: error/se"]
    table("Boards that are in no fit", columns, [
        [r["prior"], f"{r['seconds']:g}", f"{r['scale_rms']:.2e}", f"{r['bias_rms_dps']:.4f}",
         f"{r['scale_rms_over_se']:.2f}", f"{r['bias_rms_over_se']:.2f}"] for r in rows
    ])  # fmt: skip


if __name__ == "__main__":
    main()
