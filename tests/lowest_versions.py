"""Print the lowest version of each requirement as a constraint for pip: ``python tests/lowest_versions.py pyproject.toml``."""

import sys
import tomllib
from pathlib import Path

EXTRAS = ("page", "net", "import", "ros", "fleet")


def constraints(pyproject: str) -> list[str]:
    """``name==version`` of every requirement of the package and of the extras that are tested so."""
    project = tomllib.loads(pyproject)["project"]
    optional = project["optional-dependencies"]
    wanted = [*project["dependencies"], *(line for extra in EXTRAS for line in optional[extra])]
    return [line.replace(">=", "==") for line in wanted]


if __name__ == "__main__":
    print(*constraints(Path(sys.argv[1]).read_text(encoding="utf-8")), sep="\n")
