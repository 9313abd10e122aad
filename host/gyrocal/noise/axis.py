"""The noise of one axis: white noise, drift, and the changes of bias and scale from power cycle to power cycle."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gyrocal.errors import InputError, did_you_mean
from gyrocal.noise.component import NoiseComponent
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale

COMPONENTS: dict[str, NoiseComponent] = {kind.id: kind for kind in (TurnOnBias(), Drift())}
"""The noise components with an id, not fitted yet, in the order in which a model lists them."""


@dataclass(frozen=True)
class AxisNoise:
    """The noise of one axis. A component that is None is absent. A white level (one sample, deg/s) of None is not known yet."""

    white_sd_dps: float | None = None
    drift: Drift | None = None
    turn_on_bias: TurnOnBias | None = None
    turn_on_scale: TurnOnScale | None = None

    @property
    def components(self) -> list[NoiseComponent]:
        """The components of this axis that have an id, in order."""
        return [c for kind in COMPONENTS.values() if (c := getattr(self, kind.field_name)) is not None]

    def having(self, component: NoiseComponent) -> AxisNoise:
        """The same noise with a component added or replaced."""
        return replace(self, **{component.field_name: component})  # type: ignore[arg-type]

    def without(self, component_id: str) -> AxisNoise:
        """The same noise without the component of this id."""
        return replace(self, **{component(component_id).field_name: None})


def component(component_id: str) -> NoiseComponent:
    """One component by id, not fitted yet. Raises InputError, which lists the known ids, if there is none."""
    try:
        return COMPONENTS[component_id]
    except KeyError:
        near = did_you_mean(component_id, COMPONENTS)
        raise InputError(f"no noise {component_id!r}{near}; there are {', '.join(COMPONENTS)}") from None
