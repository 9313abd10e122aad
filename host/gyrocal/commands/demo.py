"""``gyrocal demo``."""

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson


def run(
    out: Annotated[Path, typer.Option("--out", "-o", help="Where recording, model, headers and picture go; made anew.")] = Path(
        "demo-out"
    ),
    seed: Annotated[int, typer.Option(help="Another seed, another sensor.")] = 1,
    as_json: AsJson = False,
) -> None:
    """The whole story with no hardware: an effect hidden in a simulated device is found, added, and its error falls."""
    from gyrocal.demo import demo, show
    from gyrocal.extras import want
    from gyrocal.present.output import emit, working

    want("the demonstration", "net", "plot")
    with working(as_json) as say:
        story = demo(out, seed, say)
    if as_json:
        emit(story.to_json())
    else:
        show(story)
