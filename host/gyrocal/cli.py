"""The command line: finds one file a command, turns errors into one line and an exit code."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
from importlib.metadata import entry_points
from typing import Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_command

from gyrocal import __version__
from gyrocal.errors import GyrocalError

PACKAGE = "gyrocal.commands"
INTERRUPTED = 130
"""The exit code of the argument parser after Ctrl-C."""


def command_modules() -> dict[str, str]:
    """The module of each verb: the files of ``commands/``, and entry points of that group (``train``, ``export``)."""
    folder = importlib.import_module(PACKAGE).__path__
    found = {info.name.rstrip("_"): f"{PACKAGE}.{info.name}" for info in pkgutil.iter_modules(folder)}
    found.update({point.name: point.value for point in entry_points(group=PACKAGE)})
    return dict(sorted(found.items()))


class LazyGroup(TyperGroup):
    """A group that imports a command's file only when that command runs, so that ``gyrocal VERB`` starts fast."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(command_modules())

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        modules = command_modules()
        if cmd_name not in modules:
            return None
        run = importlib.import_module(modules[cmd_name]).run
        single = typer.Typer(add_completion=False, rich_markup_mode=None)
        single.command(name=cmd_name, help=inspect.getdoc(run))(run)
        command = get_command(single)
        command.name = cmd_name
        return command


app = typer.Typer(cls=LazyGroup, add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"gyrocal {__version__}")
        raise typer.Exit


@app.callback()
def root(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    version: Annotated[bool, typer.Option("--version", callback=_print_version, is_eager=True)] = False,
) -> None:
    """Calibrate a MEMS gyroscope, and find the physical effect that its error model is missing."""


def main(argv: list[str] | None = None) -> int:
    """Run one command and return its exit code: 0 done, 1 failed, 2 bad usage or input, 3 device or port."""
    arguments = sys.argv[1:] if argv is None else argv
    debug = "--debug" in arguments
    arguments = [a for a in arguments if a != "--debug"]
    try:
        result = get_command(app).main(args=arguments, prog_name="gyrocal", standalone_mode=False)
        if result == INTERRUPTED:
            return _fail("stopped", 1)
        return result if isinstance(result, int) else 0
    except GyrocalError as error:
        if debug:
            raise
        return _fail(str(error), error.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        return _fail("stopped", 1)
    except BrokenPipeError:
        sys.stderr.close()
        return 1
    except Exception as error:
        if hasattr(error, "format_message"):  # the argument parser's own errors
            return _fail(f"{error.format_message()} See: gyrocal --help", 2)
        if debug:
            raise
        return _fail(f"{type(error).__name__}: {error} (run with --debug to see where)", 1)


def _fail(message: str, code: int) -> int:
    print("gyrocal: " + " ".join(message.split()), file=sys.stderr)
    return code
