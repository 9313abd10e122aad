"""The menu of effects that a simulated device can hide from its model. Each effect defines whether it is offered."""

from __future__ import annotations

import asyncio

from nicegui import ui


def menu() -> ui.select:
    """The menu. It has no value until the effects have been imported, which takes a second; the page does not wait for it."""
    chosen = ui.select({}, label="hidden in it").props("outlined dense")

    async def fill() -> None:
        offered, value = await asyncio.to_thread(offered_and_proposed)
        chosen.set_options(offered, value=value)

    ui.timer(0, fill, once=True)
    return chosen


def offered_and_proposed() -> tuple[dict[str, str], str]:
    """:func:`offered`, and the id that is proposed."""
    from gyrocal.simulation.campaigns import RIPPLE

    return offered(), RIPPLE


def offered() -> dict[str, str]:
    """The titles of the effects that can be hidden, by id; the empty id is no effect."""
    from gyrocal.effects.base import effects

    return {kind.id: kind.offered_as for kind in effects().values() if kind.offered_as} | {"": "nothing at all"}
