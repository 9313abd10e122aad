"""``gyrocal wifi``."""

from typing import Annotated

import typer

from gyrocal.commands import AsJson


def run(
    port: Annotated[
        str, typer.Option(help="The board's serial device, or auto: the first one where a device answers.")
    ] = "auto",
    name: Annotated[
        str | None,
        typer.Option("--join", metavar="NAME", help="Join this network; its password is asked for, or read from stdin."),
    ] = None,
    off: Annotated[bool, typer.Option("--off", help="Leave the network.")] = False,
    forget: Annotated[bool, typer.Option("--forget", help="Delete name, password and token from the board.")] = False,
    as_json: AsJson = False,
) -> None:
    """Let a board join a wireless network, or tell how it stands there.

    A board wants a token of its readers: GYROCAL_TOKEN if it is set, else one is made and printed. The board keeps name,
    password and token over power-off. Sentences and token pass unencrypted: use a network that you trust.
    """
    import os

    from gyrocal.device import wifi
    from gyrocal.device.address import TOKEN_VARIABLE, wants_token, without_token
    from gyrocal.device.find import find_port
    from gyrocal.device.port import Link
    from gyrocal.errors import InputError
    from gyrocal.present import output

    if (name is not None) + off + forget > 1:
        raise InputError("give one of --join, --off and --forget")
    if wants_token(port) and (name is not None or off or forget):
        raise InputError(f"--port {without_token(port)}: the board would cut this connection; give its serial port")
    given = os.environ.get(TOKEN_VARIABLE, "")
    token = (given or wifi.new_token()) if name is not None else ""
    password = ""
    if name is not None:
        password = _password(name)
        wifi.check(name, password, token)
    with Link(find_port(port, network=None)) as link:
        link.greet()
        if name is not None:
            network = wifi.join(link, name, password, token)
        else:
            network = wifi.leave(link, forget=forget) if off or forget else wifi.ask(link)
    if as_json:
        output.emit({**vars(network), "url": network.url, "token": token})
        return
    _show(network.state, network.url, network.host, network.refused)
    if token and not given:
        typer.echo(f"export {TOKEN_VARIABLE}={token}")
    if network.url:
        typer.echo(f"gyrocal monitor --port {network.url}")


def _show(state: str, url: str, host: str, refused: int) -> None:
    where = f": {url}, {host}.local" if url else ""
    typer.echo(f"{state}{where}" + (f"; {refused} connections without the token since power-on" if refused else ""))


def _password(name: str) -> str:
    """What the user types unseen, or the first line of a stdin that is no terminal."""
    import getpass
    import sys

    if sys.stdin.isatty():
        return getpass.getpass(f"Password of {name} (empty for an open network): ")
    return sys.stdin.readline().rstrip("\r\n")
