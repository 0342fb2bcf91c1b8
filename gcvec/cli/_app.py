"""Finds the commands, runs the one asked for and turns whatever goes wrong into one line and an exit code."""

from __future__ import annotations

import os
import pkgutil
import sys
import traceback
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Annotated, Any, cast

import typer
from typer.core import TyperGroup

import gcvec.cli
from gcvec.errors import InputError

FAILURE, BAD_INPUT, INTERRUPTED = 1, 2, 130


def engine_commands() -> list[str]:
    """Names of the commands of this package: command `x` is the function `x` of `gcvec/cli/x.py`."""
    return [m.name for m in pkgutil.iter_modules(gcvec.cli.__path__) if not m.name.startswith("_")]


class Commands(TyperGroup):
    """The commands of this package and those that other packages add under the entry point "gcvec.commands".

    A command's module is imported when the command is run or listed, so that drawing a picture never
    loads a web framework.
    """

    def list_commands(self, ctx: Any) -> list[str]:
        from importlib.metadata import entry_points

        added = sorted(entry_points(group="gcvec.commands").names - set(engine_commands()))
        return engine_commands() + added

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name in engine_commands():
            function = getattr(import_module(f"gcvec.cli.{cmd_name}"), cmd_name)
        elif (added := _added_command(cmd_name)) is not None:
            function = added
        else:
            return None
        app = typer.Typer(add_completion=False)
        app.command(cmd_name)(function)
        return typer.main.get_command(app)


def _added_command(name: str) -> Callable[..., Any] | None:
    from importlib.metadata import entry_points

    for found in entry_points(group="gcvec.commands", name=name):
        try:
            return cast("Callable[..., Any]", found.load())
        except ModuleNotFoundError as missing:
            return _needs(name, missing.name or "?")
    return None


def _needs(command: str, module: str) -> Callable[[], None]:
    def missing() -> None:
        raise InputError(
            f"{command} needs {module}, which is not installed: pip install 'gcvec[service]'",
            code="not-installed",
        )

    missing.__doc__ = "Not installed: pip install 'gcvec\\[service]'."
    return missing


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"gcvec {version('gcvec')}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Photos into compact, editable, resolution-free vector images made of generalized Coons patches."""


def run(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code: 0, 1 for a failure, 2 for bad input, 130 for Ctrl-C."""
    app = typer.Typer(cls=Commands, no_args_is_help=True)
    app.callback()(_root)
    try:
        return app(list(arguments), prog_name="gcvec", standalone_mode=False) or 0
    except InputError as error:
        return _complain(f"{error} ({error.pointer})" if error.pointer else str(error), BAD_INPUT)
    except typer.TyperException as error:
        return _complain(error.format_message(), error.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED
    except OSError as error:
        return _complain(": ".join(filter(None, (_filename(error), error.strerror or str(error)))), FAILURE)
    except Exception as error:
        if _is_interrupt(error):
            return INTERRUPTED
        if type(error) is RuntimeError:  # how a command says that it failed, and why
            return _complain(str(error), FAILURE)
        if os.environ.get("GCVEC_TRACEBACK"):
            traceback.print_exc()
        cause = " ".join(str(error).split()) or "no message"
        hint = "GCVEC_TRACEBACK=1 shows where"
        return _complain(f"failed: {type(error).__name__}: {cause} ({hint})", FAILURE)


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: while a compiled kernel runs it comes out as another one."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _filename(error: OSError) -> str:
    return os.fsdecode(error.filename) if isinstance(error.filename, (str, bytes)) else ""


def _complain(message: str, code: int) -> int:
    if message:  # typer has none when it has shown the help instead
        print(f"gcvec: {' '.join(message.split())}", file=sys.stderr)
    return code
