"""The menu of what a simulated device hides from its model: each effect says by itself whether it is offered there."""

from __future__ import annotations

import asyncio

from nicegui import ui


def menu() -> ui.select:
    """The menu; without a value until the effects have been read, for which no page waits: their imports take a second."""
    chosen = ui.select({}, label="hidden in it").props("outlined dense")

    async def fill() -> None:
        offered, value = await asyncio.to_thread(_offered)
        chosen.set_options(offered, value=value)

    ui.timer(0, fill, once=True)
    return chosen


def _offered() -> tuple[dict[str, str], str]:
    """What can be hidden, in words by effect, and the effect that is proposed."""
    from gyrocal.effects.base import effects
    from gyrocal.simulation.campaigns import RIPPLE

    return {kind.id: kind.offered_as for kind in effects().values() if kind.offered_as} | {"": "nothing at all"}, RIPPLE
