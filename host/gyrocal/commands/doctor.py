"""``gyrocal doctor``."""

from typing import Annotated

import typer


def run(
    port: Annotated[
        str, typer.Option(help="A serial device, tcp://host:port, or auto: the first where a device answers.")
    ] = "auto",
    seconds: Annotated[float, typer.Option(min=2.0, help="How long to listen to the samples.")] = 10.0,
    restart: Annotated[
        bool, typer.Option("--restart/--no-restart", help="Start the board again, to see whether it keeps what it stored.")
    ] = True,
    turn: Annotated[bool, typer.Option("--turn", help="Ask for a turn by hand, to see that axes and signs are right.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Examine a board that lies still: bus, sensor, self-test, rates, noise, clock, losses, memory, what it keeps.

    One line for each check, with what to do where something is wrong. Exits with 1 if a check failed, with 3 if no device
    answers.
    """
    import json

    from gyrocal.device.address import without_token
    from gyrocal.device.doctor import Check, Doctor
    from gyrocal.device.find import find_port
    from gyrocal.device.port import Link

    def tell(check: Check) -> None:
        if not as_json:
            word = {True: "OK", False: "WRONG", None: "-"}[check.ok]
            sensor = f"sensor {check.imu}: " if check.imu else ""
            typer.echo(f"{word:5}  {check.name:20} {sensor}{check.found}" + (f"; {check.advice}" if check.advice else ""))

    def ask(words: str) -> None:
        typer.echo(words, err=True)

    name = find_port(port)
    with Link(name, reconnect=True) as link:
        checks = Doctor(link, seconds, restart=restart, ask=ask if turn else None).run(tell)
    well = all(check.ok is not False for check in checks)
    if as_json:
        typer.echo(json.dumps({"port": without_token(name), "ok": well, "checks": [check.to_json() for check in checks]}))
    if not well:
        raise typer.Exit(1)
