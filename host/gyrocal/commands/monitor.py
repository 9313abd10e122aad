"""``gyrocal monitor``."""

from typing import Annotated, Any

import typer


def run(
    port: Annotated[str, typer.Option(help="A serial device, tcp://host:port, or auto: the first where a device answers.")],
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Stop after so long; else when the device ends.")
    ] = None,
    reconnect: Annotated[bool, typer.Option("--reconnect", help="Wait for a device that went away.")] = False,
    self_test: Annotated[
        bool, typer.Option("--self-test", help="Begin with the sensor's own test of its gyroscope, at rest.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object for each event, one a line.")] = False,
) -> None:
    """Watch a device live: state, samples, results with their standard errors, what was lost.

    Ends with the device, with --seconds or with Ctrl-C.
    """
    import contextlib
    import json
    import sys
    import time

    from gyrocal.device.find import find_port
    from gyrocal.device.monitor import Monitor
    from gyrocal.device.port import Link

    with Link(find_port(port), reconnect=reconnect) as link, contextlib.suppress(KeyboardInterrupt):
        monitor = Monitor(link, self_test=self_test)
        if as_json:

            def say(events: list[dict[str, Any]]) -> None:
                sys.stdout.writelines(json.dumps(event) + "\n" for event in events)
                sys.stdout.flush()

            monitor.run(say, seconds)
            return

        from rich.live import Live

        drawn_at = 0.0
        with Live(auto_refresh=False) as live:

            def draw(events: list[dict[str, Any]]) -> None:
                nonlocal drawn_at
                ended = any(event["event"] == "end" for event in events)
                if ended or time.monotonic() - drawn_at > 0.1:
                    drawn_at = time.monotonic()
                    live.update(monitor.screen(), refresh=True)

            monitor.run(draw, seconds)
