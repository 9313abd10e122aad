"""The command line. Each command is one file; errors become one line and an exit code."""

from __future__ import annotations

import ast
import errno
import importlib
import importlib.util
import inspect
import os
import pkgutil
import sys
from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from gyrocal import __version__, verbosity
from gyrocal.errors import GyrocalError, did_you_mean

PACKAGE = "gyrocal.commands"
INTERRUPTED = 130
"""The exit code after Ctrl-C, as shells have it, and what the argument parser returns then."""
ALIASES = {"correct": "apply", "fit": "calibrate", "gui": "workbench"}
"""Other names that people type for a verb."""
HELP = {"help_option_names": ["-h", "--help"]}
OUT = ("-o", "--out")
ANYWHERE = {
    "--debug": "debug", "-q": "quiet", "--quiet": "quiet", "-v": "verbose", "--verbose": "verbose",
}  # fmt: skip
"""Options of the whole program, which may stand before or behind the verb."""


def command_modules() -> dict[str, str]:
    """The module of each verb: the files of ``commands/``, and entry points of that group (``train``, ``export``)."""
    folder = importlib.import_module(PACKAGE).__path__
    found = {info.name.rstrip("_"): f"{PACKAGE}.{info.name}" for info in pkgutil.iter_modules(folder)}
    found.update({point.name: point.value for point in entry_points(group=PACKAGE)})
    return dict(sorted(found.items()))


def about(module: str) -> str:
    """The help of a command: the first paragraph of the docstring of its ``run``, read without importing the command."""
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        return ""
    with open(spec.origin, encoding="utf-8") as file:
        tree = ast.parse(file.read())
    run = next((node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "run"), None)
    text = ast.get_docstring(run) if run is not None else None
    return " ".join((text or "").split("\n\n")[0].split())


class Verb(TyperCommand):
    """A command whose last argument, if that is OUT, may also be given as ``-o OUT`` or ``--out OUT``."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        """The arguments, with what follows ``-o`` moved to their end."""
        argument = any(p.param_type_name == "argument" and p.name == "out" for p in self.params)
        at = next((i for i, word in enumerate(args) if argument and word in OUT), None)
        if at is not None and at + 1 < len(args):
            args = [*args[:at], *args[at + 2 :], args[at + 1]]
        return super().parse_args(ctx, args)


class LazyGroup(TyperGroup):
    """A group that imports a command's file only when that command runs, so that ``gyrocal VERB`` starts fast."""

    started: Callable[[], Any] = staticmethod(lambda: None)
    """Called when the command's file has been imported, before the command runs."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of the commands, in the order of the help."""
        return list(command_modules())

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of this name, whose module is imported now, or None."""
        modules = command_modules()
        cmd_name = ALIASES.get(cmd_name, cmd_name)
        if cmd_name not in modules:
            return None
        run = importlib.import_module(modules[cmd_name]).run
        single = typer.Typer(add_completion=False, rich_markup_mode=None, context_settings=HELP)
        single.command(name=cmd_name, cls=Verb, help=inspect.getdoc(run))(run)
        command = get_command(single)
        command.name = cmd_name
        return command

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the words name. An unknown name fails with the nearest one."""
        modules = command_modules()
        if args[0] not in modules and args[0] not in ALIASES:
            near = did_you_mean(args[0], [*modules, "--help"])
            ctx.fail(f"no command {args[0]!r}{near}; there are {', '.join(modules)}.")
        found = super().resolve_command(ctx, args)
        LazyGroup.started()
        return found

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list of commands to the help."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, about(module)) for name, module in command_modules().items()])
        formatter.write_text("Also: " + ", ".join(f"{alias} for {verb}" for alias, verb in ALIASES.items()) + ".")


app = typer.Typer(
    cls=LazyGroup, rich_markup_mode=None, pretty_exceptions_enable=False, context_settings=HELP
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"gyrocal {__version__}")
        raise typer.Exit


@app.callback()
def root(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors, and what --json prints.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Say on stderr what is being done, with the seconds since the start.")
    ] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Calibrate a MEMS gyroscope, and find the physical effect that its error model is missing."""


def main(argv: list[str] | None = None, *, started: Callable[[], Any] = lambda: None) -> int:
    """Run one command and return its exit code: 0 done, 2 bad usage or input, 3 device or port, 130 Ctrl-C, 1 else.

    ``started`` is called when the command's own file has been imported.
    """
    arguments = sys.argv[1:] if argv is None else argv
    asked = {ANYWHERE[a] for a in arguments if a in ANYWHERE}
    debug = "debug" in asked
    arguments = [a for a in arguments if a not in ANYWHERE]
    LazyGroup.started = staticmethod(started)
    try:
        with verbosity.level(quiet="quiet" in asked, verbose="verbose" in asked, json="--json" in arguments):
            result = get_command(app).main(args=arguments, prog_name="gyrocal", standalone_mode=False)
            if result == INTERRUPTED:
                raise KeyboardInterrupt
            sys.stdout.flush()
        return result if isinstance(result, int) else 0
    except GyrocalError as error:
        if debug:
            raise
        return _fail(str(error), error.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        return _fail("stopped", INTERRUPTED)
    except BrokenPipeError:
        sys.stderr.close()
        return 1
    except OSError as error:
        if debug:
            raise
        _discard_output()
        wrong_name = error.errno in (errno.ENAMETOOLONG, errno.ELOOP)
        return _fail(f"{f'{error.filename}: ' if error.filename else ''}{error.strerror or error}", 2 if wrong_name else 1)
    except Exception as error:
        if hasattr(error, "format_message"):  # the argument parser's own errors
            return _fail(f"{error.format_message()} See: gyrocal {_verb(arguments)}--help", 2)
        if _interrupted(error):
            return _fail("stopped", INTERRUPTED)
        if debug:
            raise
        return _fail(f"{type(error).__name__}: {error} (run with --debug to see where)", 1)


def _interrupted(error: BaseException) -> bool:
    """True if Ctrl-C is behind an error: a compiled module that is interrupted as it starts raises an ImportError."""
    cause = error.__cause__ or error.__context__
    return isinstance(error, KeyboardInterrupt) or (cause is not None and _interrupted(cause))


def _verb(arguments: list[str]) -> str:
    """The command of the arguments, followed by a blank; empty if there is no command of that name."""
    return f"{arguments[0]} " if arguments and arguments[0] in {*command_modules(), *ALIASES} else ""


def _discard_output() -> None:
    """Discard the interpreter's last flush of stdout, because the failure to write has been reported."""
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)


def _fail(message: str, code: int) -> int:
    print("gyrocal: " + " ".join(message.split()), file=sys.stderr)
    return code
