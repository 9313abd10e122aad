"""``gyrocal version``."""

from gyrocal import __version__


def run() -> None:
    """Show the version."""
    print(f"gyrocal {__version__}")
