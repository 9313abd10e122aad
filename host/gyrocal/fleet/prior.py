"""The population as a model: the prior of a board that has not been measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gyrocal.effects.base import Role, Values
from gyrocal.error_model.fitted_on import together
from gyrocal.error_model.model import Model, Term
from gyrocal.fleet.pooling import Pooled
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale
from gyrocal.recording.session import AXES

if TYPE_CHECKING:
    from gyrocal.fleet.fit import Fleet


def population_model(fleet: Fleet) -> Model:
    """The model of a board that was not in the fleet.

    Each parameter has the population's mean with its standard error, and ``NAME_sd`` is its spread over boards and rigs (for
    the scale also over power cycles). The noise is that of the fleet; its turn-on bias is the spread over power cycles of one
    board. Parameters without a population are left out.
    """
    terms = tuple(_term(term, fleet.population) for term in fleet.model.terms)
    noise = {axis: _noise(fleet, axis) for axis in AXES}
    name = f"{fleet.model.name}, population of {len({b.board for b in fleet.boards})} boards"
    return Model(name, terms, noise, together(board.fitted_on for board in fleet.boards))


def _spread(pooled: Pooled) -> tuple[float, float]:
    """The spread over boards and rigs, and its standard error."""
    sd = float(np.hypot(pooled.sd, pooled.rig_sd or 0.0))
    parts = pooled.sd * pooled.sd_se, (pooled.rig_sd or 0.0) * (pooled.rig_sd_se or 0.0)
    return sd, float(np.hypot(*parts)) / sd if sd > 0 else pooled.sd_se


def _term(term: Term, population: dict[str, Pooled]) -> Term:
    values: Values = {}
    se: Values = {}
    for parameter in term.effect.parameters:
        pooled = population.get(f"{term.effect_id}.{term.axis}.{parameter.name}")
        if pooled is not None:
            values[parameter.name], se[parameter.name] = pooled.mean, pooled.se
            if term.effect.role is not Role.SCALE and parameter.name in term.effect.linear:
                values[f"{parameter.name}_sd"], se[f"{parameter.name}_sd"] = _spread(pooled)
    return replace(term, values=values, se=se)


def _noise(fleet: Fleet, axis: str) -> AxisNoise:
    """The noise of a board of the fleet: medians of the boards' white levels, the fleet's drift and turn-on spreads."""
    wanted, levels = fleet.model.noise_on(axis), fleet.estimates.get(f"white_noise.{axis}.sd_dps")
    if levels is None:
        return wanted
    white = float(np.median(levels.values))
    noise = AxisNoise(white)
    if wanted.drift is not None:
        drift = fleet.drifts[axis]
        noise = noise.having(Drift(drift.size * white, drift.tau_s))
    spreads = {
        columns[j]: float(sd)
        for (columns, random), of in fleet.spreads.items() for j, sd in zip(random, of, strict=True)
        if columns[j].split(".")[1] == axis
    }  # fmt: skip
    by_role = {t.effect.role: f"{t.effect_id}.{axis}.{t.effect.linear[0]}" for t in fleet.model.on(axis) if t.effect.role}
    if wanted.turn_on_bias is not None:
        noise = noise.having(TurnOnBias(spreads.get(by_role.get(Role.BIAS, ""))))
    scale = fleet.population.get(by_role.get(Role.SCALE, ""))
    if scale is not None:
        sd, sd_se = _spread(scale)
        noise = replace(noise, turn_on_scale=TurnOnScale(float(np.hypot(sd, spreads.get(by_role[Role.SCALE], 0.0))), sd_se))
    return noise
