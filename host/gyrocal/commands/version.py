"""``gyrocal version``."""

import json
import platform

from gyrocal import __version__
from gyrocal.commands import AsJson


def run(as_json: AsJson = False) -> None:
    """Show the version."""
    if as_json:
        from gyrocal.json_schemas import VERSIONS

        about = {"gyrocal": __version__, "python": platform.python_version(), "system": platform.platform()}
        print(json.dumps(about | {"answers": VERSIONS}))
        return
    print(f"gyrocal {__version__}")
