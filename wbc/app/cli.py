"""The command `wbc`: reads the command line, runs a command and turns errors into exit codes."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence

from cyclopts import App, ArgumentCollection, CycloptsError, MissingArgumentError, Parameter

from wbc._version import __version__
from wbc.app.commands import COMMANDS, GROUPS, summary
from wbc.base.errors import InputError, WbcError, one_line

RAN, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: ran (whatever the result), failed, input that cannot be used, stopped by Ctrl-C."""

LONGEST_LINE = 1000
"""Longest line that says why a command line is refused, characters."""


def make_app(words: Sequence[str] | None = ()) -> App:
    """Build the command-line application from the table of commands; a command's module is imported when it runs."""
    options = {
        "default_parameter": Parameter(negative=(), show_default=False),
        "help_format": "markdown",
        "suppress_keyboard_interrupt": False,  # a command may say what is kept
    }
    app = App(
        name="wbc",
        help="Whole-body QP control for humanoids: tasks, contacts and limits, solved at every tick.",
        help_epilogue="Exit codes: 0 ran, 1 failed, 2 bad input.",
        version=__version__,
        config=(_prepare,),
        **options,
    )
    app.register_install_completion_command(
        help="Install completion of commands and options in your shell: bash, zsh or fish."
    )
    groups = {name: App(name=name, help=about, **options) for name, about in GROUPS.items()}
    for group in groups.values():
        app.command(group)
    for command, place in COMMANDS.items():
        path = command.split()
        parent = app if len(path) == 1 else groups[path[0]]
        about = None if words is None or list(words[: len(path)]) == path else summary(command)
        parent.command(f"wbc.app.commands.{place}", name=path[-1], help=about, **options)
    return app


def _prepare(app: App, commands: tuple[str, ...], arguments: ArgumentCollection) -> None:
    """Check words before they are converted; cyclopts calls it for the command that runs."""
    from wbc.app.arguments import prepare  # noqa: PLC0415 - no list of commands needs it

    prepare(app, commands, arguments)


@contextlib.contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Let signals that end a program leave all blocks: files that are half written are removed."""
    before = {}
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is signal.SIG_DFL:
                before[number] = signal.signal(number, _end)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@_ended_by_signals()
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, the words after `wbc` (those of the process when None), and return the exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without ± must not lose a result
    try:
        make_app(words)(words, exit_on_error=False, print_error=False, result_action="return_value")
        print(end="", flush=True)  # there may be no stdout
    except (CycloptsError, InputError) as error:
        missing = error.argument if isinstance(error, MissingArgumentError) else None
        choices = missing.get_choices() if missing is not None else None
        hint = f" Choose from: {', '.join(choices)}." if choices else ""
        print(f"wbc: {_one_line(error)}{hint}", file=sys.stderr)
        return BAD_INPUT
    except WbcError as error:
        print(f"wbc: {_one_line(error)}", file=sys.stderr)
        return FAILED
    except MemoryError:
        print("wbc: out of memory; ask for less", file=sys.stderr)
        return FAILED
    except BrokenPipeError:  # the reader of the output has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return RAN
    except OSError as error:  # a full disk, a device that is gone
        try:
            sys.stdout.flush()
        except OSError:  # what could not be printed is not tried again at the end
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        print(f"wbc: {_one_line(error)}", file=sys.stderr)
        return BAD_INPUT if error.errno == errno.ENAMETOOLONG else FAILED
    except KeyboardInterrupt as error:
        print(f"wbc: interrupted{f'; {_one_line(error)}' if error.args else ''}", file=sys.stderr)
        return INTERRUPTED
    except Exception:
        traceback.print_exc()
        print("wbc: internal failure; please report it with the lines above", file=sys.stderr)
        return FAILED
    return RAN


def _end(number: int, frame: object) -> None:
    del frame
    raise SystemExit(128 + number)


def _one_line(error: BaseException) -> str:
    line = one_line(str(error))
    return line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 3]}..."


if __name__ == "__main__":
    sys.exit(main())
