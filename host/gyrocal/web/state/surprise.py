"""A session with an effect that nobody is told: the person hunts it, and asks for the truth at the end."""

from __future__ import annotations

import asyncio
import json
import random
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gyrocal.web.state.workbench import Workbench


@dataclass
class Secret:
    """What is hidden in a session; ``told`` once the person has asked."""

    effect: str
    told: bool = False


class Hunt:
    """The surprises that were made since the workbench was started."""

    def __init__(self, bench: Workbench) -> None:
        self._bench = bench
        self._secrets: dict[Path, Secret] = {}

    async def begin(self) -> None:
        """Draw one of the effects that can be hidden, simulate a session with it and open that."""
        from gyrocal.web.device.hidden_effects import offered

        names = await asyncio.to_thread(offered)
        effect = random.choice([name for name in names if name])
        before = self._bench.session
        await self._bench.simulate([effect])
        session = self._bench.session
        if session is not None and session is not before:
            self._secrets[session.path] = Secret(effect)
            self._bench.changed("session")

    @property
    def secret(self) -> Secret | None:
        """The secret of the session that is open, if it is a surprise."""
        session = self._bench.session
        return None if session is None else self._secrets.get(session.path)

    def tell(self) -> None:
        """Show the truth from now on."""
        if self.secret is not None:
            self.secret.told = True
            self._bench.changed("session")

    def truth(self) -> str:
        """The truth in a sentence, with the sizes of the first run, and whether the model of now holds it."""
        from gyrocal.effects.base import effects

        assert self.secret is not None
        assert self._bench.session is not None
        kind = effects()[self.secret.effect]
        step = self._bench.step
        held = step is not None and any(effect == kind.id for effect, _, _ in step.view.effects)
        found = "Your model has it." if held else "Your model does not have it."
        return f"Hidden was: {kind.title}{_sizes(self._bench.session.path, kind)}. {found}"


def _sizes(session: Path, kind: Any) -> str:
    from gyrocal.present.report import sized  # the engine, which is loaded by now

    truth = json.loads(Path(f"{session}.truth.json").read_text(encoding="utf-8"))
    planted = next((e for e in truth["runs"][0]["effects"] if e["id"] == kind.id), None)
    if planted is None:
        return ""
    values = {name: v for name, v in planted.items() if isinstance(v, float) and v and "phase" not in name}
    sizes = sized(kind, values, {})
    return f" on {planted['axis']} ({sizes})" if sizes else f" on {planted['axis']}"
