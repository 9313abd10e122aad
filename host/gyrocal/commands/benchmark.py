"""``gyrocal benchmark``."""

from typing import Annotated

import typer

from gyrocal.commands import AsJson

NAMES = (
    "blind (naming), paper (tables), robustness, inference (cost), population and coverage (errors) or "
    "real (recordings by others)."
)


def run(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help=NAMES)
    ],
    sample: Annotated[bool, typer.Option("--sample", help="A few cases alone, for a quick look.")] = False,
    as_json: AsJson = False,
) -> None:
    """Measure how good the tool is, on cases fixed beforehand (from a checkout)."""
    from gyrocal.benchmark import benchmark, show
    from gyrocal.present.output import emit

    found = benchmark(name, sample=sample, quiet=as_json)
    if as_json:
        emit(found)
    else:
        show(name, found)
