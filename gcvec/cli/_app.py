"""Finds the commands, runs the one asked for and turns whatever goes wrong into one line and an exit code."""

from __future__ import annotations

import gc
import os
import pkgutil
import sys
import traceback
from collections.abc import Sequence
from importlib import import_module
from typing import Any, cast

import click
from click.exceptions import NoArgsIsHelpError

import gcvec.cli
from gcvec.errors import FailureError, InputError

FAILURE, BAD_INPUT, INTERRUPTED = 1, 2, 130


def engine_commands() -> list[str]:
    """Names of the commands of this package: command `x` is the object `x` of `gcvec/cli/x.py`."""
    return [m.name for m in pkgutil.iter_modules(gcvec.cli.__path__) if not m.name.startswith("_")]


class Commands(click.Group):
    """The commands of this package and those that other packages add under the entry point "gcvec.commands".

    A command's module is imported when the command is run or listed, so that drawing a picture never loads a
    web framework.
    """

    def list_commands(self, ctx: click.Context) -> list[str]:
        from importlib.metadata import entry_points

        added = sorted(entry_points(group="gcvec.commands").names - set(engine_commands()))
        return engine_commands() + added

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in engine_commands():
            return cast("click.Command", getattr(import_module(f"gcvec.cli.{cmd_name}"), cmd_name))
        gc.enable()  # which `main` has put off: those of other packages may run for long
        return _added_command(cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands, each with the first paragraph of its help: click would cut it to one line."""
        commands = {name: self.get_command(ctx, name) for name in self.list_commands(ctx)}
        rows = [(name, _summary(command)) for name, command in commands.items() if command]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command. Raises click.Abort on Ctrl-C, before click prints an empty line for it."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise click.Abort from None


def _summary(command: click.Command) -> str:
    return " ".join((command.help or "").partition("\n\n")[0].split())


def _added_command(name: str) -> click.Command | None:
    from importlib.metadata import entry_points

    for found in entry_points(group="gcvec.commands", name=name):
        try:
            return cast("click.Command", found.load())
        except ModuleNotFoundError as missing:
            return _needs(name, missing.name or "?")
    return None


def _needs(command: str, module: str) -> click.Command:
    """What stands in for a command that cannot be loaded: it says what is missing."""

    def missing() -> None:
        raise InputError(
            f"{command} needs {module}, which is not installed: pip install 'gcvec[service]'",
            code="not-installed",
        )

    return click.Command(
        command,
        callback=missing,
        context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
        help="Not installed: pip install 'gcvec[service]'.",
    )


@click.group(cls=Commands, context_settings={"show_default": True})
@click.version_option(package_name="gcvec", message="%(prog)s %(version)s", help="Print the version.")
def root() -> None:
    """Photos into compact, editable, resolution-free vector images made of generalized Coons patches."""


def run(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code: 0, 1 for a failure, 2 for bad input, 130 for Ctrl-C."""
    try:
        return _exit_code(arguments)
    except InputError as error:
        return _complain(_with_place(error), BAD_INPUT)
    except click.ClickException as error:
        return _complain(error.format_message(), error.exit_code)
    except (KeyboardInterrupt, click.Abort):
        return INTERRUPTED
    except FailureError as error:
        return _complain(str(error), FAILURE)
    except OSError as error:
        return _complain(": ".join(filter(None, (_filename(error), error.strerror or str(error)))), FAILURE)
    except Exception as error:
        if _is_interrupt(error):
            return INTERRUPTED
        if os.environ.get("GCVEC_TRACEBACK"):
            traceback.print_exc()
        cause = " ".join(str(error).split()) or "no message"
        hint = "GCVEC_TRACEBACK=1 shows where"
        return _complain(f"failed: {type(error).__name__}: {cause} ({hint})", FAILURE)


def _exit_code(arguments: Sequence[str]) -> int:
    """That of a command line that is in order, or of none, which is told what there is."""
    try:
        return root.main(arguments, prog_name="gcvec", standalone_mode=False) or 0
    except NoArgsIsHelpError as error:
        click.echo(error.message)
        return BAD_INPUT


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: while a compiled kernel runs it comes out as another one."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _with_place(error: InputError) -> str:
    """The message of an error, and the place that it points at if the message does not hold it."""
    message = str(error)
    return message if error.pointer is None or error.pointer in message else f"{message} ({error.pointer})"


def _filename(error: OSError) -> str:
    return os.fsdecode(error.filename) if isinstance(error.filename, (str, bytes)) else ""


def _complain(message: str, code: int) -> int:
    print(f"gcvec: {' '.join(message.split())}", file=sys.stderr)
    return code
