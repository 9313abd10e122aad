"""``gyrocal workbench``."""

from pathlib import Path
from typing import Annotated

import typer


def run(
    session: Annotated[Path | None, typer.Argument(metavar="[SESSION]", help="A session folder to open.")] = None,
    port: Annotated[str | None, typer.Option(help="The device to listen to: its serial port or tcp://host:port.")] = None,
    host: Annotated[
        str, typer.Option(help="Where to serve the page; beyond this machine only with the token that is printed.")
    ] = "127.0.0.1",
    http_port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="The page's port; the first free one from 8750 by default.")
    ] = None,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")] = True,
) -> None:
    """A local page: does the model fit, what is missing, add it, see the error fall. Ctrl-C ends it.

    The page reads and writes in the folder where it was started, and in SESSION.
    """
    from gyrocal.device.address import keep_token
    from gyrocal.web.server import serve

    if session is not None:
        from gyrocal.recording.header import folder_of, read_header

        session = folder_of(session)
        read_header(session)
    serve(session, None if port is None else keep_token(port), host, http_port, browser=browser)
