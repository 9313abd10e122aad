"""All that is certain added at once, as ``gyrocal explain`` does it: one step of the model for each of its steps."""

from __future__ import annotations

from gyrocal.web.state.workbench import Workbench
from gyrocal.web.values.models import Recipe, Step, doubted
from gyrocal.web.values.views import ExplainedView


async def explain_all(bench: Workbench) -> None:
    """Add every missing effect that is certain, and show what is left. Undo takes back one step at a time."""
    if bench.session is None or bench.step is None:
        return
    source = bench.step.source
    asked = (bench.recording, source, doubted(bench.steps))
    found: ExplainedView | None = await bench.ask("Adding all that is certain", "explain", *asked)
    if found is None:
        return
    steps = []
    for made in found.made:
        effect, *also = made.effects
        proves = found.proves if made is found.made[-1] else ()
        recipe = Recipe(made.view.toml, effect, made.title, cards=made.cards, also=tuple(also), proves=proves)
        steps.append(Step(recipe, made.view))
    bench.found(steps[-1].source if steps else source, found.found)
    if steps:
        await bench.take(*steps)
    else:
        bench.say("Nothing is certain beside this model, so nothing was added.")
